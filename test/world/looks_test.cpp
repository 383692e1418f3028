// Bodies of appearance materials: that they carry their weight, whatever alpha and beta are, and look different by them.
#include <cmath>

#include <Eigen/Geometry>

#include "shapes/random_organ.h"
#include "support/bodies.h"
#include "support/random.h"
#include "support/stress.h"

namespace meshless {
namespace looks_test {

using test::Random;
using test::replyOf;

int whole(Random& random, int low, int high) { return static_cast<int>(std::floor(random.uniform(low, high + 1))); }

/// Of all bodies together, over the same at rest.
double volumeOf(World& world) {
  double now = 0.0, rest = 0.0;
  for (const BodySnapshot& body : world.snapshot({true, false, true}).bodies) {
    now += body.measures.volume;
    rest += body.model->rest_volume;
  }
  return now / rest;
}

/// Height over that of the rest shape turned as the body lies.
double heightOf(const BodySnapshot& body) {
  const auto n = static_cast<Eigen::Index>(body.surface.size());
  Eigen::Matrix3Xd rest(3, n), now(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    rest.col(i) = body.model->surface.vertices[static_cast<std::size_t>(i)];
    now.col(i) = body.surface[static_cast<std::size_t>(i)];
  }
  const Eigen::RowVectorXd stiff = Eigen::umeyama(rest, now, false).row(2).head<3>() * rest;
  return (now.row(2).maxCoeff() - now.row(2).minCoeff()) / (stiff.maxCoeff() - stiff.minCoeff());
}

BodyDef randomLook(std::uint64_t seed, Random& random) {
  const double size = std::exp(random.uniform(std::log(0.05), std::log(0.3)));
  BodyDef def = test::defOf(*randomOrgan(seed, whole(random, 0, 2), size, 1500), "organ");
  Material& m = def.material;
  m.mode = static_cast<MatchMode>(whole(random, 0, 2));
  m.alpha = random.uniform(0.1, 1.0);
  m.beta = random.uniform(0.0, 0.95);
  m.density = std::exp(random.uniform(std::log(300.0), std::log(3000.0)));
  m.damping = random.uniform(2.0, 10.0);
  def.clusters.kind = static_cast<ClusterOptions::Kind>(whole(random, 0, 3));
  def.clusters.grid = {whole(random, 1, 4), whole(random, 1, 4), whole(random, 1, 4)};
  def.clusters.count = whole(random, 2, 21);
  def.pose.rotation = random.rotation();
  Box bounds;
  for (const Vec3& v : def.mesh.vertices) bounds.extend(def.pose.rotation * v);
  def.pose.translation = Vec3(0, 0, 0.02 - bounds.min.z());
  return def;
}

struct Stood {
  double slept = 0.0;   // [s] after which it did
  double volume = 0.0;  // over that at rest, as of the others
  double height = 0.0;
  double pieces = 0.0;  // volume of what two cuts leave of it, together
  bool asFewDo() const { return slept > 5.0 || volume < 0.93 || height < 0.6 || pieces < 0.9 || pieces > 1.1; }
};

/// An organ that nobody has drawn of a random material, on the ground, and two cuts through it.
Stood stand(std::uint64_t seed) {
  Random random(seed);
  const BodyDef def = randomLook(seed, random);
  World world{WorldSettings()};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  Stood stood;
  BodySnapshot organ;
  while (!organ.asleep && stood.slept < 15.0) {
    for (int step = 0; step < 12; ++step) world.step();
    stood.slept += 12.0 / world.settings().step_rate;
    organ = world.snapshot({true, false, true}).bodies[0];
  }
  stood.volume = volumeOf(world);
  stood.height = heightOf(organ);
  Box bounds;
  for (const Vec3& p : organ.surface) bounds.extend(p);
  for (int n = 0; n < 2; ++n) {
    CutCommand cut;
    cut.blades.x_axis = random.unit();
    cut.blades.y_axis = cut.blades.x_axis.unitOrthogonal();
    cut.blades.origin = 0.5 * (bounds.min + bounds.max) - 10.0 * cut.blades.x_axis;
    const Result<Reply> done = world.apply(cut);
    EXPECT_TRUE(done.ok()) << done.error().detail;
    for (int step = 0; step < 60; ++step) world.step();
  }
  for (int step = 0; step < 240; ++step) world.step();
  stood.pieces = volumeOf(world);
  if (stood.asFewDo())
    std::printf("seed %lu, %s, alpha %.3f, beta %.3f: asleep after %.1f s, volume %.3f, height %.3f, pieces %.3f\n",
                static_cast<unsigned long>(seed), toString(def.material.mode), def.material.alpha, def.material.beta,
                stood.slept, stood.volume, stood.height, stood.pieces);
  return stood;
}

/// None is flattened, blown up or restless; one in `few` may be softer or slower than most.
void expectTheyStand(std::uint64_t first, int count, int few) {
  int softer = 0;
  for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(count); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Stood stood = stand(seed);
    EXPECT_LT(stood.slept, 15.0);
    EXPECT_GT(stood.volume, 0.93);
    EXPECT_LT(stood.volume, 1.05);
    EXPECT_GT(stood.height, 0.4);
    EXPECT_GT(stood.pieces, 0.85);
    EXPECT_LT(stood.pieces, 1.1);
    softer += stood.asFewDo();
  }
  EXPECT_LE(few * softer, count);
}

TEST(Looks, StandWhateverAlphaAndBetaAre) { expectTheyStand(900, 6, 6); }

// In --long 200 of them.
TEST(Looks, StandWhateverAlphaAndBetaAre_Long) { expectTheyStand(1000, stress::share() > 1.0 ? 200 : 50, 6); }

/// How far a block goes along its load [m] that is held where x or z is small or, as a bridge, at both ends.
enum class Held { kBelow, kBothEnds };
double yields(Held held, MatchMode mode, double alpha, double beta,
              ClusterOptions::Kind clusters = ClusterOptions::Kind::kOne) {
  const bool bridge = held == Held::kBothEnds;
  BodyDef def = test::defOf(bridge ? boxMesh(Vec3(0.2, 0.04, 0.04), 10, 2, 2) : boxMesh(Vec3(0.1, 0.1, 0.1), 5, 5, 5));
  def.spacing = 0.02;
  def.clusters.kind = clusters;
  def.material.mode = mode;
  def.material.alpha = alpha;
  def.material.beta = beta;
  def.material.damping = 20.0;
  if (bridge) {
    def.fixed.push_back(Box{Vec3(-1, -1, -1), Vec3(-0.08, 1, 1)});
    def.fixed.push_back(Box{Vec3(0.08, -1, -1), Vec3(1, 1, 1)});
  } else {
    def.fixed.push_back(Box{Vec3(-1, -1, -1), Vec3(1, 1, -0.03)});
  }
  WorldSettings settings;
  settings.ground.reset();
  settings.gravity = bridge ? Vec3(0, 0, -9.81) : Vec3(9.81, 0, 0);
  World world(settings);
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  for (int step = 0; step < 480; ++step) world.step();
  const BodySnapshot body = world.snapshot({true, false, false}).bodies[0];
  double farthest = 0.0;
  for (std::size_t v = 0; v < body.surface.size(); ++v)
    farthest = std::max(farthest, (body.surface[v] - body.model->own * body.model->surface.vertices[v]).norm());
  return farthest;
}

TEST(Looks, GoalsThatPullHarderYieldLess) {
  for (const ClusterOptions::Kind clusters : {ClusterOptions::Kind::kOne, ClusterOptions::Kind::kAuto}) {
    double before = 1.0;
    for (const double alpha : {0.1, 0.5, 0.9, 0.99}) {
      const double here = yields(Held::kBothEnds, MatchMode::kLinear, alpha, 0.2, clusters);
      EXPECT_LT(here, 0.95 * before) << alpha;
      EXPECT_GT(here, 1e-5) << alpha;
      before = here;
    }
  }
}

TEST(Looks, LinearGoalsShearAndQuadraticOnesBend) {
  const auto shear = [](MatchMode mode, double beta) { return yields(Held::kBelow, mode, 0.9, beta); };
  EXPECT_GT(shear(MatchMode::kLinear, 0.9), 1.2 * shear(MatchMode::kRigid, 0.9));
  EXPECT_GT(shear(MatchMode::kLinear, 0.9), 1.1 * shear(MatchMode::kLinear, 0.3));
  const auto bend = [](MatchMode mode) { return yields(Held::kBothEnds, mode, 0.9, 0.9); };
  EXPECT_GT(bend(MatchMode::kQuadratic), 1.2 * bend(MatchMode::kLinear));
}

// A cube of a heap: its goal alone holds it, so its cells cost nothing.
TEST(Looks, OneStiffGoalNeedsNoCells) {
  const auto stands = [](double alpha, double beta, ClusterOptions::Kind clusters, bool held) {
    BodyDef def = test::block();
    def.spacing = 0.05;
    def.clusters.kind = clusters;
    def.clusters.count = 3;
    def.material.alpha = alpha;
    def.material.beta = beta;
    if (held) def.fixed.push_back(Box{Vec3(-1, -1, -1), Vec3(1, 1, 0.17)});
    return !test::prepared(def).model->elastic_batch;
  };
  EXPECT_TRUE(stands(0.99, 0.2, ClusterOptions::Kind::kOne, false));
  EXPECT_FALSE(stands(0.3, 0.2, ClusterOptions::Kind::kOne, false));
  EXPECT_FALSE(stands(0.9, 0.95, ClusterOptions::Kind::kOne, false));
  EXPECT_FALSE(stands(0.99, 0.2, ClusterOptions::Kind::kCount, false));
  EXPECT_FALSE(stands(0.99, 0.2, ClusterOptions::Kind::kOne, true));

  World world{WorldSettings()};
  BodyDef def = test::block();
  def.spacing = 0.05;
  def.clusters.kind = ClusterOptions::Kind::kOne;
  def.material.alpha = 0.99;
  def.pose.translation = Vec3(0, 0, 0.06);
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  for (const double alpha : {0.99, 0.2, 0.99}) {
    SetMaterialCommand set;
    set.change = [=](const Material& from) -> Result<Material> {
      Material to = from;
      to.alpha = alpha;
      return to;
    };
    replyOf<Done>(world.apply(set));
    for (int step = 0; step < 180; ++step) world.step();
    const BodySnapshot body = world.snapshot({true, false, true}).bodies[0];
    EXPECT_EQ(body.model->elastic_batch == nullptr, alpha == 0.99);
    EXPECT_GT(volumeOf(world), 0.93) << alpha;
    EXPECT_GT(heightOf(body), 0.8) << alpha;
  }
}

TEST(Looks, ABodyGoesFromOneFamilyOfMaterialsToTheOtherAndBack) {
  World world{WorldSettings()};
  BodyDef def = test::block();
  def.pose.translation = Vec3(0, 0, 0.06);
  def.clusters.kind = ClusterOptions::Kind::kCount;
  def.clusters.count = 5;
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  for (int step = 0; step < 120; ++step) world.step();
  const auto become = [&](double youngs_modulus) {
    SetMaterialCommand set;
    set.change = [=](const Material& from) -> Result<Material> {
      Material to = from;
      to.youngs_modulus = youngs_modulus;
      return to;
    };
    replyOf<Done>(world.apply(set));
  };
  const Points before = world.snapshot({true, false, false}).bodies[0].surface;
  for (const double youngs_modulus : {8000.0, 0.0, 20000.0}) {
    become(youngs_modulus);
    for (int step = 0; step < 240; ++step) {
      world.step();
      ASSERT_GT(volumeOf(world), 0.9) << youngs_modulus;
    }
    const BodySnapshot body = world.snapshot({true, false, true}).bodies[0];
    EXPECT_EQ(body.model->clusters.size() > 0, youngs_modulus == 0.0);
    EXPECT_GT(heightOf(body), 0.85);
    for (std::size_t v = 0; v < before.size(); ++v) EXPECT_LT((body.surface[v] - before[v]).norm(), 0.03);
  }
}

TEST(Looks, WithRestitutionComeToRest) {
  for (const double youngs_modulus : {0.0, 2000.0}) {
    World world{WorldSettings()};
    BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.1, 0.1), 4, 4, 4));
    def.pose.translation = Vec3(0, 0, 0.1);
    def.spacing = 0.016;
    def.material.youngs_modulus = youngs_modulus;
    def.material.restitution = 0.1;
    def.material.damping = 4.0;
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    for (int step = 0; step < 1200; ++step) world.step();
    EXPECT_TRUE(world.snapshot({}).bodies[0].asleep) << youngs_modulus;
  }
}

TEST(Looks, AnUndoneCutLeavesOthersTheMaterialThatTheyHaveTakenSince) {
  World world{WorldSettings()};
  for (const double x : {-0.2, 0.2}) {
    BodyDef def = test::block();
    def.name = x < 0.0 ? "left" : "right";
    def.pose.translation = Vec3(x, 0, 0.06);
    def.material.youngs_modulus = 8000.0;
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  }
  world.step();
  CutCommand cut;
  cut.bodies = {"left"};
  cut.blades.x_axis = Vec3::UnitZ();
  cut.blades.y_axis = Vec3::UnitY();
  cut.blades.origin = Vec3(-0.2, 0, -1.0);
  ASSERT_EQ(replyOf<CutReply>(world.apply(cut)).new_bodies.size(), 2u);
  SetMaterialCommand set;
  set.body = "right";
  set.change = [](const Material& from) -> Result<Material> {
    Material to = from;
    to.youngs_modulus = 0.0;
    return to;
  };
  replyOf<Done>(world.apply(set));
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  for (int step = 0; step < 60; ++step) world.step();
  EXPECT_GT(volumeOf(world), 0.9);
  EXPECT_EQ(world.snapshot({}).report.mended, 0u);
}

}  // namespace looks_test
}  // namespace meshless
