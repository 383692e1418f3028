#include "streamed_tools.h"

#include <algorithm>

#include <Eigen/Eigenvalues>

#include "border_check.h"
#include "convert.h"

namespace meshless {
namespace {

constexpr double kTurnSpeed = 50.0;  // [rad/s]
constexpr double kUnbounded = 1e12;
constexpr double kHandSpeed = 5.0;  // [m/s] no hand is faster ...
constexpr double kJitter = 0.005;   // [s] ... but stamps are coarse, and messages come in bursts

const char* wayBack(Operating state) { return state == Operating::kPaused ? "resume" : "enable"; }
constexpr double kBladesPerWidth = 3.0;

}  // namespace

double bladesFor(const Points& surface) {
  Eigen::Matrix3Xd points(3, surface.size());
  for (std::size_t i = 0; i < surface.size(); ++i) points.col(static_cast<Eigen::Index>(i)) = surface[i];
  points.colwise() -= points.rowwise().mean().eval();
  const Mat3 moment = points * points.transpose();
  points = Eigen::SelfAdjointEigenSolver<Mat3>(moment).eigenvectors().transpose() * points;
  Vec3 extents = points.rowwise().maxCoeff() - points.rowwise().minCoeff();
  std::sort(extents.data(), extents.data() + 3);
  return std::min(kBladesPerWidth * extents[1], kBlades);
}

const char* toString(Operating state) {
  switch (state) {
    case Operating::kDisabled:
      return "DISABLED";
    case Operating::kEnabled:
      return "ENABLED";
    case Operating::kPaused:
      break;
  }
  return "PAUSED";
}

StreamedTools::StreamedTools(const NodeSettings& settings, const Clock& clock, Post post, Refused refused)
    : settings_(settings),
      clock_(clock),
      post_(std::move(post)),
      refused_(std::move(refused)),
      tools_{Tool{"pick", ToolKind::kPick, settings.pick_max_speed,
                  ToolMotion({settings.pick_max_speed, kTurnSpeed, settings.tools_silence})},
             // The world itself holds the sphere to its speed, in simulated time.
             Tool{"push", ToolKind::kPush, settings.push_max_speed,
                  ToolMotion({kUnbounded, kUnbounded, settings.tools_silence})},
             Tool{"scissors", ToolKind::kScissors, settings.scissors_max_speed,
                  ToolMotion({settings.scissors_max_speed, kTurnSpeed, settings.tools_silence})}} {}

std::optional<Pose> StreamedTools::hand(ToolKind tool) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ToolMotion& motion = tools_[static_cast<std::size_t>(tool)].motion;
  return motion.alive() ? std::optional<Pose>(motion.wanted()) : std::nullopt;
}

Error StreamedTools::deaf(const Tool& tool) {
  return {ErrorCode::kInvalidArgument, "the " + tool.name + " is " + toString(tool.state) +
                                           "; accepted once its state_command was " + wayBack(tool.state)};
}

void StreamedTools::noteInstrument(const std::string& name, std::optional<Operating> state) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!state || *state == Operating::kEnabled)
    deaf_instruments_.erase(name);
  else
    deaf_instruments_[name] = *state;
}

std::string StreamedTools::notEnabled() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::string text;
  const auto tell = [&text](const std::string& who, Operating state) {
    text += "; the " + who + " stays " + toString(state) + " until its state_command is " + wayBack(state);
  };
  for (const Tool& tool : tools_)
    if (tool.state != Operating::kEnabled) tell(tool.name, tool.state);
  for (const auto& [name, state] : deaf_instruments_) tell("instrument " + name, state);
  return text;
}

Result<std::string> StreamedTools::hear(ToolKind kind, const Pose& pose, double stamp) {
  Tool& tool = tools_[static_cast<std::size_t>(kind)];
  std::string warning;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (tool.state != Operating::kEnabled) return deaf(tool);
    if (const Status heard = tool.motion.hear(pose, stamp, clock_.now()); !heard.ok()) return heard.error();
    const ToolMotion::Way& way = tool.motion.way();
    if (way.length > std::max(kHandSpeed, tool.max_speed) * (way.time + kJitter)) {
      warning = "the pose jumps by " + numberText(way.length) + " m in " + numberText(way.time) + " s, and the " +
                tool.name + " goes after it at up to " + numberText(tool.max_speed) + " m/s (tools/" + tool.name +
                "/max_speed): does more than one node say where it is?";
    }
  }
  postMove(tool);
  return warning;
}

Status StreamedTools::command(ToolKind kind, const std::string& word) {
  Tool& tool = tools_[static_cast<std::size_t>(kind)];
  bool lifted = false;
  bool halted = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const bool enabled = tool.state == Operating::kEnabled, paused = tool.state == Operating::kPaused;
    if (word == "enable" && !paused) {
      tool.state = Operating::kEnabled;
    } else if (word == "disable") {
      lifted = tool.motion.alive();
      tool.motion.end();
      if (kind == ToolKind::kScissors) jaw_armed_ = false;
      tool.state = Operating::kDisabled;
    } else if (word == "pause" && enabled) {
      halted = tool.motion.alive();
      tool.state = Operating::kPaused;
    } else if (word == "resume" && paused) {
      tool.motion.keepAlive(clock_.now());
      tool.state = Operating::kEnabled;
    } else if (word != "home") {  // there is nothing to home
      const char* fits = enabled ? "disable, pause, home" : paused ? "disable, resume, home" : "enable, home";
      return Error{ErrorCode::kInvalidArgument, "the " + tool.name + " is " + toString(tool.state) +
                                                    " and the command is '" + printable(word) + "'; accepted: " + fits};
    }
  }
  if (halted) halt(tool);
  if (lifted) lift(tool, "it was disabled");
  return Done{};
}

