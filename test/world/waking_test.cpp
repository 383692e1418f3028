// Who wakes when something changes, and who does not: for each command and for what else can change a world.
#include <functional>
#include <set>

#include "meshless_surgery/world/saved_world.h"
#include "support/bodies.h"

namespace meshless {
namespace waking_test {

using Names = std::set<std::string>;
using Act = std::function<void(World&)>;

constexpr double kEdge = 0.1;     // [m]
constexpr double kApart = 0.4;    // [m]
constexpr double kRadius = 0.03;  // [m] of the sphere
constexpr PickId kPick = 1;

struct Kind {
  const char* name;
  double youngs_modulus;  // [Pa] 0: an appearance material
  ClusterOptions::Kind clusters;
};
const Kind kKinds[] = {{"elastic", 5e4, ClusterOptions::Kind::kAuto},
                       {"clusters", 0.0, ClusterOptions::Kind::kGrid},
                       {"one cluster", 0.0, ClusterOptions::Kind::kOne}};

BodyDef cube(const Kind& kind, const std::string& name, const Vec3& at) {
  BodyDef def = test::defOf(boxMesh(Vec3::Constant(kEdge), 2, 2, 2), name);
  def.pose.translation = at;
  def.spacing = 0.5 * kEdge;
  def.clusters.kind = kind.clusters;
  def.clusters.grid = {{2, 2, 2}};
  def.material.alpha = 0.99;
  def.material.damping = 20.0;
  if (kind.youngs_modulus > 0.0) {
    def.material.youngs_modulus = kind.youngs_modulus;
    def.material.poissons_ratio = 0.3;
  }
  return def;
}

Names asleep(World& world, bool wanted = true) {
  Names names;
  for (const BodySnapshot& body : world.snapshot({}).bodies)
    if (body.asleep == wanted) names.insert(body.name);
  return names;
}

PushCommand sphereAt(const Vec3& place, bool streamed = true) {
  PushCommand push;
  push.radius = kRadius;
  push.position = place;
  push.streamed = streamed;
  return push;
}

void settle(World& world, const Kind& kind) {
  for (int n = 0; n < 1200 && !asleep(world, false).empty(); ++n) world.step();
  EXPECT_EQ(asleep(world, false), Names()) << kind.name;
}

const Vec3 kPicked(kApart, 0.0, 2.0 * kEdge);
const Vec3 kPulled = kPicked + Vec3(0.0, 0.0, 0.001);

// Two cubes on each other at each of three places, and one by itself. A pick pulls at the second tower, the sphere
// presses on the third.
World sleepers(const Kind& kind) {
  World world{WorldSettings()};
  const auto add = [&](const std::string& name, double x, double z) {
    EXPECT_TRUE(world.addSceneBody(test::shared(cube(kind, name, Vec3(x, 0, z)))).ok());
  };
  const char* names[][2] = {{"low", "high"}, {"under", "held"}, {"base", "pressed"}};
  for (int k = 0; k < 3; ++k) {
    add(names[k][0], k * kApart, 0.501 * kEdge);
    add(names[k][1], k * kApart, 1.502 * kEdge);
  }
  add("alone", -kApart, 0.501 * kEdge);
  settle(world, kind);
  PickCommand pick;
  pick.point = kPicked;
  pick.body = "held";
  pick.stiffness = 50.0;
  EXPECT_EQ(test::replyOf<PickReply>(world.apply(pick)).pick, kPick);
  EXPECT_TRUE(world.apply(MovePickCommand{kPick, kPulled}).ok());
  Vec3 place(2.0 * kApart, 0.0, 2.0 * kEdge + kRadius + 0.005);
  for (; place.z() > 1.8 * kEdge + kRadius && !world.push().touching; place.z() -= 2e-4) {
    EXPECT_TRUE(world.apply(sphereAt(place)).ok());
    world.step();
  }
  settle(world, kind);
  EXPECT_TRUE(world.push().touching) << kind.name;
  return world;
}

struct Row {
  std::string what;
  Command command;
  Names wake;
  std::vector<Command> before = {};
  int steps = 1;  // until it is looked at
  bool refused = false;
  bool rested = false;  // all sleep again after what was before
};

CutCommand cutAcross(const std::string& body, double close_time = 0.0) {
  CutCommand cut;
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  cut.blades.origin = Vec3(0.01, -1.0, 0.0);
  cut.bodies = {body};
  cut.close_time = close_time;
  return cut;
}

LiftCommand lift(ToolKind tool, bool streamed_only = false) {
  LiftCommand command;
  command.tool = tool;
  command.streamed_only = streamed_only;
  return command;
}

SetMaterialCommand material(const std::string& body, double density) {
  SetMaterialCommand set;
  set.body = body;
  set.change = [density](const Material& before) {
    Material after = before;
    after.density = density;
    return Result<Material>(after);
  };
  return set;
}

Pose at(const Vec3& place) { return {Quat::Identity(), place}; }

ApplyForceCommand force(const std::string& body, const Vec3& of) { return {body, {}, of, 1.0}; }

InstrumentDef probeAt(const Vec3& place) {
  InstrumentDef def;
  def.name = "probe";
  def.pose = {Quat(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitY())), place};
  return def;
}

const Names kTower{"low", "high"}, kHeld{"under", "held"}, kBeneath{"base", "pressed"};
const Names kAll{"low", "high", "under", "held", "base", "pressed", "alone"};

Names both(Names a, const Names& b) {
  a.insert(b.begin(), b.end());
  return a;
}

std::vector<Row> rows(const Kind& kind, const Vec3& pressed) {
  PickCommand pick;
  pick.body = "low";
  pick.point = Vec3(0.0, 0.0, 0.5 * kEdge);
  pick.max_distance = kEdge;
  InciseCommand incise;
  incise.blade.origin = Vec3(-0.01, -0.03, 2.02 * kEdge);
  incise.blade.x_axis = Vec3::UnitY();
  incise.blade.y_axis = Vec3::UnitZ();
  incise.blade.length = 0.06;
  incise.blade.depth = 0.03;
  incise.bodies = {"high"};
  PushCommand gone;
  gone.enable = false;
  const SpawnCommand onto{test::shared(cube(kind, "stone", Vec3(0, 0, 2.503 * kEdge)))};
  const SpawnCommand above{test::shared(cube(kind, "stone", Vec3(0, 0, 2.6 * kEdge)))};
  const SpawnCommand aside{test::shared(cube(kind, "stone", Vec3(-2.0 * kApart, 0, 2.5 * kEdge)))};
  ClipCommand clip;  // what is hollow wakes: clip_test.cpp
  clip.body = "high";
  clip.opening = 4.0 * kEdge;
  const Names pieces{"low.1", "low.2", "high"};
  const AttachCommand joined{"", "low", "high", 0.01, 1e3, {}, {}}, tied{"", "low", "under", 2.0 * kApart, 1.0, {}, {}};
  return {
      {"pick", pick, kTower},
      {"pick moved", MovePickCommand{kPick, kPulled + Vec3(0, 0, 0.001)}, kHeld},
      {"pick told where it is", MovePickCommand{kPick, kPulled}, {}},
      {"lock", LockCommand{kPick, {}}, {}},
      {"lock elsewhere", LockCommand{kPick, kPicked}, kHeld},
      {"release", ReleaseCommand{kPick}, kHeld},
      {"release of no pick", ReleaseCommand{99}, {}, {}, 1, true},
      {"clear picks", ClearPicksCommand{}, kHeld},
      {"pick lifted", lift(ToolKind::kPick), kHeld},
      {"stream of the pick silent", lift(ToolKind::kPick, true), kHeld},
      {"sphere taken away", gone, kBeneath},
      {"sphere lifted", lift(ToolKind::kPush), kBeneath},
      {"stream of the sphere silent", lift(ToolKind::kPush, true), kBeneath},
      {"sphere placed elsewhere", sphereAt(Vec3(0, -0.078, 0.06)), both(kTower, kBeneath)},
      {"sphere moved a little", sphereAt(pressed + Vec3(0, 0, 1e-4)), kBeneath},
      {"sphere told where it is", sphereAt(pressed), {}},
      {"a sphere that a service placed is not lifted by silence",
       lift(ToolKind::kPush, true),
       {},
       {sphereAt(pressed, false)},
       1,
       true},
      {"cut", cutAcross("low"), pieces},
      {"cut that misses", cutAcross("alone"), {}, {}, 1, true},
      {"blades that close", cutAcross("low", 1.0), {}, {}, 5},
      {"blades that have closed", cutAcross("low", 0.02), pieces, {}, 4},
      {"scissors opened", OpenScissorsCommand{}, {}, {cutAcross("low", 1.0)}},
      {"blades opened", OpenBladesCommand{1}, {}, {cutAcross("low", 1.0)}},
      {"scissors lifted", lift(ToolKind::kScissors), {}},
      {"incision", incise, kTower},
      {"undo of a cut", UndoCutCommand{}, kTower, {cutAcross("low")}},
      {"undo of an incision", UndoCutCommand{}, kTower, {incise}},
      {"undo when all sleep again",
       UndoCutCommand{},
       both(kTower, kHeld),
       {incise, ReleaseCommand{kPick}},
       1,
       false,
       true},
      {"undo of nothing", UndoCutCommand{}, {}, {}, 1, true},
      {"material", material("low", 900.0), kTower},
      {"material of all", material("", 900.0), kAll},
      {"material refused", material("low", -1.0), {}, {}, 1, true},
      {"spawn onto", onto, {"low", "high", "stone"}, {}, 10},
      {"spawn above", above, {"stone"}, {}, 3},
      {"spawn aside", aside, {"stone"}, {}, 10},
      {"attach", joined, kTower},
      {"attach to another pile", tied, both(kTower, kHeld)},
      {"attach refused", AttachCommand{"", "low", "low", 0.01, 1e3, {}, {}}, {}, {}, 1, true},
      {"detach", DetachCommand{"low-high", {}}, kTower, {joined}},
      {"detach when all sleep again", DetachCommand{"low-high", {}}, kTower, {joined}, 1, false, true},
      {"detach of nothing", DetachCommand{"low-high", {}}, {}, {}, 1, true},
      {"clip of what is not hollow", clip, {}, {}, 1, true},
      {"clamp of what is free",
       MoveClampCommand{"low", 0, Vec3(0.01, 0.0, 0.0), Quat::Identity(), 1.0},
       {},
       {},
       1,
       true},
      {"gravity", SetGravityCommand{Vec3(0, 0, -9.0)}, kAll},
      {"gravity as it is", SetGravityCommand{Vec3(0, 0, -9.81)}, {}},
      {"gravity that is none", SetGravityCommand{Vec3(0, 0, 1e5)}, {}, {}, 1, true},
      {"body put elsewhere from below", PlaceBodyCommand{"low", at(Vec3(0, 0, 1.0))}, kTower},
      {"body put onto another", PlaceBodyCommand{"alone", at(Vec3(0, 0, 2.503 * kEdge))}, {"low", "high", "alone"}, {}, 10},
      {"body that is not there put elsewhere", PlaceBodyCommand{"nobody", at(Vec3(0, 0, 1.0))}, {}, {}, 1, true},
      {"bodies as they began", ResetBodiesCommand{{"low"}}, kTower},
      {"bodies that the scene has not", ResetBodiesCommand{{"nobody"}}, {}, {}, 1, true},
      {"force", force("low", Vec3(0, 0, 1e-3)), kTower},
      {"force that has ended", force("low", Vec3::Zero()), kTower, {force("low", Vec3(0, 0, 1e-3))}},
      {"no force", force("low", Vec3::Zero()), {}, {}, 1, true},
      {"instrument into the air", AttachInstrumentCommand{probeAt(Vec3(0, 0, 1.0))}, {}, {}, 5},
      {"instrument into tissue", AttachInstrumentCommand{probeAt(Vec3(0, 0, 0.5 * kEdge))}, {}, {}, 1, true},
      {"instrument led into the air",
       LeadInstrumentCommand{"probe", probeAt(Vec3(0, 0, 0.9)).pose, {}},
       {},
       {AttachInstrumentCommand{probeAt(Vec3(0, 0, 1.0))}},
       20},
      {"instrument of no name", DetachInstrumentCommand{"probe"}, {}, {}, 1, true},
      {"instrument led by no name", LeadInstrumentCommand{"probe", {}, {}}, {}, {}, 1, true},
      {"removal from below", RemoveCommand{"low"}, {"high"}},
      {"removal from above", RemoveCommand{"high"}, {"low"}},
      {"removal of what is picked", RemoveCommand{"held"}, {"under"}},
  };
}

/// Nobody sleeps with a speed, and who is to sleep on has not moved.
void expectStill(World& world, const WorldSnapshot& before, const std::string& what) {
  for (const BodySnapshot& body : world.snapshot({false, true, true}).bodies) {
    if (!body.asleep) continue;
    EXPECT_EQ(body.measures.kinetic_energy, 0.0) << body.name << ": " << what;
    EXPECT_EQ(body.measures.linear_momentum, Vec3(Vec3::Zero())) << body.name << ": " << what;
    for (const BodySnapshot& was : before.bodies)
      if (was.name == body.name) EXPECT_EQ(was.particles, body.particles) << body.name << ": " << what;
  }
}

TEST(Waking, WhoIsTouchedWithItsIslandAndNobodyElse) {
  for (const Kind& kind : kKinds) {
    World world = sleepers(kind);
    const auto start = world.capture();
    const WorldSnapshot before = world.snapshot({false, true, false});
    std::set<std::size_t> asked;
    // Each at the state that sleeps.
    const auto expect = [&](const std::string& what, const Names& wake, int steps, const Act& act) {
      world.restore(*start);
      act(world);
      for (int n = 0; n < steps; ++n) world.step();
      EXPECT_EQ(asleep(world, false), wake) << kind.name << ": " << what;
      expectStill(world, before, what + ", " + kind.name);
    };
    for (const Row& row : rows(kind, world.push().position)) {
      asked.insert(row.command.index());
      expect(row.what, row.wake, row.steps, [&](World& w) {
        for (const Command& first : row.before) EXPECT_TRUE(w.apply(first).ok()) << row.what;
        if (row.rested) settle(w, kind);
        const auto reply = w.apply(row.command);
        EXPECT_EQ(reply.ok(), !row.refused) << row.what << (reply.ok() ? "" : ": " + reply.error().detail);
      });
    }
    EXPECT_EQ(asked.size(), std::variant_size_v<Command>) << "a command without a row";

    // What is no command.
    expect("time", {}, 60, [](World&) {});
    expect("scissors shown and hidden", {}, 1, [](World& w) {
      w.setScissors(cutAcross("low").blades, 0.3);
      w.step();
      w.hideScissors();
    });
    expect("a ray", {}, 1, [](World& w) { EXPECT_TRUE(w.probe(Vec3(0, 0, 1), Vec3(0, 0, -1)).ok()); });
    expect("measured", {}, 1, [](World& w) { EXPECT_TRUE(w.inspect("low", true).ok()); });
    expect("state loaded", {}, 1, [&](World& w) { w.restore(*w.capture()); });
    expect("reset", kAll, 1, [](World& w) { w.reset(); });
    const auto obstacle = [](const Vec3& at) {
      return [at](World& w) {
        ObstacleDef wall{"wall", boxMesh(Vec3(0.02, 0.1, 0.1), 1, 1, 1)};
        for (Vec3& p : wall.mesh.vertices) p += at;
        EXPECT_TRUE(w.addObstacle(wall).ok());
      };
    };
    expect("obstacle aside", {}, 1, obstacle(Vec3(0.5 * kApart, 0, 0.06)));
    expect("obstacle beside", kTower, 1, obstacle(Vec3(0.5 * kEdge + 0.009, 0, 0.06)));
  }
}

}  // namespace waking_test
}  // namespace meshless
