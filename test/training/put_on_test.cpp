// What is put on pegs: where a ring is around an obstacle, how it came there, and what falls beside or out of view.
#include <algorithm>
#include <cmath>

#include "meshless_surgery/geometry/mesh/primitives.h"
#include "shapes/organs.h"
#include "training/played.h"

namespace meshless {
namespace put_on_test {

constexpr double kPegHeight = 0.016, kRate = 120.0;

TriangleMesh peg(const Vec3& foot) {
  TriangleMesh mesh = cylinderMesh(kPegHeight, 0.00175, 0.0015);
  for (Vec3& p : mesh.vertices) p += foot + 0.5 * kPegHeight * Vec3::UnitZ();
  return mesh;
}

bool isAroundPeg(TriangleMesh mesh, const Pose& pose, const Pose& all = Pose()) {
  TriangleMesh obstacle = peg(Vec3::Zero());
  for (Vec3& p : obstacle.vertices) p = all * p;
  for (Vec3& p : mesh.vertices) p = all * (pose * p);
  return isAround(obstacle, mesh.vertices, mesh.triangles);
}

Pose at(double x, double y, double z, double tilt = 0.0) {
  return {Quat(Eigen::AngleAxisd(tilt, Vec3::UnitY())), Vec3(x, y, z)};
}

TEST(IsAround, ARingIsWhereThePegGoesThroughIt) {
  const TriangleMesh ring = pegTriangleMesh();
  const Pose turned{Quat(Eigen::AngleAxisd(1.2, Vec3(1, 2, 3).normalized())), Vec3(0.3, -0.2, 0.5)};
  for (const Pose& all : {Pose(), turned}) {
    EXPECT_TRUE(isAroundPeg(ring, at(0, 0, 0.0046), all));
    EXPECT_TRUE(isAroundPeg(ring, at(0.002, -0.002, 0.009), all)) << "it hangs beside the middle, half-way up";
    EXPECT_TRUE(isAroundPeg(ring, at(0, 0, 0.006, 0.3), all)) << "aslant";
    EXPECT_FALSE(isAroundPeg(ring, at(0.02, 0, 0.0046), all)) << "it stands beside it";
    EXPECT_FALSE(isAroundPeg(ring, at(0.006, 0, 0.0046), all)) << "its wall is where the peg is";
    EXPECT_FALSE(isAroundPeg(ring, at(0, 0, 0.03), all)) << "it is held above it";
    EXPECT_FALSE(isAroundPeg(ring, at(0.006, 0, 0.014, 0.8), all)) << "it hangs on the end by one side";
  }
  EXPECT_FALSE(isAroundPeg(boxMesh(Vec3(0.01, 0.01, 0.01), 0.003), at(0, 0, 0.022))) << "a block on top";
  EXPECT_FALSE(isAroundPeg(boxMesh(Vec3(0.01, 0.01, 0.01), 0.003), at(0, 0, 0.008))) << "a block that it is in";
  EXPECT_FALSE(isAroundPeg(boxMesh(Vec3(0.01, 0.01, 0.01), 0.003), at(0.007, 0, 0.005))) << "a block beside it";
  TriangleMesh open = ring;  // one wall is cut through
  open.triangles.clear();
  const auto gap = [&](Index v) { return std::abs(ring.vertices[v].x()) < 0.002 && ring.vertices[v].y() < 0.0; };
  for (const Triangle& t : ring.triangles)
    if (std::none_of(t.begin(), t.end(), gap)) open.triangles.push_back(t);
  EXPECT_FALSE(isAroundPeg(open, at(0, 0, 0.0046))) << "a hook";
}

/// What a world says of a ring on a peg, and in the air.
TEST(IsAround, TheWorldSaysWhatStandsOnWhat) {
  WorldSettings settings;
  settings.ground = 0.0;
  World world(settings);
  BodyDef def = test::defOf(pegTriangleMesh(), "ring");
  def.pose.translation = Vec3(0, 0, 0.0046);
  def.spacing = 0.0035;
  def.collision.kind = CollisionChoice::Kind::kVisual;
  def.material.youngs_modulus = 2e4;
  def.material.damping = 20.0;
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  ASSERT_TRUE(world.addObstacle({"peg", peg(Vec3::Zero()), 0.5, {}}).ok());
  ASSERT_TRUE(world.addObstacle({"other", peg(Vec3(0.05, 0, 0)), 0.5, {}}).ok());
  FrameWants wants;
  wants.placed = {"ring"};
  const auto frame = [&] {
    TrainingFrame said;
    do {
      world.step();
      said = frameOf(world, world.takeEvents(), wants);
    } while (!said.places);
    return said.bodies.at(0);
  };
  for (int k = 0; k < 20; ++k) world.step();
  EXPECT_EQ(std::vector<std::string>{"peg"}, frame().around);
  EXPECT_TRUE(frame().supported);
  PickCommand pick;
  pick.point = Vec3(0, -0.006, 0.02);
  pick.max_distance = 0.05;
  const auto picked = test::replyOf<PickReply>(world.apply(pick));
  for (int k = 1; k <= 120; ++k) {
    ASSERT_TRUE(world.apply(MovePickCommand{picked.pick, picked.position + k / 120.0 * Vec3(0, 0, 0.05)}).ok());
    world.step();
  }
  EXPECT_TRUE(frame().around.empty());
  EXPECT_FALSE(frame().supported);
}

// --- how it came there, by frames as a world gives them

/// A ring and two hands.
class Told {
 public:
  explicit Told(bool handed_over, std::vector<std::string> bodies = {"ring"}) {
    PutOn put;
    put.bodies = std::move(bodies);
    put.obstacles = {"there", "beyond"};
    put.handed_over = handed_over;
    task.name = "task";
    task.stages.push_back({"put", "", put, 0.0});
    MetricLimits limits;
    limits.placed = task.placed();
    limits.view = Box{Vec3(-1, -1, 0), Vec3(1, 1, 1)};
    metrics = std::make_unique<Metrics>(limits);
    progress = std::make_unique<TaskProgress>(task);
    for (const std::string& name : task.placed()) {
      TrainingFrame::Body body;
      body.name = name;
      body.number = static_cast<std::uint32_t>(frame.bodies.size() + 1);
      frame.bodies.push_back(body);
    }
    frame.dt = 1.0 / kRate;
    frame.down = -Vec3::UnitZ();
    frame.sampled = frame.centres = frame.places = true;
  }
  /// For so long the hands with these numbers hold the first body, and it is around those obstacles.
  void passes(double seconds, const std::vector<std::uint32_t>& hands, const std::vector<std::string>& around,
              bool supported) {
    frame.tools.clear();
    for (const std::uint32_t hand : hands) {
      TrainingFrame::Tool tool;
      tool.kind = ToolKind::kInstrument;
      tool.pick = hand;
      tool.body = frame.bodies[0].name;
      frame.tools.push_back(tool);
    }
    frame.bodies[0].around = around;
    frame.bodies[0].supported = supported;
    for (int k = 0; k < std::lround(seconds * kRate); ++k) {
      ++frame.step;
      metrics->feed(frame);
      progress->feed(frame, *metrics, tissue);
      frame.events.clear();
    }
  }
  double value(const std::string& name) const {
    for (const MetricValue& metric : metrics->values(tissue, progress->stage()))
      if (metric.name == name) return metric.value;
    return std::nan("");
  }
  void onTheFirstPeg() { passes(0.2, {}, {"here"}, true); }
  void intoTheAirBy(std::uint32_t hand) {
    passes(0.2, {hand}, {"here"}, true);
    passes(0.2, {hand}, {}, false);
  }
  void downOn(const std::string& peg, std::uint32_t hand) {
    passes(0.2, {hand}, {peg}, false);
    passes(0.2, {}, {peg}, true);
  }