StreamedTools::Condition StreamedTools::condition(ToolKind kind) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const Tool& tool = tools_[static_cast<std::size_t>(kind)];
  return {tool.state, tool.motion.alive() && !tool.motion.arrived()};
}

void StreamedTools::halt(Tool& tool) {
  post_([this, &tool](World& world) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!tool.motion.alive()) return;
    if (tool.kind != ToolKind::kPush) return tool.motion.halt(tool.motion.pose().translation);
    // The world moves the sphere to where its stream was, unless a service has moved it since.
    if (!world.push().enabled || !world.push().streamed) return;
    PushCommand command;
    command.position = world.push().position;
    command.radius = world.push().radius;
    command.streamed = true;
    (void)world.apply(command);
    tool.motion.halt(command.position);
  });
}

void StreamedTools::look() {
  for (Tool& tool : tools_) {
    bool silent = false;
    bool under_way = false;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (tool.state == Operating::kPaused) tool.motion.keepAlive(clock_.now());
      silent = tool.motion.fellSilent(clock_.now());
      under_way = tool.motion.alive() && !tool.motion.arrived();
      if (silent && tool.kind == ToolKind::kScissors) jaw_armed_ = false;
    }
    if (silent) lift(tool, "its stream was silent for " + numberText(settings_.tools_silence) + " s");
    if (under_way) postMove(tool);
  }
}

void StreamedTools::postMove(Tool& tool) {
  {
    // A world that is late must not gather them.
    const std::lock_guard<std::mutex> lock(mutex_);
    if (tool.posted) return;
    tool.posted = true;
  }
  post_([this, &tool](World& world) { move(tool, world); });
}

void StreamedTools::move(Tool& tool, World& world) {
  const std::lock_guard<std::mutex> lock(mutex_);
  tool.posted = false;
  if (!tool.motion.alive()) return;  // silent since
  if (tool.kind == ToolKind::kPick) movePick(tool, world);
  if (tool.kind == ToolKind::kPush) movePush(tool, world);
  if (tool.kind == ToolKind::kScissors) moveScissors(tool, world);
}

void StreamedTools::movePick(Tool& tool, World& world) {
  const auto held = world.heldPick();
  // From where the spring's end is: it may have been taken into the hand just now.
  if (held) tool.motion.putAt(held->target);
  tool.motion.advance(clock_.now());
  if (!held) return;
  MovePickCommand command;
  command.pick = held->id;
  command.target = tool.motion.pose().translation;
  (void)world.apply(command);
}

void StreamedTools::movePush(Tool& tool, World& world) {
  tool.motion.advance(clock_.now());
  PushCommand command;
  command.position = tool.motion.pose().translation;
  command.streamed = true;
  // It appears where the stream is, and from then on travels, in the size that it has.
  if (world.push().enabled) {
    command.radius = world.push().radius;
    command.speed = settings_.push_max_speed;
  }
  (void)world.apply(command);
}

void StreamedTools::moveScissors(Tool& tool, World& world) {
  tool.motion.advance(clock_.now());
  world.setScissors(blades(tool.motion.pose()), jaw_angle_);
}

ScissorBlades StreamedTools::blades(const Pose& pose) const {
  return bladesAt(pose, settings_.scissors_length.value_or(kBlades), settings_.scissors_width.value_or(kBlades));
}

void StreamedTools::lift(Tool& tool, const std::string& why) {
  post_([this, &tool, why](World& world) {
    LiftCommand command;
    command.tool = tool.kind;
    command.streamed_only = true;
    command.why = "the " + tool.name + " was lifted off: " + why;
    if (tool.kind == ToolKind::kPick) {
      const auto held = world.heldPick();
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!held || held->target != tool.motion.pose().translation) return;  // somebody else has moved it
    }
    (void)world.apply(command);
  });
}

Status StreamedTools::hearJaw(double angle) {
  bool closes = false;
  Pose pose;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    Tool& scissors = tools_[static_cast<std::size_t>(ToolKind::kScissors)];
    if (scissors.state != Operating::kEnabled) return deaf(scissors);
    jaw_angle_ = angle;
    if (angle > kJawOpen) jaw_armed_ = true;
    if (angle < kJawClosed && jaw_armed_) {
      jaw_armed_ = false;
      closes = true;
    }
    if (!scissors.motion.alive()) return Done{};  // nobody said (yet, or any more) where the scissors are
    scissors.motion.keepAlive(clock_.now());
    pose = scissors.motion.pose();
  }
  post_([this, pose, angle, closes](World& world) {
    CutCommand command;
    command.blades = blades(pose);
    world.setScissors(command.blades, angle);
    if (!closes) return;
    const auto reply = world.apply(command);
    // Cutting the air is no fault of the input.
    if (!reply.ok() && reply.error().code != ErrorCode::kMissed) refused_(reply.error());
  });
  return Done{};
}

}  // namespace meshless
