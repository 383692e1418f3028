// What a scene does not use costs nothing: counters of the step report, sleep, and memory.
#include <execinfo.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <new>

#include "contact_pile.h"
#include "meshless_surgery/body/deform.h"
#include "support/bodies.h"

namespace {

std::atomic<bool> counting{false};
std::atomic<std::size_t> allocations{0};

// Where to set a break point, or what to print: MESHLESS_SHOW_ALLOCATIONS=1 shows the first stacks.
void count() {
  if (!counting.load(std::memory_order_relaxed)) return;
  const std::size_t known = allocations.fetch_add(1, std::memory_order_relaxed);
  if (known >= 400 || !std::getenv("MESHLESS_SHOW_ALLOCATIONS")) return;
  counting = false;
  void* stack[12];
  backtrace_symbols_fd(stack, backtrace(stack, 12), 2);
  std::fputs("--\n", stderr);
  counting = true;
}

void* take(std::size_t size) {
  count();
  if (void* memory = std::malloc(size ? size : 1)) return memory;
  throw std::bad_alloc();
}

}  // namespace

#ifdef __SANITIZE_ADDRESS__  // which has its own, and tells new from malloc
constexpr bool kCounts = false;
#else
constexpr bool kCounts = true;
void* operator new(std::size_t size) { return take(size); }
void* operator new[](std::size_t size) { return take(size); }
void* operator new(std::size_t size, std::align_val_t align) {
  count();
  const std::size_t a = static_cast<std::size_t>(align);
  if (void* memory = std::aligned_alloc(a, (size + a - 1) / a * a)) return memory;
  throw std::bad_alloc();
}
void* operator new[](std::size_t size, std::align_val_t align) { return operator new(size, align); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
#endif

namespace meshless {
namespace {

using test::replyOf;

constexpr double kCube = 0.1;  // [m]

BodyDef cube(const std::string& name, const Vec3& at) {
  BodyDef def = test::defOf(boxMesh(Vec3::Constant(kCube), 2, 2, 2), name);
  def.pose.translation = at;
  def.spacing = 0.5 * kCube;
  def.clusters.kind = ClusterOptions::Kind::kOne;
  def.material.alpha = 0.9;
  def.material.damping = 5.0;
  return def;
}

void add(World& world, const BodyDef& def) {
  const Result<SpawnReply> reply = world.addSceneBody(test::shared(def));
  ASSERT_TRUE(reply.ok()) << reply.error().detail;
}

StepReport reportOf(World& world) { return world.snapshot({}).report; }

std::vector<Points> particlesOf(World& world) {
  std::vector<Points> all;
  for (BodySnapshot& body : world.snapshot({false, true, false}).bodies) all.push_back(std::move(body.particles));
  return all;
}

void expectNoContactWork(const ContactCounters& c) {
  EXPECT_EQ(c.pairs, 0u);
  EXPECT_EQ(c.tested, 0u);
  EXPECT_EQ(c.penetrating, 0u);
  EXPECT_EQ(c.corrected, 0u);
  EXPECT_EQ(c.queries, 0u);
  EXPECT_EQ(c.contacts, 0u);
}

TEST(Work, OneBodyInTheAirHasMatchingAlone) {
  World world{WorldSettings()};
  add(world, cube("cube", Vec3(0, 0, 1.0)));
  for (int step = 0; step < 20; ++step) {
    world.step();
    const StepReport report = reportOf(world);
    expectNoContactWork(report.contact_counters);
    EXPECT_EQ(report.contact_counters.bounds_tested, 0u);
    EXPECT_EQ(report.contact_shapes, 0u);
    EXPECT_EQ(report.ground_contacts, 0u);
    EXPECT_EQ(report.push_contacts, 0u);
    EXPECT_EQ(report.tetrahedralizations, 0u);
    EXPECT_EQ(report.preserve_counters.gradients, 0u);
    EXPECT_EQ(report.match_counters.quadratic_moments, 0u);
    EXPECT_EQ(report.match_counters.plastic_flows, 0u);
    EXPECT_EQ(report.match_counters.clusters, report.substeps);
    EXPECT_EQ(report.asleep, 0u);
    EXPECT_EQ(report.woken, 0u);
  }
}

// With all that a world can do switched on and nothing of it in use: what the deformer alone does, and nothing else.
TEST(Work, ABodyThatUsesNothingIsDeformedAndNothingElse) {
  for (const bool elastic : {false, true}) {
    SCOPED_TRACE(elastic ? "elastic" : "appearance");
    WorldSettings settings;
    settings.gravity.setZero();
    BodyDef def = test::block("block", Vec3(0.0, 0.0, 5.0));
    def.material.self_contact = SelfContact::kNone;
    if (elastic) {
      def.material.youngs_modulus = 5000.0;
      def.material.poissons_ratio = 0.3;
    }
    PreparedBody body = test::prepared(def);
    for (std::size_t i = 0; i < body.state.positions.size(); ++i)
      body.state.velocities[i] = Vec3(0.5, 1.0, 2.0).cross(body.state.positions[i] - def.pose.translation);
    World world(settings);
    ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(body)).ok());
    StepScratch scratch;
    for (int step = 0; step < 30; ++step) {
      if (step == 10) allocations = 0;
      counting = step >= 10;
      world.step();
      counting = false;
      const StepReport report = reportOf(world);
      MatchCounters alone;
      const double h = 1.0 / settings.step_rate / static_cast<double>(report.substeps);
      for (std::size_t n = 0; n < report.substeps; ++n) {
        matchAndMove(*body.model, def.material, settings.gravity, h, body.state, scratch, alone);
        velocitiesFromPositions(h, body.state, scratch);
      }
      const MatchCounters& match = report.match_counters;
      EXPECT_EQ(match.clusters, alone.clusters);
      EXPECT_EQ(match.rotations, alone.rotations);
      EXPECT_EQ(match.linear_fits, alone.linear_fits);
      EXPECT_EQ(match.quadratic_moments, alone.quadratic_moments);
      EXPECT_EQ(match.plastic_flows, 0u);
      expectNoContactWork(report.contact_counters);
      EXPECT_EQ(report.contact_counters.bounds_tested, 0u);
      EXPECT_EQ(report.contact_counters.self_points, 0u);
      EXPECT_EQ(report.preserve_counters.gradients, 0u);
      EXPECT_EQ(report.contact_shapes, 0u);
      EXPECT_EQ(report.tetrahedralizations, 0u);
      EXPECT_EQ(report.ground_contacts, 0u);
      EXPECT_EQ(report.push_contacts, 0u);
      EXPECT_EQ(particlesOf(world)[0], body.state.positions) << "to the bit";
    }
    if (kCounts) EXPECT_EQ(allocations, 0u);
  }
}

TEST(Work, OneBodyOnTheGroundHasNoPairsAndNoQueries) {
  WorldSettings settings;
  settings.sleep = false;
  World world(settings);
  add(world, cube("cube", Vec3(0, 0, 0.06)));
  std::size_t shapes = 0, ground = 0;
  for (int step = 0; step < 120; ++step) {
    world.step();
    const StepReport report = reportOf(world);
    EXPECT_EQ(report.contact_counters.pairs, 0u);
    EXPECT_EQ(report.contact_counters.queries, 0u);
    EXPECT_EQ(report.contact_counters.bounds_tested, 0u);
    EXPECT_EQ(report.tetrahedralizations, 0u);
    shapes += report.contact_shapes;
    ground += report.ground_contacts;
  }
  EXPECT_LE(shapes, 1u);
  EXPECT_GT(ground, 0u);
}

TEST(Work, BodiesApartAreLookedAtByTheBroadPhaseAlone) {
  WorldSettings settings = test::weightless();
  World world(settings);
  for (int k = 0; k < 8; ++k) add(world, cube("cube" + std::to_string(k), Vec3(0.3 * k, 0.0, 0.0)));
  for (int step = 0; step < 20; ++step) {
    world.step();
    const StepReport report = reportOf(world);
    expectNoContactWork(report.contact_counters);
    EXPECT_EQ(report.contact_shapes, 0u);
    EXPECT_EQ(report.tetrahedralizations, 0u);
  }
}

TEST(Work, OnlyThoseThatComeNearGetAShape) {
  World world(test::weightless());
  for (int k = 0; k < 8; ++k) add(world, cube("cube" + std::to_string(k), Vec3(0.3 * k, 0.0, 0.0)));
  add(world, cube("near", Vec3(0.0, 0.0, 1.0005 * kCube)));
  world.step();
  const StepReport report = reportOf(world);
  EXPECT_EQ(report.contact_counters.pairs, 1u);
  EXPECT_GT(report.contact_counters.queries, 0u);
  EXPECT_LE(report.contact_counters.queries, 2u * (26u + 24u * 2u)) << "points of two cubes";
  EXPECT_EQ(report.contact_shapes, 2u);
  EXPECT_EQ(report.tetrahedralizations, 0u);
  for (int step = 0; step < 20; ++step) {
    world.step();
    EXPECT_EQ(reportOf(world).contact_shapes, 0u) << "a shape is made once";
  }
}

TEST(Work, WithoutContactNothingIsLookedFor) {
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  World world(settings);
  add(world, cube("a", Vec3::Zero()));
  add(world, cube("b", Vec3(0.01, 0.02, 0.03)));
  for (int step = 0; step < 10; ++step) {
    world.step();
    const StepReport report = reportOf(world);
    expectNoContactWork(report.contact_counters);
    EXPECT_EQ(report.contact_counters.bounds_tested, 0u);
    EXPECT_EQ(report.contact_shapes, 0u);
  }
}

// --- sleep

/// Towers of two cubes, far from each other; asleep. Islands are {low_k, high_k}.
World sleepingTowers(int towers) {
  World world{WorldSettings()};
  for (int k = 0; k < towers; ++k) {
    add(world, cube("low" + std::to_string(k), Vec3(0.5 * k, 0.0, 0.501 * kCube)));
    BodyDef high = cube("high" + std::to_string(k), Vec3(0.5 * k + 0.004, -0.003, 1.502 * kCube));
    high.pose.rotation = Quat(Eigen::AngleAxisd(0.3, Vec3::UnitZ()));
    add(world, high);
  }
  for (int step = 0; step < 2400 && reportOf(world).asleep < 2u * static_cast<unsigned>(towers); ++step) world.step();
  EXPECT_EQ(reportOf(world).asleep, 2u * static_cast<unsigned>(towers));
  world.takeEvents();
  return world;
}

std::vector<std::string> awakeBodies(World& world) {
  std::vector<std::string> names;
  for (const BodySnapshot& body : world.snapshot({}).bodies)
    if (!body.asleep) names.push_back(body.name);
  return names;
}

using Names = std::vector<std::string>;

TEST(Sleep, AThousandSleepersDoNothingAndMoveByNoBit) {
  World world{WorldSettings()};
  const auto first = test::shared(cube("cube", Vec3(0, 0, 0.501 * kCube)));
  for (int k = 0; k < 1000; ++k) {
    PreparedBody copy = *first;
    copy.def.name = "cube" + std::to_string(k);
    const Vec3 shift(0.2 * (k % 32), 0.2 * (k / 32), 0.0);
    for (Vec3& p : copy.state.positions) p += shift;
    for (Vec3& p : copy.state.surface) p += shift;
    for (ClusterPose& pose : copy.state.poses) pose.centre += shift;
    ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(std::move(copy))).ok());
  }
  for (int step = 0; step < 600 && reportOf(world).asleep < 1000u; ++step) world.step();
  ASSERT_EQ(reportOf(world).asleep, 1000u);
  const std::vector<Points> before = particlesOf(world);
  const auto beginning = world.snapshot({true, false, false});
  for (int step = 0; step < 120; ++step) {
    world.step();
    const StepReport report = reportOf(world);
    ASSERT_EQ(report.asleep, 1000u);
    expectNoContactWork(report.contact_counters);
    EXPECT_EQ(report.contact_counters.bounds_tested, 0u);
    EXPECT_EQ(report.match_counters.clusters, 0u);
    EXPECT_EQ(report.match_counters.rotations, 0u);
    EXPECT_EQ(report.preserve_counters.gradients, 0u);
    EXPECT_EQ(report.ground_contacts, 0u);
    EXPECT_EQ(report.contact_shapes, 0u);
  }
  EXPECT_EQ(particlesOf(world), before);
  const auto end = world.snapshot({true, false, false});
  for (std::size_t b = 0; b < end.bodies.size(); ++b) ASSERT_EQ(end.bodies[b].surface, beginning.bodies[b].surface);
}

