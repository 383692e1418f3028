#include "meshless_surgery/ros/review_node.h"

#include <cmath>
#include <filesystem>
#include <fstream>

#include <meshless_surgery/Bookmarks.h>
#include <meshless_surgery/Play.h>
#include <meshless_surgery/Review.h>
#include <meshless_surgery/Seek.h>

#include "answers.h"
#include "publishers.h"
#include "session.h"
#include "meshless_surgery/training/frame.h"
#include "meshless_surgery/world/log_review.h"

namespace meshless {
namespace {

namespace fs = std::filesystem;

constexpr const char* kToolNames[] = {"pick", "push", "scissors", "instruments"};
constexpr double kReviewRate = 10.0;                      // [Hz]
constexpr double kLeastSpeed = 0.01, kMostSpeed = 100.0;  // of simulated over real time
constexpr float kPathWidth = 0.0015f;                     // [m]
constexpr double kFullForce = 5.0;                        // [N] that a path shows red
constexpr std::size_t kMostPathPoints = 200000;           // of a tool

Error outOfRange(const std::string& name, double value, const std::string& accepted) {
  return {ErrorCode::kInvalidArgument, name + " is " + numberText(value) + "; accepted: " + accepted};
}

/// A path, or a name in the session directory.
std::string logFile(const std::string& log, const std::string& folder) {
  return log.find('/') != std::string::npos ? log : folder + "/" + log;
}

Result<LogPlayer> openLog(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  std::error_code failed;
  if (!stream || !fs::is_regular_file(file, failed))
    return Error{ErrorCode::kUnreadable, "there is no log " + printable(file)};
  return LogPlayer::open(stream);
}

Result<LogIndex> readIndex(const std::string& file) {
  auto stream = std::make_unique<std::ifstream>(file, std::ios::binary);
  if (!*stream) return Error{ErrorCode::kUnreadable, "there is none"};
  return LogIndex::read(std::move(stream));
}

/// Plays the log once, and leaves the index beside it.
Status makeIndex(LogPlayer& log, const std::string& file) {
  const std::string part = file + ".part";
  std::ofstream out(part, std::ios::binary | std::ios::trunc);
  writeLogIndex(
      log, 2, [&](const std::string& bytes) { out << bytes; },
      [&](std::uint64_t done, std::uint64_t end) {
        ROS_INFO_STREAM_THROTTLE(2.0, "making the index of the log: " << 100 * done / end << " %");
      });
  out.close();
  std::error_code failed;
  if (out) fs::rename(part, file, failed);
  if (!out || failed)
    return Error{ErrorCode::kFailed, "cannot write " + file + "; accepted: a log in a folder that can be written to"};
  return Done{};
}

/// Paths of the hands, coloured by force.
visualization_msgs::MarkerArray toPaths(const LogIndex& index, std::uint64_t end, const std_msgs::Header& header) {
  struct Path {
    visualization_msgs::Marker marker;
    std::optional<LogTool> last;
    std::uint64_t seen = 0;  // number of the moment
  };
  std::map<std::pair<ToolKind, PickId>, Path> paths;
  const std::size_t every = 1 + index.moments().size() / kMostPathPoints;
  std::uint64_t number = 0;
  for (std::size_t m = 0; m < index.moments().size(); m += every) {
    const LogMoment& moment = index.moments()[m];
    if (moment.at > end) break;
    ++number;
    for (const LogTool& tool : moment.tools) {
      Path& path = paths[{tool.kind, tool.pick}];
      if (path.last && path.seen + 1 == number) {
        std_msgs::ColorRGBA color;
        const double load = std::min(tool.force / kFullForce, 1.0);
        color.r = static_cast<float>(load);
        color.g = static_cast<float>(1.0 - load);
        color.b = static_cast<float>(0.8 * (1.0 - load));
        color.a = 0.8f;
        for (const Vec3& p : {path.last->position, tool.position}) {
          path.marker.points.push_back(toPoint(p));
          path.marker.colors.push_back(color);
        }
      }
      path.last = tool;
      path.seen = number;
    }
  }
  visualization_msgs::MarkerArray array;
  for (auto& [tool, path] : paths) {
    if (path.marker.points.empty()) continue;
    path.marker.header = header;
    path.marker.ns = kToolNames[static_cast<std::size_t>(tool.first)];
    path.marker.id = static_cast<int>(tool.second);
    path.marker.type = visualization_msgs::Marker::LINE_LIST;
    path.marker.pose.orientation.w = 1.0;
    path.marker.scale.x = kPathWidth;
    array.markers.push_back(std::move(path.marker));
  }
  return array;
}

}  // namespace

struct ReviewNode::Parts : Answers {
  Parts(const ros::NodeHandle& private_handle, const NodeSettings& settings_in, std::string log_name,
        LogReview review_in, std::unique_ptr<World> world, std::unique_ptr<Rejections> rejections_in)
      : Answers{*rejections_in},
        owned_rejections(std::move(rejections_in)),
        settings(settings_in),
        log(std::move(log_name)),
        review(std::move(review_in)),
        runner(std::move(world), {true, settings_in.max_backlog}, clock),
        no_streams(
            settings, clock, [](const std::function<void(World&)>&) {}, [](const Error&) {}),
        publishers(private_handle, settings, runner, no_streams, nullptr, rejections),
        handle(private_handle) {
    review_topic = handle.advertise<meshless_surgery::Review>("review", 5, true);
    bookmarks_topic = handle.advertise<meshless_surgery::Bookmarks>("bookmarks", 1, true);
    paths_topic = handle.advertise<visualization_msgs::MarkerArray>("hand_paths", 1, true);
  }

