// Strokes that touch earlier ones: a surgeon deepens, lengthens and crosses what is open already, in tissue that lies
// on itself there. None is refused.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/world/world.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"

namespace meshless {
namespace strokes_test {

constexpr double kAbove = 0.003;  // [m] of a blade's edge over the surface

class Theatre {
 public:
  explicit Theatre(const BodyDef& def, const WorldSettings& settings) : world(settings) {
    EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  }

  void step(int steps) {
    for (int n = 0; n < steps; ++n) world.step();
  }

  /// The largest piece.
  BodySnapshot body() {
    const WorldSnapshot shot = world.snapshot({true, true, true});
    return *std::max_element(shot.bodies.begin(), shot.bodies.end(), [](const BodySnapshot& a, const BodySnapshot& b) {
      return a.model->rest_volume < b.model->rest_volume;
    });
  }

  struct Sum {
    double mass = 0.0, rest = 0.0, volume = 0.0;
  };
  Sum sum() {
    Sum sum;
    const WorldSnapshot shot = world.snapshot({true, false, true});
    for (const BodySnapshot& body : shot.bodies) {
      sum.mass += body.model->mass;
      sum.rest += body.model->rest_volume;
      sum.volume += body.measures.volume;
      EXPECT_GT(body.measures.volume, 0.0) << body.name;
    }
    return sum;
  }

  /// From a to b [m] on the surface, into the tissue. Whether it was made or met nothing that is not open; no tissue is
  /// lost.
  bool stroke(const Vec3& a, const Vec3& b, const Vec3& into, double depth) {
    InciseCommand incise;
    incise.blade.x_axis = (b - a).normalized();
    incise.blade.y_axis = -(into - into.dot(incise.blade.x_axis) * incise.blade.x_axis).normalized();
    incise.blade.origin = a + kAbove * incise.blade.y_axis;
    incise.blade.length = (b - a).norm();
    incise.blade.depth = depth + kAbove;
    const Sum before = sum();
    const Result<Reply> reply = world.apply(incise);
    const Sum after = sum();
    EXPECT_NEAR(after.mass, before.mass, 1e-12 * before.mass);
    EXPECT_NEAR(after.rest, before.rest, 1e-9 * before.rest);
    EXPECT_NEAR(after.volume, before.volume, 5e-4 * before.volume);
    made += reply.ok();
    missed += !reply.ok() && reply.error().code == ErrorCode::kMissed;
    if (!reply.ok() && reply.error().code != ErrorCode::kMissed) why = reply.error().detail;
    return reply.ok() || reply.error().code == ErrorCode::kMissed;
  }

