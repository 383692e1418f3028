// Each law finds the fault that it is for, planted into what is sound, and finds nothing in what is.
#include <cmath>
#include <limits>

#include "drive/crossing_law.h"
#include "drive/depth_law.h"
#include "drive/energy_law.h"
#include "drive/finite_law.h"
#include "drive/fold_law.h"
#include "drive/mass_law.h"
#include "drive/momentum_law.h"
#include "drive/rest_law.h"
#include "drive/volume_law.h"
#include "seen_support.h"
#include "support/bodies.h"

namespace meshless {
namespace {

using test::bodyOf;
using test::fineBox;
using test::sound;

std::shared_ptr<const ObstacleDef> plate() {
  ObstacleDef def;
  def.name = "plate";
  def.mesh = boxMesh(Vec3(1.0, 1.0, 0.02), 2, 2, 1);
  return std::make_shared<const ObstacleDef>(def);
}

TEST(Laws, HoldForWhatIsSound) {
  const Seen seen = sound();
  for (const Finding& finding :
       {finiteLaw(seen), massLaw(booksOf(seen), seen), cutMomentumLaw(seen, seen), volumeLaw(volumesOf(seen), {}),
        depthLaw(seen), crossingLaw(seen), foldLaw(seen), restLaw(seen), asleepLaw(seen)})
    EXPECT_FALSE(finding.broken()) << finding.text;
}

TEST(FiniteLaw, FindsWhatIsNotFiniteOrFarAway) {
  for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 11.0}) {
    Seen seen = sound();
    seen.bodies[1].surface.vertices[7].y() = wrong;
    EXPECT_TRUE(finiteLaw(seen).broken()) << wrong;
  }
  Seen particle = sound();
  particle.bodies[0].particles_finite = false;
  EXPECT_TRUE(finiteLaw(particle).broken());
  Seen mended = sound();
  mended.mended = 1;
  EXPECT_TRUE(finiteLaw(mended).broken());
}

TEST(MassLaw, FindsWhatIsLost) {
  const MassBooks start = booksOf(sound());
  Seen cut = sound();  // organ_1 in two
  cut.bodies[0].name = "organ_1.1";
  cut.bodies[0].mass *= 0.25;
  cut.bodies[0].rest_volume *= 0.25;
  SeenBody other = cut.bodies[0];
  other.name = "organ_1.2.1";
  other.mass *= 3.0;
  other.rest_volume *= 3.0;
  cut.bodies.push_back(other);
  EXPECT_FALSE(massLaw(start, cut).broken()) << massLaw(start, cut).text;

  Seen lighter = cut;
  lighter.bodies[2].mass *= 1.0 - 1e-6;
  EXPECT_TRUE(massLaw(start, lighter).broken());
  Seen thinner = cut;
  thinner.bodies[2].rest_volume *= 1.0 + 2e-3;
  EXPECT_TRUE(massLaw(start, thinner).broken());
  Seen gone = cut;
  gone.bodies.pop_back();
  EXPECT_TRUE(massLaw(start, gone).broken());
  Seen another = cut;
  another.bodies.push_back(bodyOf("stranger", fineBox()));
  EXPECT_TRUE(massLaw(start, another).broken());
}

/// Each as it moves with a velocity and turns with a spin about its centre.
Seen moving(const Vec3& velocity, const Vec3& spin) {
  Seen seen = sound();
  for (SeenBody& body : seen.bodies) {
    body.linear_momentum = body.mass * velocity;
    body.angular_momentum = body.mass * 0.01 / 6.0 * spin;  // a cube
    body.kinetic_energy = 0.5 * body.mass * velocity.squaredNorm() + 0.5 * body.angular_momentum.dot(spin);
  }
  return seen;
}

TEST(MomentumLaw, FindsWhatABladeGives) {
  const Seen before = moving(Vec3(0.3, -0.2, 0.1), Vec3(1.0, 2.0, 0.5));
  EXPECT_FALSE(cutMomentumLaw(before, before).broken());
  Seen pushed = before;
  pushed.bodies[0].linear_momentum *= 1.0 + 1e-4;
  EXPECT_TRUE(cutMomentumLaw(before, pushed).broken());
  Seen spun = before;
  spun.bodies[1].angular_momentum *= 1.0 + 1e-3;
  EXPECT_TRUE(cutMomentumLaw(before, spun).broken());
  // One gives what another takes.
  Seen handed = before;
  handed.bodies[0].linear_momentum.z() += 0.01;
  handed.bodies[1].linear_momentum.z() -= 0.01;
  EXPECT_FALSE(cutMomentumLaw(before, handed).broken());
}

