#include "meshless_surgery/world/saved_world.h"

#include <cstdlib>
#include <cstring>
#include <functional>

#include <zlib.h>

#include "meshless_surgery/world/world.h"
#include "support/bodies.h"
#include "support/forged.h"
#include "support/images.h"
#include "support/random.h"
#include "support/textured.h"

namespace meshless {
namespace saved_world_test {

using test::replyOf;

SpawnCommand spawnOf(std::shared_ptr<const PreparedBody> body) {
  SpawnCommand spawn;
  spawn.body = std::move(body);
  return spawn;
}

CutCommand cutThrough(const Vec3& point, const Vec3& normal, double close_time = 0.0) {
  CutCommand cut;
  cut.blades.x_axis = normal.unitOrthogonal();
  cut.blades.y_axis = normal.cross(cut.blades.x_axis);
  cut.blades.origin = point - 10.0 * cut.blades.x_axis;
  cut.close_time = close_time;
  return cut;
}

PickCommand pickNear(const Vec3& p) {
  PickCommand pick;
  pick.point = p;
  pick.max_distance = 1.0;
  return pick;
}

void run(World& world, int steps) {
  for (int i = 0; i < steps; ++i) world.step();
}

/// A scene in the middle of something, and what goes on in it afterwards (by the number of the step since).
struct Case {
  std::string name;
  std::function<World()> start;
  std::function<void(World&, int)> go_on = [](World&, int) {};
  int steps = 60;
};
std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

World ballThatFalls() {
  World world{WorldSettings()};
  EXPECT_TRUE(world.addSceneBody(test::shared(test::ball())).ok());
  run(world, 20);
  return world;
}

World pile() {
  WorldSettings settings;
  World world(settings);
  BodyDef def = test::defOf(boxMesh(Vec3(0.05, 0.05, 0.05), 2, 2, 2), "box");
  def.spacing = 0.025;
  const PreparedBody first = test::prepared(def);
  for (int i = 0; i < 48; ++i) {
    Pose pose;
    pose.translation = Vec3(0.06 * (i % 4) + 0.002 * (i % 7), 0.06 * (i / 4 % 3), 0.05 + 0.07 * (i / 12));
    pose.rotation = Quat(Eigen::AngleAxisd(0.1 * i, Vec3(0.3, 0.5, 0.8).normalized()));
    EXPECT_TRUE(
        world.addSceneBody(std::make_shared<const PreparedBody>(placedCopy(first, "box_" + std::to_string(i), pose)))
            .ok());
  }
  run(world, 55);
  return world;
}

World pileAtRest() {
  World world = pile();
  run(world, 500);
  std::size_t asleep = 0;
  for (const BodySnapshot& body : world.snapshot({}).bodies) asleep += body.asleep;
  EXPECT_GT(asleep, 0u);
  return world;
}

World filledCells() {
  WorldSettings settings;
  settings.contact = ContactMethod::kNone;
  World world{settings};
  BodyDef def = test::block("block", Vec3(0, 0, 0.06));
  def.spacing = 0.027;
  def.material.youngs_modulus = 5000.0;
  def.material.density = 1000.0;
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  def.name = "held";
  def.pose.translation = Vec3(0.4, 0.0, 0.1);
  def.fixed = {{Vec3(-1, -1, -1), Vec3(0.32, 1, 1)}};
  def.material.plasticity.yield = 0.01;
  def.material.plasticity.creep = 20.0;
  def.material.plasticity.maximum = 1.0;
  def.regions = {{Region::sphere(Vec3(0.02, 0, 0), 0.03), def.material}};
  def.regions[0].material.youngs_modulus = 20000.0;
  def.regions[0].material.density = 1200.0;
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  run(world, 10);
  replyOf<PickReply>(world.apply(pickNear(Vec3(0.1, 0.0, 0.1))));
  MovePickCommand move;
  move.pick = 1;
  move.target = Vec3(0.15, 0.02, 0.18);
  EXPECT_TRUE(world.apply(move).ok());
  run(world, 10);
  return world;
}

World filledCellsCut() {
  World world = filledCells();
  EXPECT_TRUE(world.apply(cutThrough(Vec3(0.03, 0, 0.06), Vec3(1.0, 0.2, 0.1).normalized())).ok());
  InciseCommand incise;
  incise.blade.origin = Vec3(0.3, 0.01, 0.2);
  incise.blade.x_axis = Vec3::UnitX();
  incise.blade.y_axis = Vec3::UnitZ();
  incise.blade.length = 0.3;
  incise.blade.depth = 0.1;
  incise.bodies = {"held"};
  EXPECT_TRUE(world.apply(incise).ok());
  run(world, 4);
  return world;
}

World elasticCut() {
  World world{WorldSettings()};
  BodyDef def = test::block("block", Vec3(0, 0, 0.06));
  def.spacing = 0.025;
  def.material.youngs_modulus = 5000.0;
  def.material.density = 1000.0;
  def.collision = {CollisionChoice::Kind::kEdge, 0.03};
  def.fixed = {{Vec3(-1, -1, -1), Vec3(-0.08, 1, 1)}};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  run(world, 10);
  replyOf<PickReply>(world.apply(pickNear(Vec3(0.1, 0.0, 0.1))));
  MovePickCommand move;
  move.pick = 1;
  move.target = Vec3(0.15, 0.02, 0.18);
  EXPECT_TRUE(world.apply(move).ok());
  run(world, 10);
  EXPECT_TRUE(world.apply(cutThrough(Vec3(0.03, 0, 0.06), Vec3(1.0, 0.2, 0.1).normalized())).ok());
  run(world, 4);  // while what the cut releases is eased
  return world;
}

World plastic() {
  World world{WorldSettings()};
  BodyDef def = test::block("clay", Vec3(0, 0, 0.2));
  def.material.alpha = 0.3;
  def.material.plasticity.yield = 0.01;
  def.material.plasticity.creep = 20.0;
  def.material.plasticity.maximum = 1.0;
  def.material.volume.points = {{0.0, 0.5}};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  run(world, 40);
  return world;
}

World everyTool() {
  WorldSettings settings;
  World world(settings);
  EXPECT_TRUE(world.addSceneBody(test::shared(test::ball("one", Vec3(0, 0, 0.11)))).ok());
  EXPECT_TRUE(world.addSceneBody(test::shared(test::ball("two", Vec3(0.0, 0.05, 0.33)))).ok());
  ObstacleDef table;
  table.name = "table";
  table.mesh = boxMesh(Vec3(0.3, 0.3, 0.02), 1, 1, 1);
  for (Vec3& p : table.mesh.vertices) p += Vec3(0.2, 0.0, 0.05);
  EXPECT_TRUE(world.addObstacle(table).ok());
  run(world, 30);
  const auto pick = replyOf<PickReply>(world.apply(pickNear(Vec3(0, -0.1, 0.11))));
  const auto locked = replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0.1, 0.2))));
  LockCommand lock;
  lock.pick = locked.pick;
  lock.target = Vec3(0.0, 0.16, 0.2);
  EXPECT_TRUE(world.apply(lock).ok());
  MovePickCommand move;
  move.pick = pick.pick;
  move.target = Vec3(0, -0.15, 0.2);
  EXPECT_TRUE(world.apply(move).ok());
  PushCommand push;
  push.radius = 0.03;
  push.position = Vec3(-0.2, 0, 0.1);
  EXPECT_TRUE(world.apply(push).ok());
  push.position = Vec3(0.1, 0, 0.1);
  push.speed = 0.3;
  EXPECT_TRUE(world.apply(push).ok());
  InciseCommand incise;
  incise.blade.origin = Vec3(-0.03, 0.0, 0.25);
  incise.blade.length = 0.06;
  incise.blade.depth = 0.2;
  incise.blade.y_axis = Vec3::UnitZ();
  EXPECT_TRUE(world.apply(incise).ok());
  run(world, 40);
  EXPECT_TRUE(world.apply(cutThrough(Vec3(0, 0, 0.1), Vec3(0.1, 0.0, 1.0).normalized(), 0.2)).ok());
  run(world, 10);  // the blades have not met yet
  return world;
}