  TaskDef task;
  TrainingFrame frame;
  RestTissue tissue{std::nullopt, std::nullopt, std::nullopt};
  std::unique_ptr<Metrics> metrics;
  std::unique_ptr<TaskProgress> progress;
};

TEST(PutOn, IsMetByWhatIsOnAnObstacleOfTheListAndInNoHand) {
  Told told(false);
  told.onTheFirstPeg();
  EXPECT_FALSE(told.progress->done());
  told.intoTheAirBy(1);
  told.passes(0.5, {1}, {"there"}, false);
  EXPECT_FALSE(told.progress->done()) << "it is in a hand";
  told.passes(0.1, {}, {"there"}, true);
  EXPECT_TRUE(told.progress->done());
  EXPECT_EQ(0.0, told.value("drops"));
}

TEST(PutOn, EachHasAnObstacleOfItsOwn) {
  Told told(false, {"ring", "second"});
  told.frame.bodies[1].around = {"there"};
  told.passes(0.2, {}, {"there"}, true);
  EXPECT_FALSE(told.progress->done()) << "two on one";
  told.passes(0.2, {}, {"beyond"}, true);
  EXPECT_TRUE(told.progress->done());
}

TEST(PutOn, HandedOverIsWhatAnotherHandTookInTheAir) {
  Told good(true);
  good.onTheFirstPeg();
  good.intoTheAirBy(1);
  good.passes(0.2, {1, 2}, {}, false);
  good.passes(0.2, {2}, {}, false);
  good.downOn("there", 2);
  EXPECT_TRUE(good.progress->done());

  Told alone(true);
  alone.onTheFirstPeg();
  alone.intoTheAirBy(1);
  alone.downOn("there", 1);
  EXPECT_FALSE(alone.progress->done()) << "by one hand";

  Told standing(true);
  standing.onTheFirstPeg();
  standing.passes(0.2, {1}, {"here"}, true);
  standing.passes(0.2, {1, 2}, {"here"}, true);
  standing.passes(0.2, {2}, {"here"}, true);
  standing.passes(0.2, {2}, {}, false);
  standing.downOn("there", 2);
  EXPECT_FALSE(standing.progress->done()) << "handed over on the board";

  Told thrown(true);
  thrown.onTheFirstPeg();
  thrown.intoTheAirBy(1);
  thrown.passes(0.2, {}, {}, false);
  thrown.passes(0.2, {2}, {}, false);
  thrown.downOn("there", 2);
  EXPECT_FALSE(thrown.progress->done()) << "thrown from one hand to the other";

  Told returned(true);
  returned.onTheFirstPeg();
  returned.intoTheAirBy(1);
  returned.passes(0.2, {1, 2}, {}, false);
  returned.passes(0.2, {2}, {}, false);
  returned.downOn("here", 2);
  returned.passes(0.2, {2}, {}, false);
  returned.downOn("there", 2);
  EXPECT_FALSE(returned.progress->done()) << "put back first, then brought by one hand";
}

TEST(PutOn, WhoLosesItMayTakeItUpAgainWithTheSameHand) {
  for (const std::uint32_t hand : {2u, 1u}) {
    Told told(true);
    told.onTheFirstPeg();
    told.intoTheAirBy(1);
    told.passes(0.2, {1, 2}, {}, false);
    told.passes(0.2, {2}, {}, false);
    told.passes(1.0, {}, {}, true);  // it lies on the board
    EXPECT_EQ(1.0, told.value("drops"));
    told.passes(0.2, {hand}, {}, false);
    told.downOn("there", hand);
    EXPECT_EQ(hand == 2u, told.progress->done());
    EXPECT_EQ(1.0, told.value("drops"));
  }
}

TEST(Drops, OfBodiesThatAreToBePutOnSomethingAreThoseThatLieElsewhere) {
  Told told(false);
  told.onTheFirstPeg();
  told.intoTheAirBy(1);
  told.passes(0.3, {}, {}, false);  // let go of above the peg: it slides down
  told.passes(1.0, {}, {"here"}, true);
  EXPECT_EQ(0.0, told.value("drops"));
  told.intoTheAirBy(1);
  told.passes(0.3, {}, {}, false);
  told.passes(0.3, {2}, {}, false);  // caught
  EXPECT_EQ(0.0, told.value("drops"));
  told.passes(2.0, {}, {}, true);
  EXPECT_EQ(1.0, told.value("drops"));
  told.passes(0.2, {1}, {}, false);
  Event slips;
  slips.type = EventType::kDropped;
  slips.body = "ring";
  told.frame.events = {slips};
  told.passes(2.0, {}, {}, true);
  EXPECT_EQ(2.0, told.value("drops")) << "what slips counts once";
}

TEST(OutOfView, CountsWhatWasHeldAndIsLetGoOfOutside) {
  Told told(false);
  told.frame.bodies[0].centre = Vec3(2, 0, 0);
  told.passes(0.5, {}, {}, true);
  EXPECT_EQ(0.0, told.value("out_of_view")) << "no hand has held it";
  told.passes(0.5, {1}, {}, false);
  EXPECT_EQ(0.0, told.value("out_of_view")) << "it is in a hand";
  told.passes(0.5, {}, {}, true);
  EXPECT_EQ(1.0, told.value("out_of_view"));
  told.passes(0.5, {1}, {}, false);
  told.frame.bodies[0].centre = Vec3(0, 0, 0.5);
  told.passes(0.5, {}, {}, false);
  EXPECT_EQ(1.0, told.value("out_of_view"));
  told.frame.bodies[0].centre = Vec3(1.5, 0, 0);  // it rolls away
  told.passes(0.5, {}, {}, true);
  EXPECT_EQ(2.0, told.value("out_of_view"));
}

}  // namespace put_on_test
}  // namespace meshless
