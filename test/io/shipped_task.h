// A task that ships, in its scene, done by a script.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/io/task.h"
#include "meshless_surgery/training/followed_places.h"
#include "support/bodies.h"

namespace meshless::test {

class ShippedTask {
 public:
  explicit ShippedTask(const std::string& name) {
    const std::string config = std::string(SOURCE_DIR) + "/config";
    FileAccess access;
    access.folders = {config};
    auto loaded = readTask(config + "/tasks/" + name + ".yaml", config + "/scenes", access);
    EXPECT_TRUE(loaded.ok()) << (loaded.ok() ? "" : loaded.error().detail);
    if (!loaded.ok()) return;
    world = std::make_unique<World>(loaded->scene.world);
    for (BodyDef& def : loaded->scene.bodies)
      EXPECT_TRUE(world->addSceneBody(std::make_shared<const PreparedBody>(prepared(def))).ok());
    for (ObstacleDef& def : loaded->scene.obstacles) EXPECT_TRUE(world->addObstacle(std::move(def)).ok());
    for (const AttachCommand& attachment : loaded->scene.attachments)
      EXPECT_TRUE(world->addSceneAttachment(attachment).ok());
    for (const InstrumentDef& def : loaded->scene.instruments) EXPECT_TRUE(world->addSceneInstrument(def).ok());
    training = std::make_unique<Training>(loaded->task);
  }
  void step() {
    if (before_step) before_step(*world);
    world->step();
    ASSERT_TRUE(training->feed(frameOf(*world, world->takeEvents(), training->wants())).ok());
  }
  /// Until it is over.
  void seconds(double time) {
    const int steps = static_cast<int>(std::lround(time * world->settings().step_rate));
    for (int k = 0; k < steps && !training->over(); ++k) step();
  }
  /// Of good play: for cheats it is of no matter.
  void expect(bool met, const std::string& what) const { EXPECT_TRUE(met || !strict) << what << ": " << told(); }
  template <class T>
  T apply(const Command& command) {
    const Result<Reply> reply = world->apply(command);
    expect(reply.ok(), reply.ok() ? "" : reply.error().detail);
    return reply.ok() && std::holds_alternative<T>(*reply) ? std::get<T>(*reply) : T();
  }
  /// Whether it was accepted or not.
  bool tries(const Command& command) { return world->apply(command).ok(); }
  /// A pick's hand goes there along a straight line, smoothly.
  void carry(const PickReply& pick, const Vec3& from, const Vec3& to, double time) {
    const int steps = static_cast<int>(std::lround(time * 120.0));
    for (int k = 1; k <= steps; ++k) {
      const double u = static_cast<double>(k) / steps, s = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
      apply<Done>(MovePickCommand{pick.pick, from + s * (to - from)});
      seconds(1.0 / 120.0);
    }
  }
  double value(const std::string& name) const {
    for (const MetricValue& metric : training->values())
      if (metric.name == name) return metric.value;
    return std::nan("");
  }
  /// Where the plan is drawn now, of those of its places that are so at rest.
  Points drawn(const std::function<bool(const Vec3& rest)>& wanted = [](const Vec3&) { return true; }) {
    const CutPlan& plan = *training->task().plan;
    SnapshotWants wants;
    wants.particles = true;
    const Points& rest = training->tissue().planOutline();
    const Points now = FollowedPlaces(plan.body, rest, plan.side()).now(world->snapshot(wants));
    Points some;
    for (std::size_t k = 0; k < rest.size(); ++k)
      if (wanted(rest[k])) some.push_back(now[k]);
    expect(some.size() > 20, "drawn");
    return some;
  }
  /// The vertex of a body's surface that is farthest in that direction now.
  Vec3 farthest(const std::string& name, const Vec3& direction) {
    SnapshotWants wants;
    wants.surfaces = true;
    std::optional<Vec3> found;
    for (const BodySnapshot& body : world->snapshot(wants).bodies)
      for (const Vec3& p : body.surface)
        if (body.name == name && (!found || p.dot(direction) > found->dot(direction))) found = p;
    expect(found.has_value(), name);
    return found.value_or(Vec3::Zero());
  }
  std::string told() const {
    std::string text = "score " + std::to_string(training->score()) + " " + training->progress().failed();
    for (const MetricValue& metric : training->values())
      if (std::isfinite(metric.value)) text += "\n  " + metric.name + " " + std::to_string(metric.value);
    return text;
  }

