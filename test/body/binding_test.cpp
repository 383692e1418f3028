#include "meshless_surgery/body/binding.h"

#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/bodies.h"

namespace meshless {
namespace binding_test {

Points moved(const Points& points, const Mat3& map, const Vec3& shift) {
  Points result;
  for (const Vec3& p : points) result.push_back(map * p + shift);
  return result;
}

TEST(BindSurface, EmbeddedVerticesFollowEveryAffineMotionExactly) {
  Mat3 map;
  map << 1.2, 0.1, 0, -0.1, 0.9, 0.05, 0, 0.1, 1.1;
  const Vec3 shift(1, -2, 3);
  for (const shapes::Shape& shape : shapes::simpleShapes()) {
    SCOPED_TRACE(shape.name);
    const double size = boundsOf(shape.mesh.vertices).diagonal();
    BodyDef def = test::defOf(shape.mesh);
    def.spacing = size / 12.0;
    const PreparedBody body = test::prepared(def);
    const BodyModel& m = *body.model;
    std::vector<Index> vertex_particle = m.binding.particle;
    for (std::size_t v = 0; v < vertex_particle.size(); v += 2) vertex_particle[v] = kNoIndex;
    const SurfaceBinding binding = bindSurface(m.rest, m.graph, m.clusters, m.surface.vertices, vertex_particle);
    EXPECT_EQ(binding.particle, vertex_particle);
    ASSERT_EQ(binding.offsets.size(), binding.embedded.size() + 1);
    std::vector<ClusterPose> poses(m.clusters.size());
    for (ClusterPose& pose : poses) pose.deformation = map;
    const Points positions = moved(m.rest, map, shift), surface = moved(m.surface.vertices, map, shift);
    for (Index r = 0; r < binding.embedded.size(); ++r) {
      EXPECT_EQ(vertex_particle[binding.embedded[r]], kNoIndex);
      double share = 0.0;
      for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k) share += binding.weights[k];
      EXPECT_NEAR(share, 1.0, 1e-12);
      EXPECT_LT((embeddedPosition(binding, positions, poses, r) - surface[binding.embedded[r]]).norm(), 1e-9 * size);
    }
  }
}

TEST(FewerCarriers, VerticesStayWhereTheyAreUnderEveryAffineMotion) {
  Mat3 map;
  map << 1.2, 0.1, 0, -0.1, 0.9, 0.05, 0, 0.1, 1.1;
  const Vec3 shift(1, -2, 3);
  std::vector<shapes::Shape> all_shapes = shapes::simpleShapes();
  all_shapes.push_back({"fine sphere", sphereMesh(0.1, 0.0042)});
  for (const shapes::Shape& shape : all_shapes) {
    SCOPED_TRACE(shape.name);
    const double size = boundsOf(shape.mesh.vertices).diagonal();
    const bool fine = shape.name == "fine sphere";  // appearance materials embed no coarse ones
    BodyDef def = test::defOf(shape.mesh);
    def.spacing = std::min(size / 12.0, 2.0 * signedVolume(shape.mesh) / surfaceArea(shape.mesh));
    if (!fine) def.material.youngs_modulus = 5000.0;
    const PreparedBody body = test::prepared(def);
    const BodyModel& m = *body.model;
    const SurfaceBinding& all = m.binding;
    ASSERT_GT(all.embedded.size(), 0u);
    const SurfaceBinding few = fewerCarriers(all, m.rest, m.spacing);
    ASSERT_EQ(few.offsets.size(), all.offsets.size());
    const Points positions = moved(m.rest, map, shift);
    const std::vector<ClusterPose> still(m.clusters.size());
    std::size_t many = 0;
    for (Index r = 0; r < all.embedded.size(); ++r) {
      double magnitude = 0.0, before = 0.0;
      for (Index k = few.offsets[r]; k < few.offsets[r + 1]; ++k) magnitude += std::abs(few.weights[k]);
      for (Index k = all.offsets[r]; k < all.offsets[r + 1]; ++k) before += std::abs(all.weights[k]);
      EXPECT_LT(magnitude, 1.5 * before) << "what carries a vertex far outside throws it";
      many += few.offsets[r + 1] - few.offsets[r] > 8;
      EXPECT_LT((embeddedPosition(few, positions, still, r) - embeddedPosition(all, positions, still, r)).norm(),
                1e-9 * size);
    }
    EXPECT_LE(20 * many, all.embedded.size());
  }
}

TEST(BindSurface, EmbeddedVerticesOfAPieceAmplifyLittleAndFollowSmoothMotion) {
  Mat3 map;
  map << 1.2, 0.1, 0, -0.1, 0.9, 0.05, 0, 0.1, 1.1;
  const Vec3 shift(1, -2, 3);
  for (bool elastic : {false, true}) {
    BodyDef def = test::defOf(sphereMesh(0.1, 0.012), "ball");
    def.spacing = 0.018;
    if (elastic) def.material.youngs_modulus = 5000.0;
    const PreparedBody body = test::prepared(def);
    for (int k = 0; k < 6; ++k) {
      const Vec3 normal = Vec3(std::sin(k), std::cos(1.7 * k), std::sin(2.3 * k + 1.0)).normalized();
      const Result<CutBody> cut = cutBody(*body.model, body.state, {normal, Vec3(0.01 * std::sin(k), 0.02, 0.0)});
      ASSERT_TRUE(cut.ok());
      for (const BodyPiece& piece : cut->pieces) {
        const BodyModel& m = *piece.model;
        const SurfaceBinding& binding = m.binding;
        ASSERT_GT(binding.bound, 0u);
        std::vector<ClusterPose> poses(m.clusters.size()), still = poses;
        for (ClusterPose& pose : poses) pose.deformation = map;
        // Bent by half a radian over the ball's width; the maps of levers are those of the rest shape.
        const auto bent = [](const Vec3& p) { return Vec3(p.x(), p.y() + 2.5 * p.x() * p.x(), p.z()); };
        Points curved;
        for (const Vec3& p : m.rest) curved.push_back(bent(p));
        const Points positions = moved(m.rest, map, shift), surface = moved(m.surface.vertices, map, shift);
        for (Index r = 0; r < binding.embedded.size(); ++r) {
          double magnitude = 0.0;
          for (Index c = binding.offsets[r]; c < binding.offsets[r + 1]; ++c) magnitude += std::abs(binding.weights[c]);
          // The weights of a cell add up to more the farther beyond it: 3 one whole cell beyond a face, where the
          // tissue there hardly fills the cell next to it.
          EXPECT_LE(magnitude, (elastic ? 3.0 : kMostWeight) * (1.0 + 1e-9));
          const Index v = binding.embedded[r];
          EXPECT_LT((embeddedPosition(binding, positions, poses, r) - surface[v]).norm(), 1e-10);
          if (!binding.levers[r].isZero(0.0)) continue;
          const double miss = (embeddedPosition(binding, curved, still, r) - bent(m.surface.vertices[v])).norm();
          EXPECT_LT(miss, 2.5 * std::pow((elastic ? 1.42 : 2.5) * m.spacing, 2));
        }
      }
    }
  }
}

// A blade knows a particle near each point that it makes; it need not be the nearest.
TEST(BindSurface, CarriersAreTheNearestFromAnyParticleNearBy) {
  BodyDef def = test::defOf(sphereMesh(0.1, 0.012), "ball");
  def.spacing = 0.018;
  const PreparedBody body = test::prepared(def);
  const BodyModel& m = *body.model;
  std::vector<Index> vertex_particle = m.binding.particle, same(m.rest.size());
  for (std::size_t v = 0; v < vertex_particle.size(); v += 2) vertex_particle[v] = kNoIndex;
  for (Index i = 0; i < same.size(); ++i) same[i] = i;
  const SurfaceBinding searched = bindSurface(m.rest, m.graph, m.clusters, m.surface.vertices, vertex_particle);
  InheritedBinding known{m.binding, std::vector<Index>(vertex_particle.size(), kNoIndex), same, {}, nullptr};
  for (const Vec3& p : m.surface.vertices) {
    Index nearest = 0;
    for (Index i = 0; i < m.rest.size(); ++i)
      if ((m.rest[i] - p).squaredNorm() < (m.rest[nearest] - p).squaredNorm()) nearest = i;
    known.start.push_back(m.graph.neighbours[m.graph.offsets[nearest]]);
  }
  const SurfaceBinding begun = bindSurface(m.rest, m.graph, m.clusters, m.surface.vertices, vertex_particle, &known);
  EXPECT_EQ(begun.bound, searched.bound);
  ASSERT_EQ(begun.offsets, searched.offsets);
  for (std::size_t r = 0; r < begun.embedded.size(); ++r)
    for (Index k = begun.offsets[r]; k < begun.offsets[r + 1]; ++k) {  // of those as far as each other, any
      const Vec3& p = m.surface.vertices[begun.embedded[r]];
      EXPECT_NEAR((m.rest[begun.carriers[k]] - p).norm(), (m.rest[searched.carriers[k]] - p).norm(), 1e-12);
    }
}

// The ends of an edge that a blade met are far from where it met it: what is bound there follows the tissue beside it.
TEST(BindSurface, TheRimOfACutThroughLargeTrianglesFollowsWhatIsBesideIt) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.2, 0.2, 0.2), 1, 1, 1), "box");
  def.spacing = 0.01;
  const PreparedBody body = test::prepared(def);
  const Result<CutBody> cut = cutBody(*body.model, body.state, {Vec3(0.02, 0.03, 1.0).normalized(), Vec3(0, 0, 0.001)});
  ASSERT_TRUE(cut.ok());
  int bound = 0;
  for (const BodyPiece& piece : cut->pieces) {
    const BodyModel& m = *piece.model;
    for (Index r = 0; r < m.binding.embedded.size(); ++r) {
      const Vec3& p = m.surface.vertices[m.binding.embedded[r]];
      double nearest = 1.0;
      for (const Vec3& q : m.rest) nearest = std::min(nearest, (q - p).norm());
      EXPECT_NEAR((m.rest[m.binding.carriers[m.binding.offsets[r]]] - p).norm(), nearest, 1e-12);
      ++bound;
    }
  }
  EXPECT_GT(bound, 10);
}