/// What a step has done, in pieces of work.
std::size_t workIn(const StepReport& report) {
  const ContactCounters& c = report.contact_counters;
  return report.match_counters.clusters + c.bounds_tested + c.pairs + c.queries + c.contacts + c.corrected +
         report.ground_contacts;
}

TEST(Sleep, APileOfAThousandFallsAsleepAndDoesNothing_Long) {
  bench::PileOptions options;
  if (!kCounts) options.bodies = 100;  // under the sanitizer
  options.sleeping = true;
  World world = bench::makePile(options);
  const std::size_t all = static_cast<std::size_t>(options.bodies);
  std::size_t awake = 0;  // work of the step that had most
  int steps = 0;
  while (steps < 2400 && reportOf(world).asleep < all) {
    world.step();
    ++steps;
    awake = std::max(awake, workIn(reportOf(world)));
  }
  ASSERT_EQ(reportOf(world).asleep, all) << "after " << steps / 60.0 << " s";
  EXPECT_GT(awake, 20u * all);
  const std::vector<Points> before = particlesOf(world);
  for (int step = 0; step < 60; ++step) {
    world.step();
    EXPECT_EQ(workIn(reportOf(world)), 0u);
  }
  EXPECT_EQ(particlesOf(world), before);
}

// What trembles between two substeps and stays where it is does not keep a tower awake; the pile's tower 121 did for
// good.
TEST(Sleep, ATowerThatTremblesWithinItsFramesSleeps) {
  bench::PileOptions options;
  options.sleeping = true;
  options.substeps = 8;
  const bench::PileStart start = bench::startPile(options);
  WorldSettings settings;
  settings.step_rate = 60.0;
  settings.substeps = options.substeps;
  World world(settings);
  BodyDef def = test::defOf(boxMesh(Vec3::Constant(1.0), 2, 2, 2), "cube");
  def.spacing = 0.5;
  def.clusters.kind = ClusterOptions::Kind::kOne;
  def.material.alpha = options.alpha;
  def.material.density = 1.0;
  for (std::size_t k = 121; k < start.poses.size(); k += 256) {
    def.name = "cube" + std::to_string(k);
    def.pose = start.poses[k];
    add(world, def);
  }
  int steps = 0;
  while (steps < 1200 && reportOf(world).asleep < 4u) {
    world.step();
    ++steps;
  }
  EXPECT_EQ(reportOf(world).asleep, 4u);
}