World textbook() {
  WorldSettings settings;
  settings.contact = ContactMethod::kTextbook;
  World world(settings);
  EXPECT_TRUE(world.addSceneBody(test::shared(test::ball("one", Vec3(0, 0, 0.11)))).ok());
  EXPECT_TRUE(world.addSceneBody(test::shared(test::ball("two", Vec3(0.03, 0.05, 0.3)))).ok());
  run(world, 30);
  return world;
}

World fastAndCaught() {
  WorldSettings settings = test::weightless();
  settings.step_rate = 60;
  World world(settings);
  BodyDef plate = test::defOf(boxMesh(Vec3(0.3, 0.3, 0.01), 4, 4, 1), "plate");
  EXPECT_TRUE(world.addSceneBody(test::shared(plate)).ok());
  auto ball = std::make_shared<PreparedBody>(test::prepared(test::ball("ball", Vec3(0, 0, 0.35))));
  for (Vec3& v : ball->state.velocities) v = Vec3(0.2, 0.1, -25.0);
  EXPECT_TRUE(world.addSceneBody(ball).ok());
  run(world, 1);
  return world;
}

std::vector<Case> cases() {
  std::vector<Case> all;
  all.push_back({"ball", ballThatFalls});
  all.push_back({"pile", pile});
  all.push_back({"pile at rest", pileAtRest, [](World& world, int step) {
                   if (step != 5) return;
                   PushCommand push;
                   push.radius = 0.05;
                   push.position = Vec3(0.1, 0.06, 0.05);
                   EXPECT_TRUE(world.apply(push).ok());
                 }});
  all.push_back({"filled cells", filledCells});
  all.push_back({"filled cells, cut", filledCellsCut});
  all.push_back({"elastic, cut", elasticCut});
  all.push_back({"plastic", plastic, [](World& world, int step) {
                   if (step == 20) EXPECT_TRUE(world.apply(cutThrough(Vec3(0, 0, 0.05), Vec3::UnitX())).ok());
                 }});
  all.push_back({"every tool", everyTool, [](World& world, int step) {
                   if (step == 30) EXPECT_TRUE(world.apply(pickNear(Vec3(0.05, 0, 0.1))).ok());
                   if (step == 40) {
                     RemoveCommand remove;
                     remove.body = "two";
                     (void)world.apply(remove);
                   }
                   if (step == 50) EXPECT_TRUE(world.apply(spawnOf(test::shared(test::ball("three")))).ok());
                 }});
  all.push_back({"textbook", textbook});
  all.push_back({"fast", fastAndCaught, [](World&, int) {}, 30});
  return all;
}