  ~Parts() {
    servers.clear();
    timer.stop();
    runner.stop();
    publishers.stop();
  }

  void start() {
    runner.setStep([this](World& world) { return review.step(world); });
    runner.setEventSink([this](std::vector<Event> events) { publishers.queueEvents(std::move(events)); });
    runner.start();
    publishers.start();
    sayWhole();
    timer = handle.createWallTimer(ros::WallDuration(1.0 / kReviewRate), &Parts::say, this);
    // Last, so that who finds them finds a runner that answers.
    servers = {handle.advertiseService("seek", &Parts::seek, this), handle.advertiseService("play", &Parts::play, this),
               handle.advertiseService("hash", &Parts::hash, this)};
  }

  double rate() const { return review.player().stepRate(); }
  double length() const { return static_cast<double>(review.player().end()) / rate(); }

  std_msgs::Header header() const {
    std_msgs::Header made;
    made.stamp = ros::Time::now();
    made.frame_id = settings.world_frame;
    return made;
  }

  void sayWhole() {
    meshless_surgery::Bookmarks bookmarks;
    bookmarks.header = header();
    for (const LogEvent& event : review.index().events()) {
      if (!isShown(event.event.type) || event.at > review.player().end()) continue;
      bookmarks.times.push_back(static_cast<double>(event.at) / rate());
      const bool named = event.event.body.empty() || event.event.text.find(event.event.body) != std::string::npos;
      bookmarks.texts.push_back(event.event.text + (named ? "" : ": " + event.event.body));
      bookmarks.errors.push_back(isError(event.event.type));
    }
    if (const std::string lost = review.player().report().whatIsLost(); !lost.empty()) {
      bookmarks.times.push_back(length());
      bookmarks.texts.push_back(lost);
      bookmarks.errors.push_back(true);
    }
    bookmarks_topic.publish(bookmarks);
    paths_topic.publish(toPaths(review.index(), review.player().end(), header()));
  }

  void say(const ros::WallTimerEvent&) {
    std::uint64_t at = 0;
    if (!runner.look([&](World&) { at = review.player().at(); }).ok()) return;
    const RunnerStatus status = runner.status();
    if (!status.fault.empty()) ROS_ERROR_STREAM_THROTTLE(10.0, status.fault);
    meshless_surgery::Review now;
    now.log = log;
    now.time = static_cast<double>(at) / rate();
    now.length = length();
    now.speed = status.paused ? 0.0 : speed.load();
    if (said && said->time == now.time && said->speed == now.speed) return;
    said = now;
    now.header = header();
    review_topic.publish(now);
  }

  /// Of a job on the runner's thread.
  Result<std::uint64_t> show(std::uint64_t at) {
    Result<std::uint64_t> found = std::uint64_t{0};
    const Status done = runner.change([&](World& world) {
      found = review.seek(world, at);
      (void)world.takeEvents();
    });
    if (!done.ok()) return done.error();
    return found;
  }