// The spring of a sleeper keeps its force, and moves nothing.
TEST(Sleep, ABodyThatSleepsOnAStretchedSpringMovesByNoBitAndTheSpringKeepsItsForce) {
  WorldSettings settings;
  settings.gravity.setZero();
  settings.ground.reset();
  World world(settings);
  add(world, cube("hung", Vec3::Zero()));
  PickCommand pick;
  for (const double side : {-1.0, 1.0}) {
    pick.point = Vec3(side * 0.05, 0, 0);
    const PickReply picked = replyOf<PickReply>(world.apply(pick));
    replyOf<Done>(world.apply(LockCommand{picked.pick, picked.position + Vec3(0.02 * side, 0, 0)}));
  }
  int steps = 0;
  double force = 0.0;
  while (steps < 2400 && reportOf(world).asleep == 0) {
    force = world.snapshot({}).picks[0].force.norm();
    world.step();
    ++steps;
  }
  ASSERT_EQ(reportOf(world).asleep, 1u);
  ASSERT_GT(force, 0.1);
  const std::vector<Points> before = particlesOf(world);
  for (int step = 0; step < 60; ++step) world.step();
  ASSERT_EQ(reportOf(world).asleep, 1u);
  EXPECT_EQ(particlesOf(world), before);
  EXPECT_NEAR(world.snapshot({}).picks[0].force.norm(), force, 0.05 * force);
}