  World world;
  int made = 0, missed = 0;
  std::string why;  // the last refusal
};

/// The slab of the scene `incision`, settled.
Theatre skin() {
  BodyDef def = test::defOf(boxMesh(Vec3(0.16, 0.12, 0.02), 32, 24, 4), "skin");
  def.pose.translation = Vec3(0, 0, 0.05);
  def.spacing = 0.02 / 3.0;
  def.material.youngs_modulus = 15000.0;
  def.material.poissons_ratio = 0.4;
  def.material.density = 1090.0;
  def.material.damping = 20.0;
  for (const double side : {-1.0, 1.0}) {
    def.fixed.emplace_back(Vec3(side * 0.0765 - 0.0045, -0.061, 0.039), Vec3(side * 0.0765 + 0.0045, 0.061, 0.061));
    def.fixed.emplace_back(Vec3(-0.081, side * 0.0565 - 0.0045, 0.039), Vec3(0.081, side * 0.0565 + 0.0045, 0.061));
  }
  WorldSettings settings;
  settings.ground = 0.0;
  settings.step_rate = 120;
  settings.substeps = 1;
  Theatre theatre(def, settings);
  theatre.step(120);
  return theatre;
}

/// Straight down into the skin as it lies.
bool strokeOfSkin(Theatre& theatre, const Vec2& a, const Vec2& b, double depth) {
  const BodySnapshot body = theatre.body();
  const auto onSkin = [&](const Vec2& at) {
    double height = -1.0;
    for (const Vec3& p : body.surface)
      if ((p.head<2>() - at).norm() < 0.006) height = std::max(height, p.z());
    return Vec3(at.x(), at.y(), height);
  };
  const bool done = theatre.stroke(onSkin(a), onSkin(b), -Vec3::UnitZ(), depth);
  theatre.step(20);
  return done;
}

TEST(Strokes, ThatASurgeonMakesAreAllMade) {
  Theatre theatre = skin();
  const auto expectMade = [&](const std::string& what, const Vec2& a, const Vec2& b, double depth) {
    EXPECT_TRUE(strokeOfSkin(theatre, a, b, depth)) << what << ": " << theatre.why;
  };
  expectMade("first", {-0.02, 0}, {0.02, 0}, 0.008);
  expectMade("deeper", {-0.02, 0}, {0.02, 0}, 0.015);
  expectMade("over its end", {0.018, 0}, {0.04, 0}, 0.008);
  expectMade("touching its other end", {-0.04, 0}, {-0.0199, 0}, 0.008);
  expectMade("across", {0, -0.02}, {0, 0.02}, 0.008);
  expectMade("askew", {-0.015, -0.015}, {0.015, 0.015}, 0.01);
  expectMade("0.3 mm beside", {-0.02, 0.0003}, {0.02, 0.0003}, 0.008);
  const std::array<Vec2, 4> corners{Vec2(-0.05, 0.015), Vec2(-0.02, 0.015), Vec2(-0.02, 0.045), Vec2(-0.05, 0.045)};
  for (std::size_t k = 0; k < 4; ++k)
    expectMade("side " + std::to_string(k) + " of a square", corners[k], corners[(k + 1) % 4], 0.006);
  for (int k = 0; k < 8; ++k)
    expectMade("ray " + std::to_string(k) + " of a star", {0.03, -0.03},
               Vec2(0.03 + 0.015 * std::cos(0.8 * k), -0.03 + 0.015 * std::sin(0.8 * k)), 0.006);
  EXPECT_GE(theatre.made, 17);
  // Three strokes through one point leave a needle there: it is no body.
  EXPECT_EQ(theatre.world.bodyCount(), 1u);
  EXPECT_EQ(theatre.body().name, "skin");
}

// As a scalpel that moves on makes it.
TEST(Strokes, OneAfterAnotherMakeALine) {
  int refused = 0, all = 0;
  for (const double y : {0.0, 0.0013})
    for (const auto& [pieces, overlap] : {std::pair(8, 0.001), std::pair(16, 0.002)}) {
      Theatre theatre = skin();
      for (int k = 0; k < pieces; ++k) {
        const double from = -0.04 + 0.08 * k / pieces, to = from + 0.08 / pieces;
        refused += !strokeOfSkin(theatre, {from - overlap, y}, {to, y}, 0.013);
        ++all;
      }
      EXPECT_EQ(theatre.world.bodyCount(), 1u);
    }
  // Without wounds that are closed for the blade every third is. Where the sides of an open one were split apart, some
  // are.
  EXPECT_LE(refused, all / 20);
}

TEST(Strokes, AllOverASlabAreNotRefused) {
  Random random(911);
  Theatre theatre = skin();
  for (int k = 0; k < 30; ++k) {
    const double length = random.between(0.002, 0.03), angle = random.between(0.0, 2.0 * M_PI);
    const Vec2 a(random.between(-0.06, 0.06), random.between(-0.04, 0.04));
    EXPECT_TRUE(
        strokeOfSkin(theatre, a, a + length * Vec2(std::cos(angle), std::sin(angle)), random.between(0.002, 0.018)))
        << "stroke " << k << ": " << theatre.why;
  }
  EXPECT_GE(theatre.made, 25);
}

TEST(Strokes, DeepIntoAnOrganInItsOwnWeightAreNotRefused) {
  for (std::uint64_t seed = 41; seed <= 43; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    BodyDef def = test::defOf(*randomOrgan(seed, 0, random.between(0.08, 0.2), 2000), "organ");
    def.pose.translation.z() = 0.12;
    def.material.youngs_modulus = 3000.0;
    def.material.damping = 20.0;
    WorldSettings settings;
    settings.ground = 0.0;
    Theatre theatre(def, settings);
    theatre.step(60);
    for (int k = 0; k < 8; ++k) {
      const BodySnapshot body = theatre.body();
      const Vec3 a = body.surface[static_cast<std::size_t>(random.whole(0, static_cast<int>(body.surface.size()) - 1))];
      const Vec3 into = body.measures.centre_of_mass - a;
      const Vec3 along = into.cross(random.inCube(1.0)).normalized();
      EXPECT_TRUE(theatre.stroke(a, a + random.between(0.01, 0.06) * along, into, random.between(0.004, 0.05)))
          << "stroke " << k << ": " << theatre.why;
      theatre.step(3);
    }
  }
}

// Between the sides of a spread wound there is air.
TEST(Strokes, InTheAirOfASpreadWoundCutNeitherSide) {
  Theatre theatre = skin();
  ASSERT_TRUE(strokeOfSkin(theatre, {-0.03, 0}, {0.03, 0}, 0.012));
  for (const double side : {-1.0, 1.0}) {
    PickCommand pick;
    pick.point = Vec3(0, side * 0.006, 0.06);
    pick.max_distance = 0.1;
    const auto picked = test::replyOf<PickReply>(theatre.world.apply(pick));
    LockCommand lock;
    lock.pick = picked.pick;
    lock.target = picked.position + Vec3(0, side * 0.012, 0);
    EXPECT_TRUE(theatre.world.apply(lock).ok());
  }
  theatre.step(240);
  // How wide it is.
  const BodySnapshot body = theatre.body();
  double left = -1.0, right = 1.0;
  for (const Triangle& t : body.model->surface.triangles) {
    if (!isCutPatch(body.model->surface.patchOf(static_cast<std::size_t>(&t - body.model->surface.triangles.data()))))
      continue;
    for (const Index v : t) {
      const Vec3& p = body.surface[v];
      if (std::abs(p.x()) > 0.003 || p.z() < 0.055) continue;
      (p.y() < 0.0 ? left : right) = p.y() < 0.0 ? std::max(left, p.y()) : std::min(right, p.y());
    }
  }
  ASSERT_GT(right - left, 0.006);
  const std::size_t triangles = body.model->surface.triangles.size();
  for (const double share : {0.25, 0.5, 0.75}) {
    const double y = left + share * (right - left);
    EXPECT_TRUE(theatre.stroke(Vec3(-0.003, y, 0.06), Vec3(0.003, y, 0.06), -Vec3::UnitZ(), 0.002)) << theatre.why;
    EXPECT_EQ(theatre.body().model->surface.triangles.size(), triangles) << "at " << share << " of the way across";
  }
}

}  // namespace strokes_test
}  // namespace meshless