/// As another process would have it: from bytes, in a world that was about something else.
World reloaded(const World& world, int threads = 1) {
  const std::string bytes = encode(*world.capture(), "here");
  auto decoded = decode(bytes);
  EXPECT_TRUE(decoded.ok()) << (decoded.ok() ? "" : decoded.error().detail);
  EXPECT_EQ("here", decoded->origin);
  WorldSettings other;
  other.gravity = Vec3(0, 3, 0);
  other.step_rate = 77;
  other.threads = threads;
  World again(other);
  EXPECT_TRUE(again.addSceneBody(test::shared(test::block("another"))).ok());
  run(again, 3);
  again.restore(*decoded->world);
  return again;
}

std::string bytesWithOneThread(const World& world) { return encode(*reloaded(world, 1).capture()); }

class SavedWorldCase : public testing::TestWithParam<int> {};

TEST_P(SavedWorldCase, GoesOnAsIfItHadNeverBeenAway) {
  const Case c = cases()[static_cast<std::size_t>(GetParam())];
  SCOPED_TRACE(c.name);
  World uninterrupted = c.start(), never_saved = c.start();
  World again = reloaded(uninterrupted, 2);
  ASSERT_EQ(uninterrupted.stateHash(), again.stateHash());
  ASSERT_EQ(never_saved.stateHash(), again.stateHash());
  ASSERT_EQ(uninterrupted.stepCount(), again.stepCount());
  ASSERT_EQ(uninterrupted.simTime(), again.simTime());
  // Threads are the machine's; all else is the same to the last byte.
  ASSERT_TRUE(bytesWithOneThread(uninterrupted) == bytesWithOneThread(again));
  for (int step = 0; step < c.steps; ++step) {
    for (World* world : {&uninterrupted, &never_saved, &again}) c.go_on(*world, step);
    ASSERT_EQ(uninterrupted.stateHash(), again.stateHash()) << "before step " << step;
    for (World* world : {&uninterrupted, &never_saved, &again}) world->step();
    ASSERT_EQ(uninterrupted.stateHash(), again.stateHash()) << "after step " << step;
    ASSERT_EQ(never_saved.stateHash(), again.stateHash()) << "after step " << step;
    if (step % 10 == 0) (void)again.snapshot({true, true, true, true});  // looking changes nothing
    if (step == c.steps / 2) {                                           // a second time, in the middle
      World third = reloaded(again);
      again = std::move(third);
    }
  }
  // Surfaces are placed when they are read. Tetrahedra are made anew after a state was loaded, and counted: the only
  // bytes that differ.
  for (World* world : {&uninterrupted, &again}) (void)world->snapshot({true, true, true, true});
  if (c.name != "textbook") EXPECT_TRUE(bytesWithOneThread(uninterrupted) == bytesWithOneThread(again));
}