TEST(Sleep, ASphereOnItsWayWakesWhoItReachesInTheSameStep) {
  World world = sleepingTowers(2);
  PushCommand push;
  push.radius = 0.03;
  push.position = Vec3(0.5, -0.3, 0.06);
  replyOf<Done>(world.apply(push));
  push.position.y() = 0.0;
  push.speed = 0.5;
  replyOf<Done>(world.apply(push));
  bool touched = false;
  for (int step = 0; step < 120 && !touched; ++step) {
    const Names before = awakeBodies(world);
    world.step();
    touched = world.push().touching;
    if (touched)
      EXPECT_EQ(awakeBodies(world), (Names{"low1", "high1"}));
    else if (world.push().position.y() < -0.1)
      EXPECT_EQ(awakeBodies(world), Names());
  }
  EXPECT_TRUE(touched);
}

TEST(Sleep, WakingMovesNothingVisibly) {
  World world = sleepingTowers(3);
  SetMaterialCommand same;  // wakes all, and changes nothing
  same.change = [](const Material& m) { return Result<Material>(m); };
  const std::vector<Points> before = particlesOf(world);
  replyOf<Done>(world.apply(same));
  double most = 0.0;
  world.step();
  EXPECT_EQ(awakeBodies(world).size(), 6u);
  const std::vector<Points> after = particlesOf(world);
  for (std::size_t b = 0; b < before.size(); ++b)
    for (std::size_t i = 0; i < before[b].size(); ++i) most = std::max(most, (after[b][i] - before[b][i]).norm());
  RecordProperty("most", std::to_string(most / kCube));
  EXPECT_LT(most, 1e-3 * kCube);
}

