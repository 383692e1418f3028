// The work of a cut depends on what it meets, not on the cuts before it. Counted, for clocks blur.
#include "shapes/random_organ.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace successive_cuts_test {

constexpr int kCuts = 100;
constexpr double kSlice = 0.03;    // [m]
constexpr double kSpacing = 0.01;  // [m]

BodyDef bar(bool elastic) {
  const int slices = kCuts + 2;
  BodyDef def = test::defOf(boxMesh(Vec3(slices * kSlice, 0.03, 0.03), 3 * slices, 3, 3), "bar");
  def.spacing = kSpacing;
  if (elastic) {
    def.material.youngs_modulus = 5000.0;
  } else {
    def.clusters.kind = ClusterOptions::Kind::kGrid;
    def.clusters.grid = {2 * slices, 1, 1};
  }
  return def;
}

World worldOf(const std::shared_ptr<const PreparedBody>& body) {
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  World world(settings);
  EXPECT_TRUE(world.addSceneBody(body).ok());
  return world;
}

/// Takes the slice of that number off the bar's end, askew.
CutCommand slice(int number) {
  CutCommand cut;
  const Vec3 normal = Vec3(1.0, 0.05, 0.03).normalized();
  cut.blades.origin = Vec3(0.5 * (kCuts + 2) * kSlice - (number + 1.07) * kSlice, 0.0, 0.0);
  cut.blades.x_axis = normal.unitOrthogonal();
  cut.blades.y_axis = normal.cross(cut.blades.x_axis);
  return cut;
}

std::size_t particlesOf(World& world) {
  std::size_t sum = 0;
  for (const BodySnapshot& body : world.snapshot({}).bodies) sum += body.model->rest.size();
  return sum;
}

TEST(SuccessiveCuts, TheHundredthDoesTheWorkOfTheSameCutWithoutHistory) {
  for (bool elastic : {true, false}) {
    SCOPED_TRACE(elastic ? "elastic" : "appearance");
    const auto body = test::shared(bar(elastic));
    World world = worldOf(body), fresh = worldOf(body);
    const std::size_t particles = particlesOf(world);
    CutWork first;
    for (int k = 0; k < kCuts; ++k) {
      const std::size_t before = particlesOf(world);
      const CutReply cut = test::replyOf<CutReply>(world.apply(slice(k)));
      if (k % 11 == 0) world.step();
      ASSERT_EQ(cut.new_bodies.size(), 2u) << k;
      // Filled cells that are cut have corners on both sides: a blade askew passes two layers of 3 by 3 cells at most.
      const std::size_t copies = particlesOf(world) - before;
      ASSERT_LE(copies, 3u * 16u) << k;
      EXPECT_GT(cut.work.rebuilt_clusters, 0u);
      EXPECT_GT(cut.work.bound_embedded, 0u);
      EXPECT_GT(cut.work.kept_clusters, 0u);
      if (k == 0) first = cut.work;
      // Every slice has the same section: what is new does not change, what is kept gets less with the bar.
      EXPECT_EQ(cut.work.new_vertices, first.new_vertices) << k;
      EXPECT_EQ(cut.work.new_triangles, first.new_triangles) << k;
      EXPECT_LE(cut.work.kept_clusters, first.kept_clusters) << k;
      if (k % 11 != 0) continue;  // 99 too
      fresh.reset();
      const CutReply alone = test::replyOf<CutReply>(fresh.apply(slice(k)));
      EXPECT_EQ(copies, particlesOf(fresh) - particles) << k;
      EXPECT_EQ(cut.work.new_vertices, alone.work.new_vertices) << k;
      EXPECT_EQ(cut.work.new_triangles, alone.work.new_triangles) << k;
      // The cap of the cut before is near enough that some of its embedded vertices lose a carrier.
      EXPECT_GE(cut.work.bound_embedded, alone.work.bound_embedded) << k;
      EXPECT_LE(cut.work.bound_embedded, 1.6 * alone.work.bound_embedded) << k;
      EXPECT_EQ(cut.work.rebuilt_clusters, alone.work.rebuilt_clusters) << k;
      EXPECT_LE(cut.work.kept_clusters, alone.work.kept_clusters) << k;
    }
  }
}

