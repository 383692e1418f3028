#include "publishers.h"

#include <algorithm>

#include <diagnostic_msgs/DiagnosticStatus.h>
#include <ros/console.h>
#include <sensor_msgs/JointState.h>

#include "border_check.h"
#include "cluster_markers.h"
#include "collision_markers.h"
#include "contact_markers.h"
#include "convert.h"
#include "crtk_messages.h"
#include "surfaces.h"

namespace meshless {
namespace {

constexpr const char* kTools[] = {"pick", "push", "scissors"};
constexpr const char* kToolFrames[] = {"pick_cursor", "push_sphere", "scissors"};
constexpr std::size_t kMaxQueuedEvents = 10000;
constexpr double kClustersRate = 10.0;  // [Hz]
constexpr double kContactsRate = 30.0;  // [Hz]
constexpr double kCompleteRate = 1.0;   // [Hz] of vertices of all bodies, moved or not
constexpr double kInfoRate = 5.0;       // [Hz] of looks whether there is news
constexpr double kBehind = 0.95;        // a real-time factor below it is worth a warning

std::chrono::steady_clock::duration periodOf(double rate) {
  return std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(1.0 / rate));
}

}  // namespace

void summarize(const RunnerStatus& runner, std::uint64_t overruns_before,
               diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  if (!runner.fault.empty()) {
    status.summary(Level::ERROR, runner.fault);
  } else if (runner.paused) {
    status.summary(Level::OK, "paused");
  } else if (runner.overruns > overruns_before && runner.real_time_factor < kBehind) {
    status.summary(Level::WARN, "slower than real time");
  } else {
    status.summary(Level::OK, "runs");
  }
}

bool Publishers::Cadence::due(Clock::time_point now) {
  if (now < next) return false;
  next = std::max(next + period, now);
  return true;
}

Publishers::Publishers(const ros::NodeHandle& private_handle, const NodeSettings& settings, WorldRunner& runner,
                       const StreamedTools& tools, NamedInstruments* named, const Rejections& rejections)
    : settings_(settings),
      runner_(runner),
      tools_(tools),
      named_(named),
      rejections_(rejections),
      markers_(settings.world_frame),
      updater_(ros::NodeHandle(), private_handle) {
  ros::NodeHandle handle(private_handle);
  // No latching: what a late listener needs is a full set as of now, and that it gets because it is noticed.
  markers_topic_ = handle.advertise<visualization_msgs::MarkerArray>(
      "markers", 5, [this](const ros::SingleSubscriberPublisher&) { markers_newcomer_ = true; });
  obstacles_topic_ = handle.advertise<visualization_msgs::MarkerArray>("obstacles", 1, true);
  points_topic_ = handle.advertise<sensor_msgs::PointCloud2>(
      "points", 5, [this](const ros::SingleSubscriberPublisher&) { points_newcomer_ = true; });
  const auto on_surfaces = [this](const ros::SingleSubscriberPublisher&) { surfaces_newcomer_ = true; };
  surfaces_topic_ = handle.advertise<meshless_surgery::Surfaces>("surfaces", 2, on_surfaces);
  strained_surfaces_topic_ = handle.advertise<meshless_surgery::Surfaces>("strained_surfaces", 2, on_surfaces);
  clusters_topic_ = handle.advertise<visualization_msgs::MarkerArray>(
      "clusters", 2, [this](const ros::SingleSubscriberPublisher&) { clusters_newcomer_ = true; });
  collision_topic_ = handle.advertise<visualization_msgs::MarkerArray>(
      "collision_surfaces", 2, [this](const ros::SingleSubscriberPublisher&) { collision_newcomer_ = true; });
  contacts_topic_ = handle.advertise<visualization_msgs::MarkerArray>(
      "contacts", 2, [this](const ros::SingleSubscriberPublisher&) { contacts_newcomer_ = true; });
  contact_forces_topic_ = handle.advertise<meshless_surgery::ContactForces>(
      "contact_forces", 5, [this](const ros::SingleSubscriberPublisher&) { contact_forces_newcomer_ = true; });
  topology_topic_ = handle.advertise<meshless_surgery::Topology>("topology", 2, true);
  images_topic_ = handle.advertise<meshless_surgery::TissueImages>("images", 1, true);
  vertices_topic_ = handle.advertise<meshless_surgery::Vertices>(
      "vertices", 5, [this](const ros::SingleSubscriberPublisher&) { vertices_newcomer_ = true; });
  info_topic_ = handle.advertise<meshless_surgery::Info>("info", 1, true);
  state_topic_ = handle.advertise<meshless_surgery::State>("state", 10);
  events_topic_ = handle.advertise<meshless_surgery::Event>("events", 1000);
  for (std::size_t t = 0; t < tool_topics_.size(); ++t) {
    const std::string tool = kTools[t];
    tool_topics_[t].measured = handle.advertise<geometry_msgs::PoseStamped>(tool + "/measured_cp", 10);
    tool_topics_[t].setpoint = handle.advertise<geometry_msgs::PoseStamped>(tool + "/setpoint_cp", 10);
    tool_topics_[t].state = handle.advertise<CrtkOperatingState>(tool + "/operating_state", 10, true);
  }
  jaw_topic_ = handle.advertise<sensor_msgs::JointState>("scissors/jaw/measured_js", 10);

  updater_.setHardwareID("none");
  updater_.add("simulation", this, &Publishers::diagnose);

  markers_due_.period = periodOf(settings_.markers_rate);
  clusters_due_.period = collision_due_.period = periodOf(kClustersRate);
  contacts_due_.period = periodOf(kContactsRate);
  surfaces_due_.period = periodOf(settings_.surfaces_rate);
  vertices_due_.period = periodOf(settings_.vertices_rate);
  complete_due_.period = periodOf(kCompleteRate);
  points_due_.period = periodOf(settings_.points_rate);
  info_due_.period = periodOf(kInfoRate);
  state_due_.period = periodOf(settings_.state_rate);
  tools_due_.period = periodOf(settings_.tools_rate);
  diagnostics_due_.period = std::chrono::seconds(1);
}