  std::unique_ptr<World> world;
  std::unique_ptr<Training> training;
  std::function<void(World&)> before_step;
  bool strict = true;  // good play is to succeed
};

inline void playPalpate(ShippedTask& task) {
  PushCommand push;
  push.radius = 0.010;
  push.position = Vec3(0.015, 0.010, 0.075);
  task.apply<Done>(push);
  task.seconds(0.5);
  push.position.z() = 0.065;
  push.speed = 0.02;
  task.apply<Done>(push);
  task.seconds(2.0);
  task.expect(task.training->progress().stage() == 1u, "stage 1");
  push.enable = false;
  task.apply<Done>(push);
  PickCommand pick;
  pick.point = Vec3(0.015, 0.010, 0.1);
  pick.direction = -Vec3::UnitZ();
  task.apply<PickReply>(pick);
  task.seconds(1.0);
  task.expect(task.training->passed(), "passed");
}

inline void playRetract(ShippedTask& task) {
  task.seconds(1.0);
  PickCommand pick;
  pick.point = Vec3(-0.05, -0.06, 0.2);
  pick.direction = -Vec3::UnitZ();
  const auto picked = task.apply<PickReply>(pick);
  task.carry(picked, picked.position, picked.position + Vec3(0, 0.01, 0.035), 2.0);
  task.seconds(11.0);
  task.expect(task.training->progress().stage() == 1u, "stage 1");
  task.apply<Done>(ReleaseCommand{picked.pick});
  task.seconds(0.1);
  task.expect(task.training->passed(), "passed");
}

inline void playIncise(ShippedTask& task) {
  // Along the line that is drawn on the skin, which sags.
  task.seconds(1.0);
  const Points line = task.drawn([](const Vec3& rest) { return rest.z() > 0.0599; });
  if (line.empty()) return;
  Vec3 left = line[0], right = line[0], lowest = line[0];
  for (const Vec3& p : line) {
    if (p.x() < left.x()) left = p;
    if (p.x() > right.x()) right = p;
    if (p.z() < lowest.z()) lowest = p;
    const auto top = task.world->probe(p + 0.1 * Vec3::UnitZ(), -Vec3::UnitZ());
    task.expect(top.ok() && (top->position - p).norm() < 0.0005, "the line is on the skin");
  }
  task.expect(lowest.z() < 0.055, "the skin sags");
  task.expect(task.value("plan_done") == 0.0, "nothing done yet");
  InciseCommand incise;
  incise.blade = {left + 0.001 * Vec3::UnitZ(), (right - left).normalized(), Vec3::UnitZ(), (right - left).norm(),
                  left.z() - lowest.z() + 0.001 + 0.013};
  task.apply<InciseReply>(incise);
  task.seconds(0.5);
  task.expect(task.training->passed(), "passed");
  task.expect(task.value("plan_done") > 0.9, "plan done");
}

inline void playResect(ShippedTask& task) {
  // Along what is drawn on the organ, which hangs.
  task.seconds(1.0);
  const Points line = task.drawn();
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : line) mean += p / static_cast<double>(line.size());
  Mat3 spread = Mat3::Zero();
  for (const Vec3& p : line) spread += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(spread);
  CutCommand cut;
  cut.blades.x_axis = axes.eigenvectors().col(2);
  cut.blades.y_axis = axes.eigenvectors().col(1);
  cut.blades.origin = mean - cut.blades.x_axis;
  const auto reply = task.apply<CutReply>(cut);
  task.expect(reply.new_bodies.size() == 2, "two pieces");
  if (reply.new_bodies.size() != 2) return;
  task.seconds(0.5);
  task.expect(task.training->progress().stage() == 1u, "stage 1");
  PickCommand pick;
  pick.point = Vec3(-0.075, -0.005, 0.06);
  pick.max_distance = 0.05;
  pick.body = reply.new_bodies[1];
  const auto picked = task.apply<PickReply>(pick);
  task.carry(picked, picked.position, picked.position + Vec3(-0.05, 0, 0.05), 1.0);
  task.carry(picked, picked.position + Vec3(-0.05, 0, 0.05), picked.position + Vec3(-0.2, 0, 0.05), 2.0);
  task.seconds(1.0);
  task.expect(task.training->progress().stage() == 2u, "stage 2");
  task.apply<Done>(ReleaseCommand{picked.pick});
  task.seconds(0.2);
  task.expect(task.training->passed(), "passed");
}