TEST(BindSurface, ParticlesInAPlaneOrAloneStillCarry) {
  const Points flat = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  const ParticleGraph square = makeGraph(flat, {{0, 1}, {1, 3}, {3, 2}, {2, 0}});
  const ClusterSet one = makeClusters(flat, square, {});
  const SurfaceBinding above = bindSurface(flat, square, one, {{0.25, 0.5, 0.1}}, {kNoIndex});
  // A quarter turn about y takes x to -z and z to x.
  const Points turned = {{0, 0, 0}, {0, 0, -1}, {0, 1, 0}, {0, 1, -1}};
  std::vector<ClusterPose> poses(1);
  poses[0].deformation = Eigen::AngleAxisd(M_PI / 2, Vec3::UnitY()).toRotationMatrix();
  EXPECT_LT((embeddedPosition(above, turned, poses, 0) - Vec3(0.1, 0.5, -0.25)).norm(), 1e-12);
  const Points single = {{1, 2, 3}};
  const ParticleGraph graph = makeGraph(single, {});
  const SurfaceBinding lone = bindSurface(single, graph, makeClusters(single, graph, {}), {{1, 2, 4}}, {kNoIndex});
  EXPECT_LT((embeddedPosition(lone, {{5, 6, 7}}, poses, 0) - Vec3(6, 6, 7)).norm(), 1e-12);
}

TEST(BindSurface, OtherPartsThatAreOnlyNearInSpaceDoNotCarry) {
  // Two rows of particles side by side, joined nowhere.
  Points rest;
  std::vector<std::array<Index, 2>> edges;
  for (Index row = 0; row < 2; ++row)
    for (Index k = 0; k < 10; ++k) {
      if (k > 0) edges.push_back({static_cast<Index>(rest.size()) - 1, static_cast<Index>(rest.size())});
      rest.emplace_back(k, 0.3 * row, 0);
    }
  const SurfaceBinding binding = bindSurface(
      rest, makeGraph(rest, edges), makeClusters(rest, makeGraph(rest, edges), {}), {{4.5, -0.1, 0}}, {kNoIndex});
  for (Index i : binding.carriers) EXPECT_LT(i, 10u);
}

TEST(BindSurface, WithoutEmbeddedVerticesThereIsNothingToFollow) {
  const PreparedBody body = test::prepared(test::ball());
  EXPECT_TRUE(body.model->binding.embedded.empty());
  EXPECT_TRUE(body.model->binding.carriers.empty());
}

}  // namespace binding_test
}  // namespace meshless
