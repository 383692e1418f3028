#include "named_instruments.h"

#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/console.h>

#include "border_check.h"
#include "convert.h"

namespace meshless {
namespace {

constexpr double kComplainEvery = 5.0;  // [s] of a stream that goes wrong
constexpr double kArrived = 1e-4;       // [m], and rad of the jaws

geometry_msgs::Wrench toWrench(const Vec3& force, const Vec3& torque) {
  geometry_msgs::Wrench wrench;
  wrench.force = toVector(force);
  wrench.torque = toVector(torque);
  return wrench;
}

}  // namespace

NamedInstruments::NamedInstruments(const ros::NodeHandle& private_handle, const NodeSettings& settings,
                                   const Clock& clock, WorldRunner& runner, Frames& frames, Rejections& rejections,
                                   StreamedTools& tools)
    : handle_(private_handle),
      settings_(settings),
      clock_(clock),
      runner_(runner),
      frames_(frames),
      rejections_(rejections),
      tools_(tools) {}

NamedInstruments::~NamedInstruments() {
  for (auto& [name, topics] : topics_) topics->close();
}

void NamedInstruments::Topics::close() {
  for (ros::Subscriber* subscriber : {&servo, &jaw, &command}) subscriber->shutdown();
}

void NamedInstruments::reject(const std::string& topic, const Error& error) {
  rejections_.count(topic, error.detail);
  ROS_WARN_STREAM_THROTTLE(kComplainEvery, topic << ": " << error.detail);
}

void NamedInstruments::open(const std::string& name, bool has_jaws) {
  const auto topics = std::make_shared<Topics>();
  topics_[name] = topics;
  topics->has_jaws = has_jaws;
  // Callbacks hold what they need: an instrument may go while one runs.
  const auto hints = ros::TransportHints().tcpNoDelay();
  topics->measured = handle_.advertise<geometry_msgs::PoseStamped>(name + "/measured_cp", 10);
  topics->setpoint = handle_.advertise<geometry_msgs::PoseStamped>(name + "/setpoint_cp", 10);
  topics->velocity = handle_.advertise<geometry_msgs::TwistStamped>(name + "/measured_cv", 10);
  topics->force = handle_.advertise<geometry_msgs::WrenchStamped>(name + "/body/measured_cf", 10);
  topics->state = handle_.advertise<CrtkOperatingState>(name + "/operating_state", 10, true);
  const std::weak_ptr<Topics> weak = topics;
  topics->servo = handle_.subscribe<geometry_msgs::PoseStamped>(
      name + "/servo_cp", 10,
      [this, name, weak](const geometry_msgs::PoseStamped::ConstPtr& message) {
        if (const auto held = weak.lock()) onServo(name, *held, *message);
      },
      {}, hints);
  topics->command = handle_.subscribe<CrtkString>(
      name + "/state_command", 10, [this, name, weak](const boost::shared_ptr<const CrtkString>& message) {
        if (const auto held = weak.lock()) onCommand(name, *held, message->string);
      });
  if (!has_jaws) return;
  topics->jaw_state = handle_.advertise<sensor_msgs::JointState>(name + "/jaw/measured_js", 10);
  topics->jaw = handle_.subscribe<sensor_msgs::JointState>(
      name + "/jaw/servo_jp", 10,
      [this, name, weak](const sensor_msgs::JointState::ConstPtr& message) {
        if (const auto held = weak.lock()) onJaw(name, *held, *message);
      },
      {}, hints);
}

bool NamedInstruments::hears(const std::string& topic, Topics& topics) {
  const std::lock_guard<std::mutex> lock(topics.mutex);
  if (topics.operating != Operating::kEnabled) {
    reject(topic, {ErrorCode::kInvalidArgument, std::string("the instrument is ") + toString(topics.operating) +
                                                    "; accepted once its state_command was " +
                                                    (topics.operating == Operating::kPaused ? "resume" : "enable")});
    return false;
  }
  topics.heard = clock_.now();
  topics.alive = true;
  return true;
}

void NamedInstruments::lead(const std::string& topic, LeadInstrumentCommand command) {
  runner_.post([this, topic, command = std::move(command)](World& world) {
    if (const auto reply = world.apply(command); !reply.ok()) reject(topic, reply.error());
  });
}

void NamedInstruments::onServo(const std::string& name, Topics& topics, const geometry_msgs::PoseStamped& message) {
  const std::string topic = "~" + name + "/servo_cp";
  BorderCheck check;
  const Pose local = check.pose("pose", message.pose);
  if (!check.ok()) return reject(topic, check.error());
  const auto frame = frames_.toWorld(message.header);
  if (!frame.ok()) return reject(topic, frame.error());
  Pose pose;
  pose.rotation = frame->rotation * local.rotation;
  pose.translation = check.place("pose.position", *frame, local.translation);
  if (!check.ok()) return reject(topic, check.error());
  {
    const std::lock_guard<std::mutex> lock(topics.mutex);
    const double stamp = message.header.stamp.toSec();
    if (stamp > 0.0 && topics.order.hear(stamp, clock_.now()) == StampOrder::Is::kLate)
      return reject(topic, {ErrorCode::kInvalidArgument, "the pose is older than one before it; accepted: the newest"});
  }
  if (!hears(topic, topics)) return;
  LeadInstrumentCommand command;
  command.name = name;
  command.pose = pose;
  lead(topic, std::move(command));
}

void NamedInstruments::onJaw(const std::string& name, Topics& topics, const sensor_msgs::JointState& message) {
  const std::string topic = "~" + name + "/jaw/servo_jp";
  BorderCheck check;
  LeadInstrumentCommand command;
  command.name = name;
  if (message.position.empty())
    check.fault("position is empty; accepted: position[0], the angle between the jaws in rad");
  else
    command.jaw = check.number("position[0]", message.position[0], -kWidestJaw, kWidestJaw, "rad");
  if (!check.ok()) return reject(topic, check.error());
  command.jaw = std::max(0.0, *command.jaw);  // masters close beyond what is shut
  if (hears(topic, topics)) lead(topic, std::move(command));
}

void NamedInstruments::onCommand(const std::string& name, Topics& topics, const std::string& word) {
  const std::lock_guard<std::mutex> lock(topics.mutex);
  const bool enabled = topics.operating == Operating::kEnabled, paused = topics.operating == Operating::kPaused;
  if (word == "enable" && !paused) {
    topics.operating = Operating::kEnabled;
  } else if (word == "disable") {
    topics.operating = Operating::kDisabled;
  } else if (word == "pause" && enabled) {
    topics.operating = Operating::kPaused;
  } else if (word == "resume" && paused) {
    topics.operating = Operating::kEnabled;
  } else if (word != "home") {
    const char* fits = enabled ? "disable, pause, home" : paused ? "disable, resume, home" : "enable, home";
    return reject(
        "~" + name + "/state_command",
        {ErrorCode::kInvalidArgument, "the instrument is " + std::string(toString(topics.operating)) +
                                          " and the command is '" + printable(word) + "'; accepted: " + fits});
  }
  if (topics.operating != Operating::kEnabled) topics.alive = false;
  tools_.noteInstrument(name, topics.operating);
}

void NamedInstruments::publish(const WorldSnapshot& snapshot, const ros::Time& stamp,
                               std::vector<geometry_msgs::TransformStamped>& transforms) {
  for (auto at = topics_.begin(); at != topics_.end();) {
    const bool there = std::any_of(snapshot.instruments.begin(), snapshot.instruments.end(), [&](const Instrument& i) {
      return i.def.name == at->first && i.def.hasJaws() == at->second->has_jaws;
    });
    if (!there) {
      at->second->close();
      tools_.noteInstrument(at->first, std::nullopt);
    }
    at = there ? std::next(at) : topics_.erase(at);
  }
  const bool fault = !runner_.status().fault.empty();
  for (const Instrument& instrument : snapshot.instruments) {
    const std::string& name = instrument.def.name;
    if (topics_.count(name) == 0) open(name, instrument.def.hasJaws());
    Topics& topics = *topics_[name];
    std_msgs::Header header;
    header.stamp = stamp;
    header.frame_id = settings_.world_frame;
    geometry_msgs::PoseStamped pose;
    pose.header = header;
    pose.pose = toPose(instrument.pose);
    topics.measured.publish(pose);
    pose.pose = toPose(instrument.target);
    topics.setpoint.publish(pose);
    geometry_msgs::TwistStamped velocity;
    velocity.header = header;
    velocity.twist.linear = toVector(instrument.velocity);
    velocity.twist.angular = toVector(instrument.spin);
    topics.velocity.publish(velocity);
    // CRTK: of the body's frame.
    geometry_msgs::WrenchStamped force;
    force.header = header;
    force.header.frame_id = prefixed(settings_.tf_prefix, name);
    const Quat back = instrument.pose.rotation.conjugate();
    force.wrench = toWrench(back * instrument.force, back * instrument.torque);
    topics.force.publish(force);
    if (instrument.def.hasJaws()) {
      sensor_msgs::JointState jaw;
      jaw.header = header;
      jaw.name = {"jaw"};
      jaw.position = {instrument.jaw};
      jaw.velocity = {instrument.jaw_rate};
      jaw.effort = {instrument.jaw_torque};
      topics.jaw_state.publish(jaw);
    }
    geometry_msgs::TransformStamped transform;
    transform.header = header;
    transform.child_frame_id = prefixed(settings_.tf_prefix, name);
    transform.transform.translation = toVector(instrument.pose.translation);
    transform.transform.rotation = toQuaternion(instrument.pose.rotation);
    if (transform.child_frame_id != header.frame_id) transforms.push_back(transform);
    if (instrument.def.type == InstrumentType::kEndoscope) {
      transform.child_frame_id += "/view";
      transform.transform.rotation = toQuaternion(sightOf(instrument.def, instrument.pose).rotation);
      transforms.push_back(transform);
    }

    CrtkOperatingState state;
    state.header = header;
    const bool busy = (instrument.target.translation - instrument.hand.translation).norm() > kArrived ||
                      instrument.target.rotation.angularDistance(instrument.hand.rotation) > kArrived ||
                      std::abs(instrument.jaw_target - instrument.jaw_hand) > kArrived;
    bool fell_silent = false;
    {
      const std::lock_guard<std::mutex> lock(topics.mutex);
      state.state = fault ? "FAULT" : toString(topics.operating);
      fell_silent =
          topics.alive && settings_.tools_silence > 0.0 && clock_.now() - topics.heard > settings_.tools_silence;
      if (fell_silent) topics.alive = false;
    }
    if (fell_silent) {
      const std::string said = "instrument " + name + ": its stream was silent for " +
                               numberText(settings_.tools_silence) + " s; it stays where it is and lets go of nothing";
      if (instrument.holds.empty())
        ROS_INFO_STREAM(said);
      else
        ROS_WARN_STREAM(said);
    }
    state.is_busy = busy && !fault ? 1 : 0;
    if (state.state == topics.said_state && (state.is_busy != 0) == topics.said_busy) continue;
    topics.said_state = state.state;
    topics.said_busy = state.is_busy != 0;
    topics.state.publish(state);
  }
}

}  // namespace meshless