Publishers::~Publishers() { stop(); }

void Publishers::start() {
  const auto now = Clock::now();
  for (Cadence* cadence :
       {&info_due_, &vertices_due_, &complete_due_, &markers_due_, &surfaces_due_, &clusters_due_, &collision_due_,
        &contacts_due_, &points_due_, &state_due_, &tools_due_, &diagnostics_due_}) {
    cadence->next = now;
  }
  thread_ = std::thread([this] { loop(); });
}

void Publishers::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Publishers::queueEvents(std::vector<Event> events) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (Event& event : events) events_.push_back(std::move(event));
    while (events_.size() > kMaxQueuedEvents) {
      events_.pop_front();
      ++lost_events_;
    }
  }
  changed_.notify_all();
}

void Publishers::loop() {
  while (true) {
    publishEvents();
    publishTick(Clock::now());
    const auto next = std::min({info_due_.next, vertices_due_.next, markers_due_.next, surfaces_due_.next,
                                clusters_due_.next, collision_due_.next, contacts_due_.next, points_due_.next,
                                state_due_.next, tools_due_.next, diagnostics_due_.next});
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_until(lock, next, [this] { return stopping_ || !events_.empty(); });
    if (stopping_) return;
  }
}

void Publishers::publishEvents() {
  std::deque<Event> events;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    events.swap(events_);
  }
  for (const Event& event : events) {
    if (event.type == EventType::kFault) ROS_ERROR_STREAM(event.text);
    if ((event.type == EventType::kOverBudget && !event.body.empty()) || event.type == EventType::kMisfired)
      ROS_WARN_STREAM(event.text);  // not of each late step
  }
  if (events.empty() || events_topic_.getNumSubscribers() == 0) return;
  std_msgs::Header header;
  header.stamp = ros::Time::now();
  header.frame_id = settings_.world_frame;
  for (const Event& event : events) events_topic_.publish(toEvent(event, header));
}