/// Clips first; or a cut at once, which bleeds until they are on.
inline void playTransect(ShippedTask& task, bool clips_first = true) {
  task.seconds(0.5);
  const auto clip = [&](double x) {
    ClipCommand command;
    command.point = Vec3(x, 0, 0.05);
    command.width = 0.004;
    task.apply<ClipReply>(command);
    task.seconds(0.4);
  };
  const auto cut = [&] {
    Vec3 middle = Vec3::Zero();
    const Points line = task.drawn();
    for (const Vec3& p : line) middle += p / static_cast<double>(line.size());
    CutCommand command;
    command.blades = {middle - 0.02 * Vec3::UnitY(), Vec3::UnitY(), Vec3::UnitZ(), 0.04, 0.02};
    task.expect(task.apply<CutReply>(command).new_bodies.size() == 2, "two pieces");
    task.seconds(0.1);
  };
  if (!clips_first) cut();
  clip(-0.008);
  task.expect(task.training->progress().stage() == 1u, "stage 1");
  clip(0.008);
  if (clips_first) cut();
  task.seconds(2.0);
  task.expect(task.training->progress().done(), "done");
}

inline void playHandOver(ShippedTask& task) {
  task.seconds(0.5);
  PickCommand pick;
  pick.body = "block";
  pick.point = task.farthest("block", Vec3(-1, 0, 0.5));
  const auto first = task.apply<PickReply>(pick);
  task.carry(first, first.position, first.position + Vec3(0.05, 0, 0.08), 1.5);
  task.seconds(0.5);
  task.expect(task.training->progress().stage() == 2u, "stage 2");
  pick.point = task.farthest("block", Vec3(0, 0, -1));  // it hangs
  const auto second = task.apply<PickReply>(pick);
  task.seconds(0.3);
  task.apply<Done>(ReleaseCommand{first.pick});
  task.seconds(0.3);
  task.expect(task.training->progress().stage() == 4u, "stage 4");
  task.carry(second, second.position, Vec3(0.09, 0, 0.06), 2.0);
  task.carry(second, Vec3(0.09, 0, 0.06), Vec3(0.09, 0, 0.045), 0.5);
  task.seconds(0.5);
  task.expect(task.training->progress().stage() == 5u, "stage 5");
  task.apply<Done>(ReleaseCommand{second.pick});
  task.seconds(1.5);
  task.expect(task.training->passed(), "passed");
  task.expect(task.value("instrument_crossings") == 0.0, "no crossings");
}

inline void playDissect(ShippedTask& task) {
  task.seconds(0.5);
  const auto fibres = [&] {
    for (const AttachmentSnapshot& joint : task.world->snapshot({}).attachments)
      if (joint.name == "bed") return joint.fibres;
    return std::size_t{0};
  };
  // The fundus is drawn down, off the bed.
  PickCommand pick;
  pick.body = "gallbladder";
  pick.point = task.farthest("gallbladder", Vec3(-1, 0, -0.3));
  const auto picked = task.apply<PickReply>(pick);
  Vec3 at = picked.position;
  task.expect(fibres() > 20, "fibres");
  for (int k = 0; k < 30 && fibres() > 0; ++k) {
    task.carry(picked, at, at + Vec3(0.0005, 0, -0.0025), 0.1);
    at += Vec3(0.0005, 0, -0.0025);
  }
  task.expect(task.training->progress().stage() == 1u, "stage 1");
  task.apply<Done>(ClearPicksCommand{});
  task.seconds(0.2);
  task.expect(task.training->passed(), "passed");
}