INSTANTIATE_TEST_SUITE_P(Scenes, SavedWorldCase, testing::Range(0, static_cast<int>(cases().size())));

TEST(SavedWorld, ModelsThatWereSharedAreSharedAgain) {
  World world = pile();
  World again = reloaded(world);
  const WorldSnapshot shot = again.snapshot({});
  ASSERT_EQ(48u, shot.bodies.size());
  for (const BodySnapshot& body : shot.bodies) EXPECT_EQ(shot.bodies[0].model, body.model);
}

// Of bodies that share it, before and after they were cut.
World withImages(std::uint8_t blue) {
  World world(test::weightless());
  Look look;
  look.noise = Noise::kImage;
  look.image = *Image::make(40, 30, test::ramp(40, 30, blue));
  for (int k = 0; k < 6; ++k) {
    BodyDef def = test::ball("ball_" + std::to_string(k), Vec3(0.3 * k, 0, 0));
    def.material.appearance.outer = def.material.appearance.inner = look;
    EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  }
  EXPECT_TRUE(world.apply(cutThrough(Vec3(0, 0, 0), Vec3::UnitX())).ok());
  return world;
}

TEST(SavedWorld, ImagesComeAlongOnce) {
  const World world = withImages(7);
  const std::size_t pixels = 40 * 30 * 3;
  World plain(test::weightless());
  for (int k = 0; k < 6; ++k)
    ASSERT_TRUE(plain.addSceneBody(test::shared(test::ball("ball_" + std::to_string(k), Vec3(0.3 * k, 0, 0)))).ok());
  ASSERT_TRUE(plain.apply(cutThrough(Vec3(0, 0, 0), Vec3::UnitX())).ok());
  EXPECT_LT(encode(*world.capture()).size(), encode(*plain.capture()).size() + pixels + 1000);
  World again = reloaded(world, 1);
  EXPECT_EQ(world.stateHash(), again.stateHash());
  again.reset();  // the scene's own bodies, too
  const Image* first = nullptr;
  for (const BodySnapshot& body : again.snapshot({}).bodies)
    for (const Look& look : {body.material.appearance.outer, body.material.appearance.inner}) {
      ASSERT_TRUE(look.image != nullptr) << body.name;
      EXPECT_EQ(test::ramp(40, 30, 7), look.image->rgb());
      EXPECT_TRUE(first == nullptr || first == look.image.get());
      first = look.image.get();
    }
  EXPECT_NE(world.stateHash(), withImages(8).stateHash());
}

TEST(SavedWorld, ResetGoesToTheStartOfTheSceneThatWasSaved) {
  World world = elasticCut();
  World again = reloaded(world);
  world.reset();
  again.reset();
  EXPECT_EQ("block", again.snapshot({}).bodies.at(0).name);
  EXPECT_EQ(world.stateHash(), again.stateHash());
  run(world, 20);
  run(again, 20);
  EXPECT_EQ(world.stateHash(), again.stateHash());
}

TEST(SavedWorld, AfterAResetItGoesTheSameWay) {
  for (World (*make)() : {&pile, &elasticCut, &everyTool}) {
    World world = make();
    std::uint64_t hashes[2];
    for (std::uint64_t& hash : hashes) {
      world.reset();
      run(world, 60);
      hash = world.stateHash();
    }
    EXPECT_EQ(hashes[0], hashes[1]);
  }
}

