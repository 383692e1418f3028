// The force of the push sphere, where its contact is narrower than a cell as well.
#include <cmath>

#include "meshless_surgery/base/random.h"
#include "support/bodies.h"

namespace meshless {
namespace indentation_test {

using test::replyOf;

constexpr double kYoungs = 5000.0, kPoisson = 0.45;

/// [N] on a slippery sphere, a depth [m] in a half space (Hertz 1881).
double hertz(double radius, double depth) {
  return 4.0 / 3.0 * kYoungs / (1.0 - kPoisson * kPoisson) * std::sqrt(radius * depth) * depth;
}

Material tissue(double youngs = kYoungs, double poisson = kPoisson) {
  Material material;
  material.youngs_modulus = youngs;
  material.poissons_ratio = poisson;
  material.density = 1000.0;
  material.friction = 0.0;
  material.damping = 80.0;
  return material;
}

/// A block of 100 x 100 x 50 mm that stands on what holds it, in a world that is turned.
struct Pad {
  /// within: [Pa] of all of it, as a region of a body of that material.
  Pad(double spacing, double edge, const Quat& turn, const Material& material = tissue(), double within = 0.0)
      : turned(turn), world(settings()) {
    BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.1, 0.05), edge), "pad");
    def.pose.rotation = turn;
    def.spacing = spacing;
    def.material = material;
    if (within > 0.0) {
      TissueRegion all{Region::sphere(Vec3::Zero(), 1.0), def.material};
      all.material.youngs_modulus = within;
      def.regions.push_back(all);
    }
    def.fixed.push_back(HeldRegion(Region(Vec3(-1, -1, -1), Vec3(1, 1, -0.0249)), false));
    const auto body = test::shared(def);
    cell = body->model->spacing;
    EXPECT_TRUE(world.addSceneBody(body).ok());
  }

  static WorldSettings settings() {
    WorldSettings settings;
    settings.ground.reset();
    settings.gravity.setZero();
    settings.sleep = false;
    return settings;
  }

  void lead(double radius, const Vec3& tip, double speed) {
    PushCommand push;
    push.radius = radius;
    push.position = turned * Vec3(tip.x(), tip.y(), 0.025 + radius + tip.z());
    push.speed = speed;
    replyOf<Done>(world.apply(push));
  }

  void run(double seconds) {
    for (int n = 0; n < seconds * world.settings().step_rate; ++n) world.step();
  }

  /// [N] out of the block's top, and across.
  Vec3 force() const { return turned.conjugate() * world.push().force; }

  Quat turned;
  World world;
  double cell = 0.0;
};

// Where the surface's vertices and the cells lie under it does not matter, nor does how they are turned. A block that
// ends adds up to 2 % for 5 mm, and up to 9 % for 25 mm (finite elements of a cylinder).
TEST(Indentation, GrowsWithHertzsPowerWhereverTheSpherePresses) {
  Random random(20261202);
  for (int k = 0; k < 8; ++k) {
    const double spacing = k % 2 == 0 ? 0.0 : random.between(0.006, 0.011);
    const double edge = random.between(0.004, 0.015);
    Pad pad(spacing, edge, k % 4 < 2 ? Quat::Identity() : random.rotation());
    const double radius = k < 4 ? 0.005 : random.between(0.005, 0.02);
    const Vec3 at(random.between(-0.01, 0.01), random.between(-0.01, 0.01), 0.0);
    pad.lead(radius, at + Vec3(0, 0, 0.0005), 0.0);
    for (const double depth : {0.0005, 0.001, 0.002}) {
      pad.lead(radius, at - Vec3(0, 0, depth), 0.01);
      pad.run(0.6);
      const double force = pad.force().z(), expected = (1.0 + 3.0 * radius) * hertz(radius, depth);
      EXPECT_NEAR(force / expected, 1.0, 0.15) << 1e3 * radius << " mm, " << 1e3 * depth << " mm deep, spacing "
                                               << pad.cell << ", edge " << edge << ", at " << at.transpose();
    }
  }
}