TEST(MomentumLaw, FindsWhatAFallDoesNotGive) {
  const Vec3 start(0.3, -0.2, 0.1), g(0, 0, -9.81);
  const double seconds = 0.1;
  Seen before = moving(start, Vec3(1, 0, 2)), after = moving(start + seconds * g, Vec3(1, 0, 2));
  after.time = seconds;
  EXPECT_FALSE(freeFallLaw(before, after).broken()) << freeFallLaw(before, after).text;
  Seen braked = after;
  for (SeenBody& body : braked.bodies) body.linear_momentum *= 0.99;
  EXPECT_TRUE(freeFallLaw(before, braked).broken());
  Seen stopped = after;
  for (SeenBody& body : stopped.bodies) body.angular_momentum *= 0.5;
  EXPECT_TRUE(freeFallLaw(before, stopped).broken());
}

TEST(MomentumLaw, SaysWhatFallsFreely) {
  Seen seen = moving(Vec3::Zero(), Vec3::Zero());
  EXPECT_FALSE(fallsFreely(seen, 0.1));  // on the ground
  seen.ground = -1.0;
  EXPECT_TRUE(fallsFreely(seen, 0.1));
  EXPECT_FALSE(fallsFreely(seen, 1.0));  // until then it gets there
  seen.bodies[0].handled = true;
  EXPECT_FALSE(fallsFreely(seen, 0.1));
  seen.bodies[0].handled = false;
  seen.bodies[1].fixed = true;
  EXPECT_FALSE(fallsFreely(seen, 0.1));
  seen.bodies[1].fixed = false;
  seen.obstacles.push_back(plate());
  EXPECT_FALSE(fallsFreely(seen, 0.1));
}

TEST(VolumeLaw, FindsASqueezedPiece) {
  Seen seen = sound();
  for (Vec3& p : seen.bodies[1].surface.vertices) p.x() *= 0.88;
  const Finding found = volumeLaw(volumesOf(seen), {});
  EXPECT_TRUE(found.broken());
  EXPECT_NE(found.text.find("organ_2"), std::string::npos) << found.text;
  seen.bodies[1].handled = true;  // by a hand that lets go later
  EXPECT_FALSE(volumeLaw(volumesOf(seen), {}).broken());
  Seen soft = sound();
  for (Vec3& p : soft.bodies[1].surface.vertices) p.x() *= 0.88;
  soft.gravity = Vec3(0, 0, -9.81);
  const SeenBody& body = soft.bodies[1];
  soft.bodies[1].compressibility = 0.05 / (body.mass / body.rest_volume * 9.81 * body.diagonal);
  EXPECT_FALSE(volumeLaw(volumesOf(soft), {}).broken()) << "its weight may press out so much";
  Seen larger = sound();
  for (Vec3& p : larger.bodies[1].surface.vertices) p.x() *= 1.12;
  EXPECT_TRUE(volumeLaw(volumesOf(larger), {}).broken());
  Seen inverted = sound();
  for (Vec3& p : inverted.bodies[1].surface.vertices) p.x() *= -1.0;
  EXPECT_TRUE(volumeLaw(volumesOf(inverted), {}).broken());
}

TEST(VolumeLaw, HoldsAppearanceMaterialsToWhatTheyDoUncut) {
  Seen uncut = sound();
  uncut.bodies[1].elastic = false;
  for (Vec3& p : uncut.bodies[1].surface.vertices) p.x() *= 0.7;
  VolumeBands bands;
  widenBands(volumesOf(uncut), bands);
  Seen piece = uncut;
  piece.bodies[1].name = "organ_2.1.3";
  EXPECT_FALSE(volumeLaw(volumesOf(piece), bands).broken()) << volumeLaw(volumesOf(piece), bands).text;
  for (Vec3& p : piece.bodies[1].surface.vertices) p.x() *= 0.9;
  EXPECT_TRUE(volumeLaw(volumesOf(piece), bands).broken());
}

TEST(DepthLaw, FindsAVertexTwoMillimetresInsideAnother) {
  Seen seen = sound();
  // A corner of the upper box's lower face, and one in its middle, pressed down.
  for (const double x : {-0.05, 0.01}) {
    Seen pressed = seen;
    for (Vec3& p : pressed.bodies[1].surface.vertices)
      if ((p - Vec3(x, 0.01, 0.1)).norm() < 1e-9) p += Vec3(x < 0.0 ? 0.002 : 0.0, 0, -0.002);
    const Finding found = depthLaw(pressed);
    EXPECT_TRUE(found.broken()) << x;
    EXPECT_NEAR(found.score, 0.002 / allowedDepth(seen.bodies[0].diagonal), 1e-6);
  }
  Seen slight = seen;
  for (Vec3& p : slight.bodies[1].surface.vertices) p.z() -= 0.0008;
  EXPECT_FALSE(depthLaw(slight).broken()) << depthLaw(slight).text;
  EXPECT_EQ(allowedDepth(0.05), 1e-3);
  EXPECT_EQ(allowedDepth(0.3), 3e-3);
}

