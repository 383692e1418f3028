// Contact of bodies that are bent, turned inside out, or lie exactly along each other.
#include <cmath>

#include "meshless_surgery/contact/contacts.h"
#include "meshless_surgery/dynamics/rotation.h"
#include "meshless_surgery/geometry/inside.h"
#include "meshless_surgery/world/quadratic_fit.h"
#include "support/bodies.h"

namespace meshless {
namespace {

constexpr double kPi = 3.14159265358979323846;

BodyDef box(const std::string& name, const Vec3& size, const std::array<int, 3>& parts, const Vec3& at) {
  BodyDef def = test::defOf(boxMesh(size, parts[0], parts[1], parts[2]), name);
  def.pose.translation = at;
  def.clusters.kind = ClusterOptions::Kind::kOne;
  def.spacing = std::max({size.x() / parts[0], size.y() / parts[1], size.z() / parts[2]});
  return def;
}

WorldSnapshot seen(World& world) { return world.snapshot({true, true, true}); }

/// A body as contact sees it, at given positions of its particles.
struct BodyView {
  BodyView(const PreparedBody& body, std::uint64_t key)
      : model(body.model),
        state(body.state),
        shape(model->surface,
              {&model->binding.particle, &model->binding.embedded, &model->binding.offsets, &model->binding.carriers,
               &model->binding.weights},
              model->spacing) {
    view.key = key;
    view.shape = &shape;
    for (double m : model->masses) inverse_masses.push_back(1.0 / m);
  }

  const ShapeCollider& see() {
    updateSurface(*model, state);
    maps.clear();
    for (Index c = 0; c < model->clusters.size(); ++c) maps.push_back(fit(c));
    if (!model->shape.quadratic.empty()) fitQuadraticMaps(matchInput(*model), state.positions.data(), maps, quadratics);
    view.positions = state.positions.data();
    view.previous = state.positions.data();
    view.masses = model->masses.data();
    view.inverse_masses = inverse_masses.data();
    view.particles = static_cast<Index>(state.positions.size());
    view.surface = shape.hasEmbedded() ? state.surface.data() : nullptr;
    view.maps = maps.data();
    view.map_count = static_cast<Index>(maps.size());
    view.mass = model->mass;
    view.bounds = Box();
    for (const Vec3& p : state.positions) view.bounds.extend(p);
    return view;
  }

  ContactMap fit(Index c) const {
    const ClusterSet& clusters = model->clusters;
    ContactMap map;
    double mass = 0.0;
    Vec3 rest = Vec3::Zero(), present = Vec3::Zero();
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
      const Index i = clusters.members[k];
      const double m = model->masses[i] * clusters.weights[k];
      mass += m;
      rest += m * model->rest[i];
      present += m * state.positions[i];
    }
    map.rest = rest / mass;
    map.centre = present / mass;
    Mat3 pq = Mat3::Zero(), qq = Mat3::Zero();
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
      const Index i = clusters.members[k];
      const double m = model->masses[i] * clusters.weights[k];
      const Vec3 q = model->rest[i] - map.rest;
      pq += m * (state.positions[i] - map.centre) * q.transpose();
      qq += m * q * q.transpose();
    }
    map.from_rest = pq * qq.inverse();
    map.to_rest = map.from_rest.inverse();
    return map;
  }

  BodyModelPtr model;
  BodyState state;
  ContactShape shape;
  std::vector<double> inverse_masses;
  std::vector<ContactMap> maps;
  std::vector<QuadraticMap> quadratics;
  ShapeCollider view;
};

/// Along x an arc of 90 degrees about y; heights stay.
Vec3 bent(const Vec3& p, double length) {
  const double radius = length / (0.5 * kPi), angle = p.x() / radius;
  return Vec3((radius - p.z()) * std::sin(angle), p.y(), radius - (radius - p.z()) * std::cos(angle));
}

/// Its tip is the origin, it widens along +z.
TriangleMesh needle(double length, double width) {
  TriangleMesh mesh;
  mesh.vertices = {Vec3(0, 0, 0), Vec3(width, 0, length), Vec3(-0.5 * width, 0.8 * width, length),
                   Vec3(-0.5 * width, -0.8 * width, length)};
  mesh.triangles = {{1, 2, 3}, {0, 2, 1}, {0, 3, 2}, {0, 1, 3}};
  return mesh;
}