// A probe that slides feels the tissue and not its triangles.
TEST(Indentation, IsSteadyWhileTheSphereSlides) {
  for (const double radius : {0.005, 0.025}) {
    Pad pad(0.0, 0.005, Quat::Identity());
    pad.lead(radius, Vec3(-0.012, 0.0021, 0.0005), 0.0);
    pad.lead(radius, Vec3(-0.012, 0.0021, -0.001), 0.01);
    pad.run(0.6);
    pad.lead(radius, Vec3(0.012, 0.0061, -0.001), 0.02);
    pad.run(0.2);
    double least = 1e9, most = 0.0, across = 0.0;
    for (int n = 0; n < 110; ++n) {
      pad.world.step();
      const Vec3 force = pad.force();
      least = std::min(least, force.z());
      most = std::max(most, force.z());
      across = std::max(across, force.head<2>().norm());
    }
    EXPECT_LT(most / least, 1.08) << radius;
    EXPECT_LT(across / least, 0.1) << radius;
  }
}

// What it presses on counts, and not what the rest of the body is made of.
TEST(Indentation, IsThatOfTheRegionUnderIt) {
  double force[2];
  for (const int within : {0, 1}) {
    Pad pad(0.0, 0.0125, Quat::Identity(), tissue(within ? 0.1 * kYoungs : kYoungs), within ? kYoungs : 0.0);
    pad.lead(0.01, Vec3(0.002, 0.001, 0.0005), 0.0);
    pad.lead(0.01, Vec3(0.002, 0.001, -0.001), 0.01);
    pad.run(0.6);
    force[within] = pad.force().z();
  }
  EXPECT_NEAR(force[1] / force[0], 1.0, 0.01);
}

// A press that is held relaxes as the tissue does, where its contact is narrower than a cell too.
TEST(Indentation, RelaxesAsTheTissueDoes) {
  const double left = 0.5, shear = left * kYoungs / (2.0 * (1.0 + kPoisson)),
               bulk = kYoungs / (3.0 * (1.0 - 2.0 * kPoisson));
  const double relaxed = 9.0 * bulk * shear / (3.0 * bulk + shear);
  double force[2];
  for (const int relaxes : {0, 1}) {
    Material material = relaxes ? tissue() : tissue(relaxed, 0.5 * relaxed / shear - 1.0);
    if (relaxes) material.relaxation = {{1.0 - left, 0.1}};
    Pad pad(0.0, 0.0125, Quat::Identity(), material);
    pad.lead(0.01, Vec3(0.002, 0.001, 0.0005), 0.0);
    pad.lead(0.01, Vec3(0.002, 0.001, -0.001), 0.01);
    pad.run(1.5);
    force[relaxes] = pad.force().z();
  }
  EXPECT_NEAR(force[1] / force[0], 1.0, 0.06);  // what bends within cells does not relax
}

// Ten times stiffer tissue presses ten times harder, and a sphere that is led away is let go of.
TEST(Indentation, IsThatOfTheMaterialAndEndsWithTheTouch) {
  double force[2];
  for (const int stiff : {0, 1}) {
    Pad pad(0.0, 0.0125, Quat::Identity(), tissue(stiff ? 10.0 * kYoungs : kYoungs));
    pad.lead(0.01, Vec3(0.002, 0.001, 0.0005), 0.0);
    pad.lead(0.01, Vec3(0.002, 0.001, -0.001), 0.01);
    pad.run(0.6);
    force[stiff] = pad.force().z();
    pad.lead(0.01, Vec3(0.002, 0.001, 0.001), 0.05);
    pad.run(0.5);
    EXPECT_EQ(pad.force().norm(), 0.0);
  }
  EXPECT_NEAR(force[1] / force[0], 10.0, 0.5);
}

}  // namespace indentation_test
}  // namespace meshless