TEST(DepthLaw, FindsWhatIsInTheGroundOrAnObstacle) {
  Seen sunk = sound();
  for (SeenBody& body : sunk.bodies)
    for (Vec3& p : body.surface.vertices) p.z() -= 0.002;
  EXPECT_TRUE(depthLaw(sunk).broken());
  Seen on_plate = sound();
  on_plate.ground = -1.0;
  on_plate.obstacles.push_back(plate());
  EXPECT_TRUE(depthLaw(on_plate).broken());  // 10 mm inside of it
  for (SeenBody& body : on_plate.bodies)
    for (Vec3& p : body.surface.vertices) p.z() += 0.01;
  EXPECT_FALSE(depthLaw(on_plate).broken()) << depthLaw(on_plate).text;
  // A corner of an obstacle in a body that has no vertex in the obstacle.
  Seen spiked = sound();
  ObstacleDef spike;
  spike.name = "spike";
  spike.mesh.vertices = {Vec3(0, 0, 0.01), Vec3(0.004, 0, -0.1), Vec3(-0.002, 0.003, -0.1), Vec3(-0.002, -0.003, -0.1)};
  for (Vec3& p : spike.mesh.vertices) p += Vec3(0.005, 0.0033, 0);
  spike.mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {3, 2, 1}};
  spiked.obstacles.push_back(std::make_shared<const ObstacleDef>(spike));
  EXPECT_GT(signedVolume(spike.mesh), 0.0);
  EXPECT_TRUE(depthLaw(spiked).broken());
}

TEST(CrossingLaw, FindsAnEdgeThroughAFace) {
  // A rod through both boxes: no vertex of a body is inside another one.
  Seen seen = sound();
  TriangleMesh rod = boxMesh(Vec3(0.004, 0.004, 0.5), 1, 1, 1);
  seen.bodies.push_back(bodyOf("rod", rod, Vec3(0.005, 0.0033, 0.3)));
  EXPECT_TRUE(crossingLaw(seen).broken());
  Seen through_obstacle = sound();
  through_obstacle.obstacles.push_back(plate());
  for (SeenBody& body : through_obstacle.bodies)
    for (Vec3& p : body.surface.vertices) p.z() -= 0.004;
  EXPECT_TRUE(crossingLaw(through_obstacle).broken());
}

TEST(CrossingLaw, LetsFacesLieOnEachOther) {
  Seen seen = sound();  // the upper box's lower face is the lower one's upper face
  EXPECT_FALSE(crossingLaw(seen).broken());
  for (std::size_t v = 0; v < seen.bodies[1].surface.vertices.size(); ++v)
    seen.bodies[1].surface.vertices[v].z() += v % 2 ? 2e-5 : -2e-5;
  EXPECT_FALSE(crossingLaw(seen).broken()) << crossingLaw(seen).text;
}

TEST(FoldLaw, FindsAFlippedTriangle) {
  Seen seen = sound();
  // A row of vertices in the middle of a face, past their neighbours: what they drag along lies upside down.
  std::size_t moved = 0;
  for (Vec3& p : seen.bodies[1].surface.vertices)
    if (std::abs(p.x() - 0.01) < 1e-9 && std::abs(p.y()) < 0.02 && std::abs(p.z() - 0.2) < 1e-9)
      p.x() += 0.015, ++moved;
  ASSERT_GT(moved, 1u);
  EXPECT_GE(foldsOf(seen.bodies[1]).of_surface, moved);
  EXPECT_TRUE(foldLaw(seen).broken()) << foldLaw(seen).text;
  EXPECT_FALSE(foldLaw(sound()).broken());
}

TEST(FoldLaw, LetsTissueBend) {
  Seen seen;
  SeenBody slab = bodyOf("slab", boxMesh(Vec3(0.2, 0.05, 0.01), 40, 10, 2));
  const double radius = 0.2 / 3.14159265358979;  // bent by 180 degrees
  for (Vec3& p : slab.surface.vertices) {
    const double angle = p.x() / radius;
    p = Vec3((radius + p.z()) * std::sin(angle), p.y(), (radius + p.z()) * std::cos(angle));
  }
  seen.bodies.push_back(slab);
  EXPECT_FALSE(foldLaw(seen).broken()) << foldLaw(seen).text;
}

