// Clouds of particles that span less than space, hang together by little, or by too much: bent out of shape and let go,
// they stay finite and bounded, gain no energy, and every cluster returns to its shape.
#include <gtest/gtest.h>

#include "support/stress_cases.h"

namespace meshless::stress {
namespace odd_clouds_test {

constexpr double kSize = 0.1;       // [m] of a cloud
constexpr double kRestored = 1e-3;  // of the size
constexpr double kLongest = 30.0;   // [s] that it may take to be back

struct Cloud {
  std::string name;
  Points points;
  std::vector<std::vector<Index>> clusters;
  bool has_no_extent = false;
};

void PrintTo(const Cloud& cloud, std::ostream* out) { *out << cloud.name; }

std::vector<Index> upTo(std::size_t count) {
  std::vector<Index> all;
  for (Index i = 0; i < count; ++i) all.push_back(i);
  return all;
}

/// Half overlapping groups of particles that follow each other.
std::vector<std::vector<Index>> windows(std::size_t count, std::size_t wide) {
  std::vector<std::vector<Index>> clusters;
  for (std::size_t first = 0;; first += wide / 2) {
    clusters.emplace_back();
    for (std::size_t i = first; i < std::min(count, first + wide); ++i)
      clusters.back().push_back(static_cast<Index>(i));
    if (first + wide >= count) return clusters;
  }
}

Points lattice(int nx, int ny, int nz) {
  Points points;
  const double step = kSize / std::max({nx, ny, nz, 2});
  for (int x = 0; x < nx; ++x)
    for (int y = 0; y < ny; ++y)
      for (int z = 0; z < nz; ++z) points.push_back(step * Vec3(x, y, z));
  return points;
}

std::vector<Cloud> allClouds() {
  std::vector<Cloud> all;
  const Points corners = {Vec3(0, 0, 0), Vec3(kSize, 0, 0), Vec3(0, kSize, 0), Vec3(0, 0, kSize)};
  const char* const numbers[] = {"one particle", "two particles", "three particles", "four particles"};
  for (std::size_t n = 1; n <= 4; ++n) {
    const Points some(corners.begin(), corners.begin() + static_cast<std::ptrdiff_t>(n));
    all.push_back({numbers[n - 1], some, {upTo(n)}});
    Cloud pairs{std::string(numbers[n - 1]) + " in pairs", some, {}};
    for (Index i = 0; i < n; ++i) {
      pairs.clusters.push_back({i});
      for (Index j = i + 1; j < n; ++j) pairs.clusters.push_back({i, j});
    }
    all.push_back(pairs);
  }
  const auto addBoth = [&all](const std::string& name, const Points& points, std::size_t wide) {
    all.push_back({name, points, {upTo(points.size())}});
    all.push_back({name + " in many clusters", points, windows(points.size(), wide)});
  };
  addBoth("in a plane", lattice(6, 6, 1), 12);
  addBoth("in a line", lattice(12, 1, 1), 4);
  addBoth("in one point", Points(12, Vec3(0.3, 0.2, 0.1)), 4);
  for (std::size_t k = all.size() - 2; k < all.size(); ++k) all[k].has_no_extent = true;
  Points doubled;
  for (const Vec3& p : lattice(3, 3, 3)) doubled.insert(doubled.end(), {p, p});
  addBoth("coincident pairs", doubled, 36);

  const Points block = lattice(4, 4, 4);
  Cloud alone{"a particle that no cluster shares", block, {upTo(63), {63}}};
  all.push_back(alone);
  Cloud pair{"a pair that no cluster shares", block, {upTo(62), {62, 63}}};
  all.push_back(pair);
  Cloud far{"a particle far away", block, {upTo(64)}};
  far.points.back() = Vec3(100.0, 50.0, -20.0);
  all.push_back(far);
  far.name = "a particle far away in a cluster of few";
  far.clusters = {upTo(63), {0, 21, 42, 63}};
  all.push_back(far);
  all.push_back({"clusters that all hold all", block, {upTo(64), upTo(64), upTo(64), upTo(64), upTo(64)}});
  return all;
}

/// A body of nothing but particles of 10 g.
PreparedBody bareBody(const Cloud& cloud, const Material& material, const std::string& name) {
  auto model = std::make_shared<BodyModel>();
  const std::size_t count = cloud.points.size();
  model->rest = cloud.points;
  model->masses.assign(count, 0.01);
  model->mass = 0.01 * static_cast<double>(count);
  model->fixed.assign(count, false);
  model->spacing = 0.25 * kSize;
  std::vector<double> shared(count, 0.0);
  for (const std::vector<Index>& cluster : cloud.clusters)
    for (Index i : cluster) shared[i] += 1.0;
  std::vector<std::array<Index, 2>> links;
  ClusterSet& clusters = model->clusters;
  clusters.offsets.push_back(0);
  for (const std::vector<Index>& cluster : cloud.clusters) {
    for (Index i : cluster) {
      clusters.members.push_back(i);
      clusters.weights.push_back(1.0 / shared[i]);
      if (i != cluster[0]) links.push_back({cluster[0], i});
    }
    clusters.offsets.push_back(static_cast<Index>(clusters.members.size()));
  }
  model->graph = makeGraph(model->rest, links);
  model->binding.offsets.push_back(0);
  model->solid = false;
  model->length = kSize;
  makeTissue(*model, material);
  PreparedBody body;
  body.def.name = name;
  body.def.material = material;
  body.state.positions = model->rest;
  body.state.velocities.assign(count, Vec3::Zero());
  body.state.poses.resize(clusters.size());
  body.model = std::move(model);
  return body;
}

std::vector<Kind> cloudKinds() {
  std::vector<Kind> kinds;
  for (const Kind& kind : allKinds())
    if (!kind.many_clusters) kinds.push_back(kind);  // a cloud says itself how it is divided
  return kinds;
}

using Case = std::tuple<Kind, Cloud>;

double sizeOf(const Cloud& cloud) {
  double size = kSize;
  for (const Vec3& p : cloud.points) size = std::max(size, (p - cloud.points[0]).norm());
  return size;
}

class OddClouds : public testing::TestWithParam<Case> {
 protected:
  /// The cloud, every particle up to a fifth of the size away from its place.
  void spawn(Twins& twins, double height) {
    const auto& [kind, cloud] = GetParam();
    test::Random random(17);
    for (int b = 0; b < kind.bodies; ++b) {
      PreparedBody body = bareBody(cloud, materialOf(kind), "cloud" + std::to_string(b));
      for (Vec3& p : body.state.positions) p += Vec3(0.3 * b, 0.0, height) + random.vector(0.2 * kSize);
      twins.spawn(std::make_shared<const PreparedBody>(std::move(body)));
    }
  }
};

TEST_P(OddClouds, LetGoGoBack) {
  const auto& [kind, cloud] = GetParam();
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  Twins twins(settings);
  spawn(twins, 0.0);
  const double size = sizeOf(cloud);
  const double reach = 2.0 * size + 0.3 * kind.bodies + 1.0, h = 1.0 / settings.step_rate;
  EnergyLaw law;
  double error = 1.0;
  const int most = static_cast<int>(kLongest * settings.step_rate), least = static_cast<int>(settings.step_rate);
  for (int step = 0; step < most && (step < least || !(error < kRestored * kSize)); ++step) {
    ASSERT_TRUE(twins.step(Vec3::Zero(), reach));
    double energy = 0.0;
    error = 0.0;
    for (const BodySnapshot& body : twins.seen().bodies) {
      energy += deformationEnergy(*body.model, body.material, h, body.particles) + body.measures.kinetic_energy;
      error = std::max(error, clusterError(*body.model, body.particles));
    }
    ASSERT_TRUE(law.holds(energy)) << "step " << step;
  }
  // Without a length there is no strain; and through a hundred metres of soft tissue a wave takes a minute.
  if (kind.elastic && (cloud.has_no_extent || size > kSize)) return;
  EXPECT_LT(error, kRestored * kSize);
}

TEST_P(OddClouds, FallAndComeToRest) {
  const auto& [kind, cloud] = GetParam();
  Twins twins{WorldSettings()};
  spawn(twins, 0.05);
  const double size = sizeOf(cloud);
  for (int step = 0; step < 240; ++step) ASSERT_TRUE(twins.step(Vec3::Zero(), 2.0 * size + 0.3 * kind.bodies + 5.0));
  if (size > kSize) return;  // a particle a hundred metres away swings for longer
  for (const BodySnapshot& body : twins.seen().bodies) {
    EXPECT_LT(body.measures.kinetic_energy, 0.5 * body.model->mass * 0.1 * 0.1) << body.name;
    // A few sweeps leave a little.
    for (const Vec3& p : body.particles) EXPECT_GT(p.z(), -1e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(Stress, OddClouds, testing::ValuesIn(crossed(cloudKinds(), allClouds())), crossedName<Cloud>);

}  // namespace odd_clouds_test
}  // namespace meshless::stress