/// By short strokes from place to place of the drawn circle, each a little too long.
inline void playPatternCut(ShippedTask& task) {
  task.seconds(1.0);
  Points circle = task.drawn([](const Vec3& rest) { return rest.z() > 0.0574; });
  std::sort(circle.begin(), circle.end(),
            [](const Vec3& a, const Vec3& b) { return std::atan2(a.y(), a.x()) < std::atan2(b.y(), b.x()); });
  constexpr std::size_t kStrokes = 30;
  for (std::size_t k = 0; k < kStrokes && !circle.empty(); ++k) {
    const Vec3 &a = circle[k * circle.size() / kStrokes], &b = circle[(k + 1) % kStrokes * circle.size() / kStrokes];
    const Vec3 way = (b - a).normalized();
    const Vec3 up = (Vec3::UnitZ() - way.z() * way).normalized();
    InciseCommand incise;
    incise.blade = {a - 0.0004 * way + 0.001 * up, way, up, (b - a).norm() + 0.0008, 0.0048};
    task.apply<InciseReply>(incise);
    task.seconds(0.2);
  }
  task.seconds(0.5);
  task.expect(task.training->passed(), "passed");
}

inline void playLigate(ShippedTask& task) {
  task.seconds(0.5);
  ClipCommand clip;
  clip.point = Vec3(0.006, 0, 0.05);
  clip.width = 0.004;
  task.apply<ClipReply>(clip);
  task.seconds(1.5);
  task.expect(task.training->passed(), "passed");
}

inline void playCholecystectomy(ShippedTask& task) {
  task.seconds(0.3);
  const Vec3 duct(0.0, -0.022, 0.1155), artery(0.0, -0.0085, 0.1125);
  const auto clip = [&](const char* body, const Vec3& at) {
    ClipCommand command;
    command.body = body;
    command.point = at;
    command.width = 0.004;
    task.apply<ClipReply>(command);
    task.seconds(0.4);
  };
  clip("duct", duct + 0.043 * Vec3::UnitX());
  clip("duct", duct + 0.026 * Vec3::UnitX());
  clip("artery", artery + 0.030 * Vec3::UnitX());
  clip("artery", artery + 0.016 * Vec3::UnitX());
  task.expect(task.training->progress().stage() == 4u, "clipped");
  for (const auto& [body, at] : {std::make_pair("duct", Vec3(duct + 0.035 * Vec3::UnitX())),
                                 std::make_pair("artery", Vec3(artery + 0.023 * Vec3::UnitX()))}) {
    CutCommand cut;
    cut.blades = {at - 0.006 * Vec3::UnitY(), Vec3::UnitY(), Vec3::UnitZ(), 0.012, 0.014};
    cut.bodies = {body};
    task.apply<CutReply>(cut);
    task.seconds(0.2);
  }
  const auto fibres = [&] {
    for (const AttachmentSnapshot& joint : task.world->snapshot({}).attachments)
      if (joint.name == "bed") return joint.fibres;
    return std::size_t{0};
  };
  PickCommand pick;
  pick.body = "gallbladder";
  pick.point = task.farthest("gallbladder", Vec3(-1, 0, -0.3));
  const auto picked = task.apply<PickReply>(pick);
  Vec3 at = picked.position;
  for (int k = 0; k < 40 && fibres() > 0; ++k) {
    task.carry(picked, at, at + Vec3(0.0005, 0, -0.0025), 0.1);
    at += Vec3(0.0005, 0, -0.0025);
  }
  task.expect(task.training->progress().stage() == 5u, "free");
  task.carry(picked, at, Vec3(-0.10, -0.08, 0.09), 1.5);
  task.carry(picked, Vec3(-0.10, -0.08, 0.09), Vec3(-0.15, -0.11, 0.08), 1.0);
  task.seconds(0.5);
  task.expect(task.training->progress().stage() == 6u, "bagged");
  task.apply<Done>(ClearPicksCommand{});
  task.seconds(0.2);
  task.expect(task.training->passed(), "passed");
}