  bool seek(meshless_surgery::Seek::Request& request, meshless_surgery::Seek::Response& response) {
    const ros::WallTime before = ros::WallTime::now();
    // Half a step, as a length that was said is rounded.
    if (!(request.time >= 0.0 && request.time <= length() + 0.5 / rate()))
      return refuse(response, "seek", outOfRange("time", request.time, "0 to " + numberText(length()) + " s"));
    const std::uint64_t at =
        std::min(static_cast<std::uint64_t>(std::llround(request.time * rate())), review.player().end());
    const auto found = show(at);
    if (!found.ok()) return refuse(response, "seek", found.error());
    response.time = static_cast<double>(at) / rate();
    response.took = (ros::WallTime::now() - before).toSec();
    return accept(response, "shows step " + std::to_string(at) + " of " + std::to_string(review.player().end()) + "; " +
                                std::to_string(*found) + " were computed");
  }

  bool play(meshless_surgery::Play::Request& request, meshless_surgery::Play::Response& response) {
    const bool stands = request.speed == 0.0;
    if (!stands && !(request.speed >= kLeastSpeed && request.speed <= kMostSpeed))
      return refuse(response, "play", outOfRange("speed", request.speed, "0 or 0.01 to 100"));
    if (!stands) {
      std::uint64_t at = 0;
      (void)runner.look([&](World&) { at = review.player().at(); });
      if (at >= review.player().end())
        if (const auto first = show(0); !first.ok()) return refuse(response, "play", first.error());
      speed = request.speed;
      runner.setSpeed(request.speed);
    }
    const auto paused = runner.setPaused(stands);
    if (!paused.ok()) return refuse(response, "play", paused.error());
    return accept(response, stands ? "stands still" : "plays");
  }

  bool hash(meshless_surgery::Hash::Request&, meshless_surgery::Hash::Response& response) {
    return answerHash(runner, response);
  }

  std::unique_ptr<Rejections> owned_rejections;
  const NodeSettings settings;
  const std::string log;
  LogReview review;  // of the runner's thread, but for what never changes
  const Clock clock;
  WorldRunner runner;
  StreamedTools no_streams;
  Publishers publishers;
  ros::NodeHandle handle;
  ros::Publisher review_topic, bookmarks_topic, paths_topic;
  std::vector<ros::ServiceServer> servers;
  ros::WallTimer timer;
  std::atomic<double> speed{1.0};
  std::optional<meshless_surgery::Review> said;  // of the timer
};

ReviewNode::ReviewNode(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
ReviewNode::~ReviewNode() = default;

Result<std::unique_ptr<ReviewNode>> ReviewNode::start(const ros::NodeHandle& private_handle) {
  std::vector<std::string> unknown;
  auto settings = readReviewSettings(private_handle, unknown);
  if (!settings.ok()) return settings.error();
  for (const std::string& name : unknown) ROS_WARN_STREAM("parameter ~" << name << " is not known, and not used");
  const std::string file = logFile(settings->command_log, sessionFolderOf(settings->session_directory));
  auto player = openLog(file);
  if (!player.ok()) return Error{player.error().code, "parameter ~log: " + file + ": " + player.error().detail};
  settings->scene = file;
  const std::string lost = player->report().whatIsLost();
  if (!lost.empty()) ROS_WARN_STREAM(lost);

  WorldSettings world_settings;
  world_settings.threads = 2;
  auto world = std::make_unique<World>(world_settings);
  player->begin(*world);
  const std::string index_file = file + kLogIndexSuffix;
  auto index = readIndex(index_file);
  std::string unfit;
  if (!index.ok())
    unfit = index.error().detail;
  else if (index->startHash() != world->stateHash())
    unfit = "the one there is of another log";
  else if (!index->ended() && (player->report().ended || index->end() + player->stepRate() < player->end()))  // 1 s
    unfit = "the one there breaks off";
  if (!unfit.empty()) {
    ROS_WARN_STREAM("no index of the log beside it ("
                    << unfit
                    << "): one is made now, once for all; this takes about as long as the session was simulated");
    if (const Status made = makeIndex(*player, index_file); !made.ok()) return made.error();
    index = readIndex(index_file);
    if (!index.ok()) return index.error();
  }
  LogReview review(std::move(*player), std::move(*index));
  review.begin(*world);
  (void)world->takeEvents();
  ROS_INFO_STREAM("log " << file << ": " << static_cast<double>(review.player().end()) / review.player().stepRate()
                         << " s, " << review.index().events().size() << " events");
  std::unique_ptr<Parts> parts =
      std::make_unique<Parts>(private_handle, *settings, fs::path(file).filename().string(), std::move(review),
                              std::move(world), std::make_unique<Rejections>());
  parts->start();
  return std::unique_ptr<ReviewNode>(new ReviewNode(std::move(parts)));
}

}  // namespace meshless