// A slab that is creased along x = 0: its surface is, too, and nothing else is.
TEST(FoldLaw, LetsTheSurfaceFoldWhereTheTissueDoes) {
  for (const bool elastic : {true, false}) {
    SCOPED_TRACE(elastic ? "cells" : "clusters");
    BodyDef def = test::defOf(boxMesh(Vec3(0.2, 0.1, 0.03), 0.005), "slab");
    if (elastic)
      def.material.youngs_modulus = 1e4;
    else
      def.clusters.kind = ClusterOptions::Kind::kGrid;
    def.spacing = 0.01;
    const PreparedBody body = test::prepared(def);
    Seen seen;
    seen.bodies.push_back(bodyOf("slab", body.model->surface));
    SeenBody& slab = seen.bodies[0];
    slab.model = body.model;
    const auto creased = [](Points points) {
      for (Vec3& p : points) p = p.x() > 0.0 ? Vec3(-0.3 * p.x(), p.y(), p.z() + 0.95 * p.x()) : p;
      return points;
    };
    slab.particles = body.state.positions;
    slab.surface.vertices = creased(body.state.surface);
    slab.rest = body.state.surface;
    EXPECT_GT(foldsOf(slab).of_surface, 10u) << "flat tissue explains nothing";
    slab.particles = creased(body.state.positions);
    EXPECT_EQ(foldsOf(slab).of_surface, 0u);
    EXPECT_GT(foldsOf(slab).of_tissue, 10u);
  }
}

/// Looks twelve times a second at a piece of which `speed` and `height` tell.
template <class Speed, class Height>
std::vector<AloneLook> looks(const Speed& speed, const Height& height) {
  std::vector<AloneLook> all;
  for (int k = 0; k <= 60; ++k) {
    const double t = 3.0 + k / 12.0;
    all.push_back({t, {{"organ_1", speed(t - 3.0), height(t - 3.0), 0.1}}});
  }
  return all;
}

TEST(EnergyLaw, LetsAFallBeAndFindsWhatSpeedsUp) {
  const auto flat = [](double) { return 0.1; };
  const auto falls = looks([](double t) { return std::min(9.81 * t, 9.81 * 0.5); },
                           [](double t) { return t < 0.5 ? 1.3 - 4.905 * t * t : 1.3 - 4.905 * t * 0.5; });
  EXPECT_FALSE(energyLaw(falls, 9.81).broken()) << energyLaw(falls, 9.81).text;
  const auto calms = looks([](double t) { return 0.5 * std::exp(-t) * std::abs(std::cos(20.0 * t)); }, flat);
  EXPECT_FALSE(energyLaw(calms, 9.81).broken());
  const auto speeds_up = looks([](double t) { return 0.2 * std::exp(0.9 * t); }, flat);
  EXPECT_TRUE(energyLaw(speeds_up, 9.81).broken());
  const auto thrown = looks([](double t) { return t > 3.0 && t < 3.2 ? 0.5 : 0.001; }, flat);
  EXPECT_TRUE(energyLaw(thrown, 9.81).broken());
  const auto rises = looks([](double) { return 0.01; }, [](double t) { return 0.1 + 0.01 * t; });
  EXPECT_TRUE(energyLaw(rises, 9.81).broken());
}

TEST(RestLaw, FindsWhatMovesAndWhoIsAwake) {
  Seen seen = sound();
  seen.bodies[1].kinetic_energy = 0.5 * seen.bodies[1].mass * 0.01 * 0.01;
  EXPECT_TRUE(restLaw(seen).broken());
  EXPECT_FALSE(asleepLaw(seen).broken());
  seen = sound();
  seen.bodies[0].asleep = false;
  EXPECT_FALSE(restLaw(seen).broken());
  EXPECT_TRUE(asleepLaw(seen).broken());
}

TEST(Finding, KeepsTheWorstAndCallsNaNBroken) {
  Finding finding;
  finding.take(0.5, "half");
  EXPECT_FALSE(finding.broken());
  finding.take(0.2, "less");
  EXPECT_EQ(finding.text, "half");
  finding.take(std::nan(""), "nan");
  EXPECT_TRUE(finding.broken());
  finding.take(3.0, "more");
  EXPECT_EQ(finding.text, "nan");
}

}  // namespace
}  // namespace meshless