/// The two graspers of peg_transfer, each led from a side at 60 degrees to the board. They grasp triangles by the wall
/// that faces them most, side by side.
class PegHands {
 public:
  explicit PegHands(ShippedTask& task) : task_(task) {
    for (const auto& obstacle : task_.world->snapshot({}).obstacles) {
      const Box box = boundsOf(obstacle->mesh.vertices);
      pegs_[obstacle->name] = 0.5 * (box.min + box.max);
      pegs_[obstacle->name].z() = 0.0;
    }
  }
  struct Lies {
    Vec3 middle = Vec3::Zero();  // [m]
    double yaw = 0.0;            // [rad]
  };
  struct Way {
    std::string hand;
    Vec3 to;
    double yaw, jaw;
  };

  Lies whereIs(const std::string& name) {
    SnapshotWants wants;
    wants.surfaces = true;
    Lies lies;
    for (const BodySnapshot& body : task_.world->snapshot(wants).bodies) {
      if (body.name != name) continue;
      const Points &now = body.surface, &rest = body.model->surface.vertices;
      for (const Vec3& p : now) lies.middle += p / static_cast<double>(now.size());
      double sine = 0.0, cosine = 0.0;
      for (std::size_t k = 0; k < now.size(); ++k) {
        const Vec3 arm = now[k] - lies.middle;
        cosine += rest[k].x() * arm.x() + rest[k].y() * arm.y();
        sine += rest[k].x() * arm.y() - rest[k].y() * arm.x();
      }
      lies.yaw = std::atan2(sine, cosine);
    }
    return lies;
  }
  /// Hands go there together, smoothly.
  void go(double time, const std::vector<Way>& ways) {
    const int steps = std::max(1, static_cast<int>(std::lround(kHaste * time * task_.world->settings().step_rate)));
    std::vector<Instrument> from;
    for (const Way& way : ways)
      for (const Instrument& one : task_.world->snapshot({}).instruments)
        if (one.def.name == way.hand) from.push_back(one);
    for (int k = 1; k <= steps && from.size() == ways.size(); ++k) {
      const double u = static_cast<double>(k) / steps, s = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
      for (std::size_t n = 0; n < ways.size(); ++n) {
        const Pose& begin = from[n].target;
        LeadInstrumentCommand lead;
        lead.name = ways[n].hand;
        lead.pose = Pose{begin.rotation.slerp(s, turnOf(ways[n].hand, ways[n].yaw)),
                         begin.translation + s * (ways[n].to - begin.translation)};
        lead.jaw = from[n].jaw_target + s * (ways[n].jaw - from[n].jaw_target);
        task_.apply<Done>(lead);
      }
      task_.seconds(1.0 / task_.world->settings().step_rate);
    }
  }
  /// Grasps it where it lies, and lifts it by so much. Where the tip was then.
  Vec3 take(const std::string& hand, const std::string& body, double lift) {
    const Lies lies = whereIs(body);
    const double yaw = yawOf(lies);
    const Vec3 at = wallOf(lies, sideOf(hand) * kBeside);
    go(0.5, {{hand, at - kAway * along(hand, yaw), yaw, kOpen}});
    go(0.35, {{hand, at, yaw, kOpen}});
    go(0.2, {{hand, at, yaw, 0.0}});
    if (lift > 0.0) go(0.45, {{hand, at + lift * Vec3::UnitZ(), yaw, 0.0}});
    return at + lift * Vec3::UnitZ();
  }
  /// To the other hand, in the middle between both sides, or where it is.
  void handOver(const std::string& giver, const std::string& taker, const std::string& body, const Vec3& at,
                bool in_the_middle) {
    const double side = sideOf(giver), yaw = in_the_middle ? 0.0 : yawOf(whereIs(body));
    const Vec3 middle = in_the_middle ? Vec3(side * 0.004, -0.006, at.z()) : at;
    go(0.5,
       {{giver, middle, yaw, 0.0}, {taker, middle - Vec3(side * 0.006, 0, 0) - kAway * along(taker, yaw), yaw, kOpen}});
    const Lies lies = whereIs(body);
    const double turned = yawOf(lies);
    const Vec3 to = wallOf(lies, sideOf(taker) * kBeside);
    go(0.35, {{taker, to, turned, kOpen}});
    go(0.2, {{taker, to, turned, 0.0}});
    go(0.15, {{giver, middle, yaw, kOpen}});
    go(0.2, {{giver, middle - kAway * along(giver, yaw), yaw, kOpen}});
  }
  /// What the hand holds: to above a place of the board, down as far as it goes, and let go of.
  void putOn(const std::string& hand, const std::string& body, const Vec3& place, double above = 0.009) {
    const auto held = [&] {
      for (const Instrument& one : task_.world->snapshot({}).instruments)
        if (one.def.name == hand) return one.target;
      return Pose();
    };
    const double yaw = yawOf(whereIs(body));
    for (int turn = 0; turn < 2; ++turn) {  // it turns a little on the way
      const Vec3 to = held().translation + place - whereIs(body).middle;
      go(turn ? 0.1 : 0.5, {{hand, Vec3(to.x(), to.y(), held().translation.z()), yaw, 0.0}});
    }
    Vec3 to = held().translation;
    to.z() -= std::max(0.0, whereIs(body).middle.z() - above);
    go(0.4, {{hand, to, yaw, 0.0}});
    go(0.15, {{hand, to, yaw, kOpen}});
    go(0.25, {{hand, to - kAway * along(hand, yaw), yaw, kOpen}});
  }
  void transfer(const std::string& body, const std::string& giver, const std::string& peg) {
    const std::string taker = giver == "left" ? "right" : "left";
    const Vec3 at = take(giver, body, 0.03);
    handOver(giver, taker, body, at, true);
    putOn(taker, body, pegs_.at(peg));
  }
  const Vec3& peg(const std::string& name) const { return pegs_.at(name); }