void Publishers::publishTick(Clock::time_point now) {
  if (diagnostics_due_.due(now)) updater_.force_update();

  // What is due, and has both a listener and news.
  const std::uint64_t revision = runner_.revision(), commands = runner_.commands();
  bool markers = markers_due_.due(now) && markers_topic_.getNumSubscribers() > 0;
  const bool markers_fresh = markers && markers_newcomer_.exchange(false);
  markers = markers && (markers_fresh || revision != markers_revision_ || markers_.deleting());
  bool points = points_due_.due(now) && points_topic_.getNumSubscribers() > 0;
  const bool points_fresh = points && points_newcomer_.exchange(false);
  points = points && (points_fresh || revision != points_revision_);
  bool vertices = vertices_due_.due(now) && vertices_topic_.getNumSubscribers() > 0;
  const bool vertices_fresh = vertices && vertices_newcomer_.exchange(false);
  vertices = vertices && (vertices_fresh || revision != vertices_revision_);
  bool surfaces = surfaces_due_.due(now) &&
                  (surfaces_topic_.getNumSubscribers() > 0 || strained_surfaces_topic_.getNumSubscribers() > 0);
  const bool surfaces_fresh = surfaces && surfaces_newcomer_.exchange(false);
  surfaces = surfaces && (surfaces_fresh || revision != surfaces_revision_);
  bool clusters = clusters_due_.due(now) && clusters_topic_.getNumSubscribers() > 0;
  clusters = clusters && (clusters_newcomer_.exchange(false) || revision != clusters_revision_);
  bool collision = collision_due_.due(now) && collision_topic_.getNumSubscribers() > 0;
  collision = collision && (collision_newcomer_.exchange(false) || revision != collision_revision_);
  const bool contacts_due = contacts_due_.due(now);
  bool contacts = contacts_due && contacts_topic_.getNumSubscribers() > 0;
  contacts = contacts && (contacts_newcomer_.exchange(false) || revision != contacts_revision_);
  bool forces = contacts_due && contact_forces_topic_.getNumSubscribers() > 0;
  forces = forces && (contact_forces_newcomer_.exchange(false) || revision != contact_forces_revision_);
  const bool state = state_due_.due(now) && state_topic_.getNumSubscribers() > 0;
  const bool tools = tools_due_.due(now);
  const bool info = info_due_.due(now) && (revision != info_revision_ || info_.version.empty());
  if (!info && !vertices && !markers && !surfaces && !clusters && !collision && !contacts && !forces && !points &&
      !state && !tools)
    return;

  SnapshotWants wants;
  wants.surfaces = markers || surfaces || vertices;
  wants.particles = points || clusters || collision;
  wants.measures = state;
  wants.contacts = contacts || forces || surfaces;
  // The stamp comes first: who sees one later than an answer sees what was answered.
  std_msgs::Header header;
  header.stamp = ros::Time::now();
  header.frame_id = settings_.world_frame;
  const auto snapshot = runner_.snapshot(wants);
  if (!snapshot) return;
  const auto instruments =
      markers || surfaces ? instruments_.parts(*snapshot, tools_.hand(ToolKind::kPick), tools_.hand(ToolKind::kPush))
                          : std::vector<meshless_surgery::InstrumentPart>();
  meshless_surgery::Surfaces tools_now;
  if (markers || surfaces) tools_now = toolsIn(*snapshot);
  tools_now.instruments = instruments;
  const auto news = [&](Stillness& still, bool particles) {
    return still.news(*snapshot, particles, particles ? meshless_surgery::Surfaces() : tools_now, commands, now);
  };
  // Each is asked, so that it knows what is published.
  markers = markers && (news(markers_still_, false) || markers_fresh || markers_.deleting());
  surfaces = surfaces && (news(surfaces_still_, false) || surfaces_fresh);
  points = points && (news(points_still_, true) || points_fresh);
  if (markers) {
    ++markers_built_;
    markers_revision_ = revision;
    markers_topic_.publish(markers_.build(*snapshot, header.stamp, markers_fresh, instruments));
  }
  if (info || vertices || surfaces) publishTopology(*snapshot, header);
  if (vertices) {
    ++vertices_built_;
    vertices_revision_ = revision;
    const auto moved = moving_.vertices(*snapshot, header, vertices_fresh || complete_due_.due(now));
    if (moved.complete || !moved.bodies.empty()) vertices_topic_.publish(moved);
  }
  if (surfaces) {
    surfaces_revision_ = revision;
    publishSurfaces(*snapshot, header, instruments);
  }
  if (clusters) {
    ++clusters_built_;
    clusters_revision_ = revision;
    clusters_topic_.publish(clusterMarkers(*snapshot, header));
  }
  if (collision) {
    ++collision_built_;
    collision_revision_ = revision;
    collision_topic_.publish(collisionMarkers(*snapshot, header));
  }
  if (contacts) {
    ++contacts_built_;
    contacts_revision_ = revision;
    contacts_topic_.publish(contactMarkers(*snapshot, header));
  }
  if (forces) {
    contact_forces_revision_ = revision;
    contact_forces_topic_.publish(toContactForces(*snapshot, header));
  }
  if (points) {
    ++points_built_;
    points_revision_ = revision;
    points_topic_.publish(toCloud(*snapshot, header));
  }
  if (state) {
    ++states_built_;
    state_topic_.publish(toState(*snapshot, runner_.status(), header));
  }
  if (info) {
    info_revision_ = revision;
    publishInfo(*snapshot, header);
    if (snapshot->obstacles != obstacles_) {
      obstacles_ = snapshot->obstacles;
      obstacles_topic_.publish(obstacleMarkers(*snapshot, header));
    }
  }
  if (tools) publishTools(*snapshot, header.stamp);
}