TEST(SavedWorld, SettingsAndObstaclesComeAlong) {
  World world = everyTool();
  World again = reloaded(world, 3);
  EXPECT_EQ(world.settings().gravity, again.settings().gravity);
  EXPECT_EQ(world.settings().step_rate, again.settings().step_rate);
  EXPECT_EQ(3, again.settings().threads);
  const WorldSnapshot shot = again.snapshot({});
  ASSERT_EQ(1u, shot.obstacles.size());
  EXPECT_EQ("table", shot.obstacles[0]->name);
}

TEST(SavedWorld, WhoWaitedForBladesIsAnswered) {
  World world = ballThatFalls();
  const auto saved = world.capture();
  const auto started = replyOf<CutStarted>(world.apply(cutThrough(Vec3(0, 0, 0.1), Vec3::UnitX(), 1.0)));
  world.restore(*saved);
  const auto finished = world.finishedCut(started.ticket);
  ASSERT_TRUE(finished.has_value());
  EXPECT_FALSE(finished->ok());
  EXPECT_NE(std::string::npos, finished->error().detail.find("loaded"));
}

TEST(SavedWorld, NamesAndPicksAreNotUsedAgain) {
  World world = elasticCut();
  World again = reloaded(world);
  EXPECT_FALSE(again.apply(spawnOf(test::shared(test::ball("block")))).ok());
  EXPECT_EQ(2u, replyOf<PickReply>(again.apply(pickNear(Vec3(0, 0, 0.1)))).pick);
  // What could be undone is left out.
  EXPECT_FALSE(again.apply(UndoCutCommand{}).ok());
}

TEST(SavedWorld, ANewRunBegins) {
  World world = ballThatFalls();
  const std::uint32_t run_before = world.snapshot({}).run;
  world.restore(*world.capture());
  EXPECT_GT(world.snapshot({}).run, run_before);
}

// --- what is refused

std::string bytesOf(World world) { return encode(*world.capture(), "origin"); }

void expectRefused(const std::string& bytes, const std::string& word) {
  const auto decoded = decode(bytes);
  ASSERT_FALSE(decoded.ok());
  EXPECT_EQ(ErrorCode::kUnreadable, decoded.error().code);
  EXPECT_NE(std::string::npos, decoded.error().detail.find(word)) << decoded.error().detail;
}

/// With a checksum that is right for what the file says.
std::string sealed(std::string bytes) {
  const auto sum = static_cast<std::uint32_t>(crc32_z(crc32_z(0, nullptr, 0),
                                                      reinterpret_cast<const Bytef*>(bytes.data()) + kStateHeaderBytes,
                                                      bytes.size() - kStateHeaderBytes));
  std::memcpy(bytes.data() + 12, &sum, sizeof sum);
  const std::uint64_t length = bytes.size() - kStateHeaderBytes;
  std::memcpy(bytes.data() + 16, &length, sizeof length);
  return bytes;
}

/// A state that is small enough for every byte and every bit of it to be tried.
World oneSmallBox() {
  World world{WorldSettings()};
  const test::TexturedCube cube(0.05, 1);
  BodyDef def = test::defOf(cube.mesh, "box");
  def.texture = cube.map();
  def.spacing = 0.05;
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  run(world, 3);
  return world;
}

TEST(DamagedState, OfAnyLengthButTheRightOne) {
  const std::string bytes = bytesOf(oneSmallBox());
  for (std::size_t length = 0; length < bytes.size(); ++length)
    expectRefused(bytes.substr(0, length), length < kStateHeaderBytes ? "no state that can be read" : "cut off");
  expectRefused(bytes + "x", "something follows");
}

// The header alone refuses the lengths above: here it and the checksum are right for what is there.
TEST(DamagedState, CutOffAnywhereByWhoSealedItAgain) {
  const std::string bytes = bytesOf(oneSmallBox());
  for (std::size_t length = kStateHeaderBytes; length < bytes.size(); ++length)
    expectRefused(sealed(bytes.substr(0, length)), "no state that can be read");
  EXPECT_TRUE(decode(sealed(bytes)).ok());
}

TEST(DamagedState, WithAnyBitTurned) {
  std::string bytes = bytesOf(oneSmallBox());
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << bit % 8));
    expectRefused(bytes, "no state that can be read");
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << bit % 8));
  }
  EXPECT_TRUE(decode(bytes).ok());
}