 private:
  static constexpr double kHaste = 0.85, kOpen = 0.3, kWall = 0.006, kTop = 0.0045, kDepth = 0.0045, kBeside = 0.003,
                          kAway = 0.025;
  static double sideOf(const std::string& hand) { return hand == "left" ? -1.0 : 1.0; }
  static Quat turnOf(const std::string& hand, double yaw) {
    const double down = hand == "left" ? M_PI / 3.0 : 2.0 * M_PI / 3.0;
    return Quat(Eigen::AngleAxisd(yaw, Vec3::UnitZ())) * Quat(Eigen::AngleAxisd(down, Vec3::UnitY()));
  }
  static Vec3 along(const std::string& hand, double yaw) { return turnOf(hand, yaw) * Vec3::UnitX(); }
  static double yawOf(const Lies& lies) { return std::remainder(lies.yaw, 2.0 * M_PI / 3.0); }
  static Vec3 wallOf(const Lies& lies, double beside) {
    const double yaw = yawOf(lies);
    return lies.middle + kWall * Vec3(std::sin(yaw), -std::cos(yaw), 0.0) +
           beside * Vec3(std::cos(yaw), std::sin(yaw), 0.0) + (kTop - kDepth) * Vec3::UnitZ();
  }

  ShippedTask& task_;
  std::map<std::string, Vec3> pegs_;  // [m] their feet
};

/// The triangles in the order of the script: those in the middle first.
inline const std::array<int, 6> kPegOrder{4, 5, 6, 1, 2, 3};

inline void playPegTransfer(ShippedTask& task) {
  PegHands hands(task);
  task.seconds(0.5);
  for (const bool back : {false, true}) {
    for (std::size_t k = 0; k < 6; ++k) {
      // Over there those that are far away from the middle come first.
      const int number = back ? kPegOrder[k] : kPegOrder[(k + 3) % 6];
      hands.transfer("triangle_" + std::to_string(kPegOrder[k]), back ? "right" : "left",
                     (back ? "left_" : "right_") + std::to_string(number));
    }
    task.seconds(0.3);
    task.expect(task.training->progress().stage() == (back ? 2u : 1u), "all six");
  }
  task.seconds(1.0);
  task.expect(task.training->passed(), "passed");
}