void Publishers::publishInfo(const WorldSnapshot& snapshot, const std_msgs::Header& header) {
  meshless_surgery::Info info = toInfo(snapshot, runner_.worldSettings());
  info.scene = settings_.scene;
  info.version = MESHLESS_SURGERY_VERSION;
  info.world_frame = settings_.world_frame;
  info.header = info_.header;
  if (info == info_) return;
  info.header = header;
  info_ = info;
  info_topic_.publish(info_);
}

void Publishers::publishTopology(const WorldSnapshot& snapshot, const std_msgs::Header& header) {
  const auto changed = moving_.change(snapshot, header);
  if (!changed) return;
  if (const auto images = moving_.newImages(snapshot, header)) images_topic_.publish(*images);
  topology_topic_.publish(*changed);
}

void Publishers::publishSurfaces(const WorldSnapshot& snapshot, const std_msgs::Header& header,
                                 const std::vector<meshless_surgery::InstrumentPart>& instruments) {
  ++surfaces_built_;
  for (const bool strain : {false, true}) {
    const ros::Publisher& topic = strain ? strained_surfaces_topic_ : surfaces_topic_;
    if (topic.getNumSubscribers() == 0) continue;
    auto message = toSurfaces(snapshot, header, strain);
    message.topology = moving_.topology();
    message.instruments = instruments;
    topic.publish(message);
  }
}

void Publishers::publishTools(const WorldSnapshot& snapshot, const ros::Time& stamp) {
  std::vector<geometry_msgs::TransformStamped> transforms;
  // Without a pick, the hand is where its stream last was.
  const Pick* in_hand = pickInHand(snapshot);
  auto cursor = tools_.hand(ToolKind::kPick);
  if (in_hand != nullptr) {
    if (!cursor) cursor = Pose{};
    cursor->translation = in_hand->target;
  }
  std::optional<Shown> shown;
  if (cursor) {
    const auto hand = tools_.hand(ToolKind::kPick);
    shown = Shown{*cursor, hand ? *hand : *cursor};
  }
  publishTool(ToolKind::kPick, shown, stamp, transforms);
  shown.reset();
  if (snapshot.push.enabled) {
    shown = Shown{};
    shown->measured.translation = snapshot.push.position;
    shown->setpoint.translation = snapshot.push.target;
  }
  publishTool(ToolKind::kPush, shown, stamp, transforms);
  shown.reset();
  if (snapshot.scissors.shown) {
    const Pose pose = poseOf(snapshot.scissors.blades);
    const auto hand = tools_.hand(ToolKind::kScissors);
    shown = Shown{pose, hand ? *hand : pose};
  }
  publishTool(ToolKind::kScissors, shown, stamp, transforms);
  publishJaw(snapshot.scissors, stamp);
  publishConditions(snapshot, stamp);
  if (named_) named_->publish(snapshot, stamp, transforms);
  // A clock that stands still: tf2 complains of a stamp said twice.
  if (!transforms.empty() && stamp != last_transforms_) {
    last_transforms_ = stamp;
    broadcaster_.sendTransform(transforms);
  }
}