TEST(DamagedState, ItsHeaderAloneSaysHowLongItIs) {
  const std::string bytes = bytesOf(oneSmallBox());
  const std::string header = bytes.substr(0, kStateHeaderBytes);
  EXPECT_TRUE(checkStateHeader(header, bytes.size()).ok());
  for (const std::uint64_t size :
       {std::uint64_t{0}, std::uint64_t{23}, std::uint64_t{24}, std::uint64_t{bytes.size() - 1},
        std::uint64_t{bytes.size() + 1}, std::uint64_t{1} << 30})
    EXPECT_FALSE(checkStateHeader(header, size).ok()) << size;
  EXPECT_FALSE(checkStateHeader(header.substr(0, 23), bytes.size()).ok());
  EXPECT_FALSE(checkStateHeader("", 0).ok());
}

TEST(DamagedState, OfAnotherKindOrVersion) {
  expectRefused("", "MLSSTATE");
  expectRefused("solid ball\nfacet normal 0 0 1\n", "MLSSTATE");
  std::string bytes = bytesOf(ballThatFalls());
  bytes[8] = 9;
  expectRefused(bytes, "version 9; accepted: 33");
}

// The text at the start is of a length that is known to lie where it lies.
TEST(DamagedState, ThatClaimsMoreThanItHas) {
  std::string bytes = bytesOf(ballThatFalls());
  for (const std::uint64_t claimed : {std::uint64_t{1} << 32, ~std::uint64_t{0}, std::uint64_t{1} << 62}) {
    std::memcpy(bytes.data() + kStateHeaderBytes, &claimed, sizeof claimed);
    expectRefused(sealed(bytes), "it claims " + std::to_string(claimed));
  }
}

TEST(DamagedState, WithTextureCoordinatesOfNoSurface) {
  const std::string bytes = bytesOf(oneSmallBox());
  const test::TexturedCube cube(0.05, 1);
  const std::string points(reinterpret_cast<const char*>(cube.points.data()),
                           sizeof(TexturePoint) * cube.points.size());
  const std::size_t at = bytes.find(points), triangles = at - 16 - sizeof(Triangle) * cube.mesh.triangles.size();
  ASSERT_NE(std::string::npos, at);
  const auto forged = [&](std::size_t place, auto value) {
    std::string other = bytes;
    std::memcpy(&other[place], &value, sizeof value);
    return sealed(other);
  };
  expectRefused(forged(at, std::numeric_limits<float>::quiet_NaN()), "one is not finite");
  expectRefused(forged(triangles, Index{8}), "not there");
  expectRefused(forged(triangles, kNoIndex), "not there");
  expectRefused(forged(triangles - 16, 1e300), "a number is");
  expectRefused(forged(at - 8, std::uint64_t{35}), "no state that can be read");
}

// Somebody forged it, checksum and all, with numbers that no world has: refused, or a world that steps within seconds
// of the processor. Places are chosen where a number lies.
TEST(DamagedState, ForgedAtRandom) {
  const char* text = std::getenv("MESHLESS_SURGERY_FORGED");
  const int seeds = text ? std::atoi(text) : 20;
  ASSERT_GT(seeds, 0);
  int refused = 0, read = 0;
  int scene = 0;
  for (World (*make)() : {elasticCut, filledCells, filledCellsCut, everyTool, plastic, oneSmallBox}) {
    ++scene;
    const std::string bytes = encode(*make().capture());
    for (int seed = 1; seed <= seeds; ++seed)
      for (int i = 0; i < 3; ++i) {
        const test::TimeLimit limit("scene " + std::to_string(scene) + ", seed " + std::to_string(seed) + ", file " +
                                    std::to_string(i));
        test::Random random(static_cast<unsigned>(3 * seed + i));
        std::string forged = bytes;
        for (int changes = random.integer(1, 3); changes > 0; --changes)
          test::forgeNumber(random, forged, kStateHeaderBytes);
        const auto decoded = decode(sealed(forged));
        if (!decoded.ok()) {
          EXPECT_FALSE(decoded.error().detail.empty());
          ++refused;
          continue;
        }
        ++read;
        World again{WorldSettings()};
        again.restore(*decoded->world);
        run(again, 3);
        (void)again.snapshot({true, true, true, true});
      }
  }
  EXPECT_GT(refused, 0);
  EXPECT_GT(read, 0);
}

}  // namespace saved_world_test
}  // namespace meshless