/// The endoscope of the task camera: goes from view to view, drawn back in between.
class ScopeHand {
 public:
  explicit ScopeHand(ShippedTask& task) : task_(task) {
    const Instrument scope = task.world->snapshot({}).instruments.at(0);
    now_ = scope.pose;
    trocar_ = *scope.def.remote_centre;
    lean_ = scope.def.view_angle;
  }
  /// From where the line of sight is along the axis of the ball's cup.
  Pose viewOf(const std::string& ball) const {
    for (const auto& obstacle : task_.world->snapshot({}).obstacles) {
      if (obstacle->name != "cup_" + ball) continue;
      const Vec3 foot = obstacle->mesh.vertices[0], axis = (obstacle->mesh.vertices[1] - foot).normalized();
      double near = 0.03, far = 0.12;
      for (int k = 0; k < 50; ++k) {
        const double middle = 0.5 * (near + far);
        const Vec3 shaft = (foot + middle * axis - trocar_).normalized();
        (std::acos(-shaft.dot(axis)) < lean_ ? near : far) = middle;
      }
      const Vec3 eye = foot + near * axis;
      return towards(eye, -(-axis - std::cos(lean_) * (eye - trocar_).normalized()));
    }
    ADD_FAILURE() << "no cup of " << ball;
    return now_;
  }
  /// The tip there, its shaft through the trocar, z as near to `up` as it can be.
  Pose towards(const Vec3& tip, const Vec3& up) const {
    Mat3 axes;
    axes.col(0) = (tip - trocar_).normalized();
    axes.col(1) = up.cross(axes.col(0)).normalized();
    axes.col(2) = axes.col(0).cross(axes.col(1));
    return {Quat(axes), tip};
  }
  Vec3 trocar() const { return trocar_; }
  void go(const Pose& to, double time) {
    const Pose from = now_;
    const int steps = static_cast<int>(std::lround(time * 120.0));
    for (int k = 1; k <= steps; ++k) {
      const double u = static_cast<double>(k) / steps, s = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
      now_ = {from.rotation.slerp(s, to.rotation), from.translation + s * (to.translation - from.translation)};
      LeadInstrumentCommand lead;
      lead.name = "scope";
      lead.pose = now_;
      task_.apply<Done>(lead);
      task_.seconds(1.0 / 120.0);
    }
  }
  /// Drawn back, above the cups, and in again.
  void visit(const Pose& view, double haste = 1.0) {
    const auto back = [&](const Pose& pose) {
      return Pose{pose.rotation, trocar_ + 0.09 * (pose.translation - trocar_).normalized()};
    };
    go(back(now_), 0.5 / haste);
    go(back(view), 1.5 / haste);
    go(view, 1.0 / haste);
  }

 private:
  ShippedTask& task_;
  Pose now_;
  Vec3 trocar_;
  double lean_ = 0.0;  // [rad]
};

inline void playCamera(ShippedTask& task) {
  ScopeHand hand(task);
  task.seconds(0.2);
  for (const Stage& stage : task.training->task().stages) {
    hand.visit(hand.viewOf(stage.name));
    task.seconds(1.3);
    task.expect(task.training->progress().times().size() > 0 &&
                    task.training->task().stages[task.training->progress().stage() - 1].name == stage.name,
                "sees " + stage.name);
  }
  task.expect(task.training->passed(), "passed");
}

inline const std::vector<std::pair<std::string, std::function<void(ShippedTask&)>>>& goodPlays() {
  static const std::vector<std::pair<std::string, std::function<void(ShippedTask&)>>> plays{
      {"palpate", playPalpate},
      {"retract", playRetract},
      {"incise", playIncise},
      {"resect", playResect},
      {"hand_over", playHandOver},
      {"dissect", playDissect},
      {"pattern_cut", playPatternCut},
      {"ligate", playLigate},
      {"cholecystectomy", playCholecystectomy},
      {"peg_transfer", playPegTransfer},
      {"transect", [](ShippedTask& task) { playTransect(task); }},
      {"camera", playCamera}};
  return plays;
}

}  // namespace meshless::test