/// Of a bar bent by 90 degrees: the largest difference between the depth that contact finds and the true one [m].
double worstDepth(ClusterOptions::Kind kind, MatchMode mode, double length, double thick) {
  BodyDef def = box("bar", Vec3(length, thick, thick), {40, 4, 4}, Vec3::Zero());
  def.clusters.kind = kind;
  def.clusters.count = 12;
  def.material.mode = mode;
  BodyView bar(test::prepared(def), 1);
  EXPECT_EQ(bar.model->clusters.size() > 1, kind == ClusterOptions::Kind::kCount);
  for (Vec3& p : bar.state.positions) p = bent(p, length);
  bar.see();
  TriangleMesh present = bar.model->surface;
  present.vertices = bar.state.surface;
  const SolidQuery solid(present);

  BodyDef sharp = test::defOf(needle(3.0 * thick, 0.1 * thick), "needle");
  sharp.clusters.kind = ClusterOptions::Kind::kOne;
  sharp.spacing = 10.0 * thick;  // corners alone
  BodyView probe(test::prepared(sharp), 2);
  const Points at_rest = probe.state.positions;
  double worst = 0.0;
  for (const double share : {-0.42, -0.3, -0.21, -0.1, 0.013, 0.17, 0.25, 0.38})
    for (const double y : {-0.2, 0.0, 0.17})
      for (const double depth : {0.04, 0.1, 0.2})
        for (const int side : {-1, 1}) {
          const double x = share * length;
          const Vec3 tip = bent(Vec3(x, y * thick, side * (0.5 - depth) * thick), length);
          const Vec3 out = (bent(Vec3(x, 0.0, side * thick), length) - bent(Vec3(x, 0.0, 0.0), length)).normalized();
          const Quat turn = Quat::FromTwoVectors(Vec3::UnitZ(), out);
          for (std::size_t i = 0; i < at_rest.size(); ++i) probe.state.positions[i] = turn * at_rest[i] + tip;
          EXPECT_TRUE(solid.contains(tip));
          const std::vector<ShapeCollider> colliders{bar.see(), probe.see()};
          Contacts contacts;
          ContactCounters counters;
          contacts.findPairs({}, colliders, 1.0 / 120.0, counters);
          EXPECT_EQ(counters.pairs, 1u);
          contacts.make(colliders, 1.0 / 120.0, counters);
          double deepest = 0.0;
          for (const double d : contacts.depths())
            deepest = std::max(deepest, d * std::min(probe.shape.size(), bar.shape.size()));
          worst = std::max(worst, std::abs(deepest - solid.distance(tip)));
        }
  return worst;
}

TEST(ContactGeometry, TheDepthInABodyBentBy90DegreesIsTrue) {
  EXPECT_LT(worstDepth(ClusterOptions::Kind::kCount, MatchMode::kLinear, 1.0, 0.1), 0.05 * 0.1);
}

TEST(ContactGeometry, TheDepthInAQuadraticBodyOfOneClusterBentBy90DegreesIsTrue) {
  for (const double length : {0.3, 0.4, 0.6}) {
    const double worst = worstDepth(ClusterOptions::Kind::kOne, MatchMode::kQuadratic, length, 0.1);
    EXPECT_LT(worst, 0.05 * 0.1) << length;
    RecordProperty("worst_" + std::to_string(length), std::to_string(worst / 0.1));
  }
}

TEST(ContactGeometry, AQuadraticMapIsInvertedWhereItDoesNotFold) {
  QuadraticMap map;
  map.scale = 0.2;
  map.rest = Vec3(1.0, -2.0, 0.5);
  map.centre = Vec3(0.3, 0.1, -4.0);
  map.fit.leftCols<3>() = map.scale * Mat3(Eigen::AngleAxisd(2.0, Vec3(1, 2, 3).normalized()));
  map.fit.col(3) = Vec3(0.03, -0.02, 0.03);
  map.fit.col(7) = Vec3(-0.02, 0.02, 0.01);
  for (const double x : {-0.3, -0.1, 0.0, 0.2, 0.3})
    for (const double z : {-0.2, 0.0, 0.15}) {
      const Vec3 r = map.rest + Vec3(x, 0.5 * x - z, z);
      const Vec3 p = map.at(r);
      const Mat3 linear = map.fit.leftCols<3>() / map.scale;
      Vec3 found = linear.inverse() * (p - map.centre) + map.rest;  // without the quadratic part
      Mat3 to_rest;
      ASSERT_TRUE(map.invert(p, 1.0, found, to_rest));
      EXPECT_NEAR((found - r).norm(), 0.0, 1e-6);
      for (int d = 0; d < 3; ++d) {
        const Vec3 step = 1e-6 * Vec3::Unit(d);
        EXPECT_NEAR((map.slope(r).col(d) - (map.at(r + step) - map.at(r - step)) / 2e-6).norm(), 0.0, 1e-6);
      }
      EXPECT_NEAR((to_rest * map.slope(found) - Mat3::Identity()).norm(), 0.0, 1e-3);
    }
  Vec3 from = map.rest;
  Mat3 to_rest;
  EXPECT_FALSE(map.invert(Vec3(std::nan(""), 0.0, 0.0), 1.0, from, to_rest));
  EXPECT_FALSE(map.invert(map.centre + Vec3(0.5, 0.0, 0.0), 0.1, from, to_rest)) << "too far";
  EXPECT_EQ(from, map.rest);
  map.fit.setZero();
  EXPECT_FALSE(map.invert(map.centre, 1.0, from, to_rest)) << "flat";
}