TEST(SuccessiveCuts, CapsThroughOldCapsAreNoFinerThanTheSurfaceWas) {
  constexpr double kBallEdge = 0.008, kBallSpacing = 0.012;  // [m]
  test::Random random(21);
  BodyDef def = test::defOf(sphereMesh(0.1, kBallEdge), "ball");
  def.spacing = kBallSpacing;
  def.material.youngs_modulus = 5000.0;
  World world = worldOf(test::shared(def));
  for (int k = 0; k < kCuts; ++k) {
    const WorldSnapshot shot = world.snapshot({true, false, true});
    std::size_t largest = 0;
    for (std::size_t b = 1; b < shot.bodies.size(); ++b)
      if (shot.bodies[b].model->rest_volume > shot.bodies[largest].model->rest_volume) largest = b;
    const BodySnapshot& target = shot.bodies[largest];
    CutCommand cut;
    const Vec3 normal = random.unit();
    cut.blades.x_axis = normal.unitOrthogonal();
    cut.blades.y_axis = normal.cross(cut.blades.x_axis);
    cut.blades.origin = target.measures.centre_of_mass - 10.0 * cut.blades.x_axis;
    cut.bodies = {target.name};
    const std::size_t particles = particlesOf(world);
    const CutReply reply = test::replyOf<CutReply>(world.apply(cut));
    world.step();
    // Equilateral triangles on both sides and four more at each edge of the rim of a round cap.
    const double area = reply.cap_area / (kBallEdge * kBallEdge);
    EXPECT_LT(static_cast<double>(reply.work.new_triangles),
              1.5 * (area * 8.0 / std::sqrt(3.0) + 4.0 * 2.0 * std::sqrt(M_PI * area)))
        << k;
    EXPECT_LE(reply.work.rebuilt_clusters, 2 * target.model->groups()) << k;
    // Corners have copies that are of cells on the blade: those within the sum of its normal's coordinates, at most the
    // square root of 3 cells, of a round section that is wider by as much.
    const double reach = std::sqrt(3.0), radius = std::sqrt(reply.cap_area / M_PI) / kBallSpacing;
    EXPECT_LT(static_cast<double>(particlesOf(world) - particles), 2.0 * reach * M_PI * std::pow(radius + reach, 2))
        << k;
  }
}

// A soft organ sinks into itself on the ground. Where its outline in a blade crosses itself, faces of the cut join what
// is far apart at rest, and the next blade makes vertices on their edges.
TEST(SuccessiveCuts, VerticesStayWithTheirTissueWhereItLiesInItself) {
  Result<TriangleMesh> mesh = randomOrgan(15, 0, 0.15, 4100);
  ASSERT_TRUE(mesh.ok());
  BodyDef def = test::defOf(std::move(*mesh), "organ");
  double lowest = 0.0;
  for (const Vec3& p : def.mesh.vertices) lowest = std::min(lowest, p.z());
  def.pose.translation.z() = 0.002 - lowest;
  def.material.youngs_modulus = 3000.0;
  def.material.poissons_ratio = 0.45;
  def.material.density = 1060.0;
  def.material.damping = 4.0;
  def.material.friction = 0.3;
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(std::move(def))).ok());
  for (int n = 0; n < 60; ++n) world.step();
  const Plane planes[] = {{Vec3(0.987, 0.092, -0.131).normalized(), Vec3(0.0411, -0.0022, 0.0222)},
                          {Vec3(0.124, -0.902, 0.415).normalized(), Vec3(0.0293, -0.0033, 0.0237)}};
  for (const Plane& plane : planes) {
    CutCommand cut;
    cut.blades.x_axis = plane.normal.unitOrthogonal();
    cut.blades.y_axis = plane.normal.cross(cut.blades.x_axis);
    cut.blades.origin = plane.point - 10.0 * cut.blades.x_axis;
    const Result<Reply> reply = world.apply(cut);
    ASSERT_TRUE(reply.ok()) << reply.error().detail;
  }
  for (const BodySnapshot& body : world.snapshot({true, false, true}).bodies) {
    const SurfaceBinding& binding = body.model->binding;
    const CellLattice& lattice = *body.model->lattice;
    for (Index r = 0; r < binding.size(); ++r) {
      const Vec3 at = lattice.placeIn(lattice.cells[binding.cells[r]], body.model->surface.vertices[r]);
      EXPECT_LT((at - at.cwiseMax(0.0).cwiseMin(1.0)).norm(), 1.5) << body.name << ", vertex " << r;
    }
  }
}

}  // namespace successive_cuts_test
}  // namespace meshless