void Publishers::publishTool(ToolKind tool, const std::optional<Shown>& shown, const ros::Time& stamp,
                             std::vector<geometry_msgs::TransformStamped>& transforms) {
  ToolTopics& topics = tool_topics_[static_cast<std::size_t>(tool)];
  // CRTK: what is not valid carries the stamp 0. Said once, when the tool goes.
  if (!shown && !topics.there) return;
  topics.there = shown.has_value();
  geometry_msgs::PoseStamped message;
  message.header.frame_id = settings_.world_frame;
  if (shown) message.header.stamp = stamp;
  message.pose = toPose(shown ? shown->measured : Pose{});
  if (topics.measured.getNumSubscribers() > 0) topics.measured.publish(message);
  if (topics.setpoint.getNumSubscribers() > 0) {
    if (shown) message.pose = toPose(shown->setpoint);
    topics.setpoint.publish(message);
  }
  if (!shown) return;
  geometry_msgs::TransformStamped transform;
  transform.header = message.header;
  transform.child_frame_id = prefixed(settings_.tf_prefix, kToolFrames[static_cast<std::size_t>(tool)]);
  transform.transform.translation = toVector(shown->measured.translation);
  transform.transform.rotation = toQuaternion(shown->measured.rotation);
  transforms.push_back(transform);
}

void Publishers::publishJaw(const Scissors& scissors, const ros::Time& stamp) {
  if (!scissors.shown && !jaw_there_) return;
  jaw_there_ = scissors.shown;
  if (jaw_topic_.getNumSubscribers() == 0) return;
  sensor_msgs::JointState message;
  message.header.frame_id = settings_.world_frame;
  if (scissors.shown) message.header.stamp = stamp;
  message.name = {"jaw"};
  message.position = {scissors.shown ? scissors.angle : 0.0};
  jaw_topic_.publish(message);
}

void Publishers::publishConditions(const WorldSnapshot& snapshot, const ros::Time& stamp) {
  const bool fault = !runner_.status().fault.empty();
  const bool sphere_travels = snapshot.push.enabled && snapshot.push.position != snapshot.push.target;
  for (std::size_t t = 0; t < tool_topics_.size(); ++t) {
    const StreamedTools::Condition condition = tools_.condition(static_cast<ToolKind>(t));
    ToolTopics& topics = tool_topics_[t];
    CrtkOperatingState message;
    message.state = fault ? "FAULT" : toString(condition.state);
    const bool busy = condition.busy || (static_cast<ToolKind>(t) == ToolKind::kPush && sphere_travels);
    message.is_busy = busy && !fault ? 1 : 0;
    if (message.state == topics.said_state && (message.is_busy != 0) == topics.said_busy) continue;
    topics.said_state = message.state;
    topics.said_busy = message.is_busy != 0;
    message.header.stamp = stamp;
    topics.state.publish(message);
  }
}

void Publishers::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const RunnerStatus runner = runner_.status();
  const Rejections::Summary rejected = rejections_.summary();
  summarize(runner, diagnosed_overruns_, status);
  diagnosed_overruns_ = runner.overruns;
  status.add("steps", runner.steps);
  status.add("step rate wanted [Hz]", numberText(runner_.worldSettings().step_rate));
  status.add("step rate [Hz]", numberText(runner.step_rate));
  status.add("real-time factor", numberText(runner.real_time_factor));
  status.add("mean step [ms]", numberText(1e3 * runner.mean_step));
  status.add("worst step [ms]", numberText(1e3 * runner.worst_step));
  status.add("overruns", runner.overruns);
  status.add("dropped [s]", numberText(runner.dropped));
  status.add("rejected input", rejected.total);
  for (const auto& [where, count] : rejected.by_name) status.add("rejected by " + where, count);
  if (!rejected.last.empty()) status.add("last rejection", rejected.last);
  std::uint64_t lost = 0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    lost = lost_events_;
  }
  status.add("lost events", lost);
  MemoryUse memory;
  if (runner_.look([&memory](World& world) { memory = world.memory(); }).ok()) {
    constexpr double kMegabyte = 1e6;
    const auto megabytes = [](std::size_t bytes) { return numberText(static_cast<double>(bytes) / kMegabyte); };
    status.add("particles", memory.particles);
    status.add("memory of models [MB]", megabytes(memory.models));
    status.add("memory of states [MB]", megabytes(memory.states));
    status.add("memory of contact [MB]", megabytes(memory.contact));
    status.add("memory for reset and undo [MB]", megabytes(memory.kept));
    status.add("memory per particle [bytes]", numberText(memory.perParticle()));
  }
  status.add("marker arrays built", markers_built_);
  status.add("surfaces built", surfaces_built_);
  status.add("vertices built", vertices_built_);
  status.add("clusters built", clusters_built_);
  status.add("collision surfaces built", collision_built_);
  status.add("contacts built", contacts_built_);
  status.add("point clouds built", points_built_);
  status.add("states built", states_built_);
}

}  // namespace meshless