TEST(Sleep, AnythingThatFloatsFreeStaysAwake) {
  World world(test::weightless());
  add(world, cube("free", Vec3::Zero()));
  for (int step = 0; step < 240; ++step) world.step();
  EXPECT_EQ(reportOf(world).asleep, 0u);
}

// --- memory

TEST(Memory, TheCounterSeesWhatTheLibraryAllocates) {
  if (!kCounts) GTEST_SKIP() << "the sanitizer has its own allocator";
  World world = sleepingTowers(1);
  allocations = 0;
  counting = true;
  const WorldSnapshot shot = world.snapshot({false, true, false});
  counting = false;
  EXPECT_GE(allocations, 3u);  // bodies, and the particles of two
  EXPECT_EQ(shot.bodies.size(), 2u);
}

std::size_t allocationsIn(World& world, int steps) {
  allocations = 0;
  counting = true;
  for (int step = 0; step < steps; ++step) world.step();
  counting = false;
  return allocations;
}

TEST(Memory, SteppingAPileAllocatesNothing) {
  if (!kCounts) GTEST_SKIP() << "the sanitizer has its own allocator";
  for (const int bodies : {5, 60}) {
    bench::PileOptions options;
    options.bodies = bodies;
    World world = bench::makePile(options);
    for (int step = 0; step < 1200; ++step) world.step();  // pairs that are new have to be kept somewhere
    EXPECT_EQ(allocationsIn(world, 60), 0u) << "in 60 steps of " << bodies << " bodies";
  }
}

TEST(Memory, SteppingALiverOnTheGroundAllocatesNothing) {
  if (!kCounts) GTEST_SKIP() << "the sanitizer has its own allocator";
  WorldSettings settings;
  settings.sleep = false;
  World world(settings);
  BodyDef def = test::defOf(liverMesh(), "liver");
  def.pose.translation = Vec3(0, 0, 0.06);
  def.spacing = 0.01;
  add(world, def);
  for (int step = 0; step < 240; ++step) world.step();
  EXPECT_EQ(allocationsIn(world, 60), 0u) << "in 60 steps";
}

// A stack of an appearance material that the push sphere touches, and one of elastic blocks.
TEST(Memory, SteppingBodiesThatPressOnEachOtherAllocatesNothing) {
  if (!kCounts) GTEST_SKIP() << "the sanitizer has its own allocator";
  WorldSettings settings;
  settings.sleep = false;
  World world(settings);
  for (const int k : {0, 1, 2, 3}) {
    BodyDef def = cube("cube" + std::to_string(k), Vec3(0.5 * (k / 2), 0.0, (0.501 + 1.001 * (k % 2)) * kCube));
    if (k >= 2) {
      def.material.youngs_modulus = 20000.0;
      def.material.poissons_ratio = 0.3;
    }
    add(world, def);
  }
  PushCommand push;
  push.radius = 0.03;
  push.position = Vec3(0.0, -0.079, 0.06);
  replyOf<Done>(world.apply(push));
  for (int step = 0; step < 240; ++step) world.step();
  EXPECT_EQ(reportOf(world).contact_counters.pairs, 2u);
  EXPECT_GT(reportOf(world).contact_counters.corrected, 0u);
  EXPECT_EQ(allocationsIn(world, 60), 0u) << "in 60 steps";
}

TEST(Memory, SleepersAllocateNothing) {
  if (!kCounts) GTEST_SKIP() << "the sanitizer has its own allocator";
  World world = sleepingTowers(2);
  EXPECT_EQ(allocationsIn(world, 60), 0u) << "in 60 steps";
}

}  // namespace
}  // namespace meshless