/// Deepest vertex of a in b [m]; 0 where none is inside.
double deepestIn(const BodySnapshot& a, const BodySnapshot& b) {
  TriangleMesh mesh = b.model->surface;
  mesh.vertices = b.surface;
  const SolidQuery solid(mesh);
  double deepest = 0.0;
  for (const Vec3& p : a.surface)
    if (solid.contains(p)) deepest = std::max(deepest, solid.distance(p));
  return deepest;
}

TEST(ContactGeometry, BodiesThatWereTurnedInsideOutStayFiniteAndPart) {
  for (const bool flat : {false, true}) {
    WorldSettings settings = test::weightless();
    settings.sleep = false;
    World world(settings);
    PreparedBody first = test::prepared(box("inverted", Vec3(0.1, 0.1, 0.1), {4, 4, 4}, Vec3::Zero()));
    for (Vec3& p : first.state.positions) p.z() *= flat ? 0.0 : -1.0;
    PreparedBody second = test::prepared(box("other", Vec3(0.1, 0.1, 0.1), {2, 2, 2}, Vec3(0.03, 0.02, 0.09)));
    for (Vec3& v : second.state.velocities) v = Vec3(0, 0, -0.2);
    const double mass = second.model->mass;
    ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(std::move(first))).ok());
    ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(std::move(second))).ok());
    for (int step = 0; step < 360; ++step) {
      world.step();
      const WorldSnapshot shot = seen(world);
      Vec3 momentum = Vec3::Zero();
      for (const BodySnapshot& b : shot.bodies) {
        ASSERT_TRUE(test::allFinite(b.particles)) << "step " << step;
        ASSERT_LT(b.measures.velocity.norm(), 2.0) << "step " << step;
        momentum += b.measures.linear_momentum;
      }
      ASSERT_NEAR((momentum - Vec3(0, 0, -0.2 * mass)).norm(), 0.0, 1e-9 * mass) << "step " << step;
    }
    const WorldSnapshot shot = seen(world);
    EXPECT_LT(deepestIn(shot.bodies[1], shot.bodies[0]), 0.002) << flat;
    EXPECT_LT(deepestIn(shot.bodies[0], shot.bodies[1]), 0.002) << flat;
  }
}

/// By how much a body is turned out of its upright rest shape [rad].
double tiltOf(const BodySnapshot& body) {
  Mat3 a = Mat3::Zero();
  for (std::size_t i = 0; i < body.particles.size(); ++i)
    a += body.model->masses[i] * (body.particles[i] - body.measures.centre_of_mass) * body.model->rest[i].transpose();
  const Vec3 up = nearestRotationExact(a, Quat::Identity()).rotation * Vec3::UnitZ();
  return std::atan2(up.head<2>().norm(), up.z());
}

// Edge on edge and side along side: samples of the upper one lie exactly in the planes of the lower one's sides, and
// those sides are as near to them as its top is.
TEST(ContactGeometry, CubesStackedExactlyAlongEachOtherStand) {
  for (const double alpha : {0.9, 0.99, 1.0}) {
    WorldSettings settings;
    settings.sleep = false;
    World world(settings);
    for (int k = 0; k < 3; ++k) {
      BodyDef def = box("cube" + std::to_string(k), Vec3::Constant(0.1), {2, 2, 2}, Vec3(0, 0, 0.0501 + 0.1001 * k));
      def.material.alpha = alpha;
      def.material.damping = 5.0;
      ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    }
    // Soft ones wobble: contact of now cannot do better, and they should be held as still as the others.
    const double way = alpha < 0.99 ? 0.05 : 0.002, tilt = alpha < 0.99 ? 0.02 : 0.005;
    std::vector<Vec3> settled;  // [m] their centres, after a second
    for (int step = 0; step < 1200; ++step) {
      world.step();
      if (step % 10) continue;
      const WorldSnapshot shot = seen(world);
      for (int k = 0; k + 1 < 3; ++k) {
        const double deep =
            std::max(deepestIn(shot.bodies[k + 1], shot.bodies[k]), deepestIn(shot.bodies[k], shot.bodies[k + 1]));
        EXPECT_LT(deep, (step < 120 ? 0.005 : 0.002) * 0.1)
            << "cube " << k << " at alpha " << alpha << ", step " << step;
      }
      // Soft ones are pressed flatter by those on them, and then stay so: they neither sink, nor walk, nor rock.
      for (int k = 0; k < 3; ++k) {
        const BodySnapshot& cube = shot.bodies[k];
        const Vec3 centre = cube.measures.centre_of_mass;
        if (step == 120) settled.push_back(centre);
        if (step >= 120)
          EXPECT_LT((centre - settled[k]).norm(), way * 0.1)
              << "cube " << k << " at alpha " << alpha << ", step " << step;
        EXPECT_LT(tiltOf(cube), tilt) << "cube " << k << " at alpha " << alpha << ", step " << step;
      }
      EXPECT_GT(shot.bodies[2].measures.centre_of_mass.z(), (alpha < 0.99 ? 0.96 : 0.99) * 0.25) << alpha;
    }
  }
}

}  // namespace
}  // namespace meshless
