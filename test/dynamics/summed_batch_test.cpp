#include "meshless_surgery/dynamics/summed_batch.h"

#include <cmath>
#include <limits>
#include <thread>

#include <gtest/gtest.h>

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/contact/sphere_and_ground.h"
#include "support/random.h"

namespace meshless {
namespace {

using test::Random;

constexpr double kSpacing = 0.02;  // [m]

std::vector<InstructionSet> sets() {
  std::vector<InstructionSet> all;
  for (InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512})
    if (instructionSetAvailable(set)) all.push_back(set);
  return all;
}

using Sites = std::array<int, 3>;

// A body on a lattice, with the plain code to step it.
struct Plain {
  BodyModel model;
  BodyState state;
  StepScratch scratch;
  MatchCounters counters;
  std::vector<Sites> places;

  MatchInput input() const { return matchInput(model); }

  void add(const Sites& place, double mass) {
    places.push_back(place);
    model.rest.push_back(Vec3(1.0, -2.0, 0.05) + kSpacing * Vec3(place[0], place[1], place[2]));
    model.masses.push_back(mass);
  }

  // A cluster around each particle, of all within `width` sites.
  void finish(int width) {
    ClusterSet& set = model.clusters;
    std::vector<double> count(places.size(), 0.0);
    set.offsets = {0};
    for (const Sites& c : places) {
      for (Index i = 0; i < places.size(); ++i) {
        bool near = true;
        for (int k = 0; k < 3; ++k) near = near && std::abs(places[i][k] - c[k]) <= width;
        if (!near) continue;
        set.members.push_back(i);
        count[i] += 1.0;
      }
      set.offsets.push_back(static_cast<Index>(set.members.size()));
    }
    set.weights.clear();
    for (Index i : set.members) set.weights.push_back(1.0 / count[i]);
    prepare();
  }

  void prepare() {
    model.match_masses = model.masses;
    model.fixed.assign(model.rest.size(), false);
    model.mass = 0.0;
    for (double m : model.masses) model.mass += m;
    model.shape = makeRestShape(model.rest, model.masses, model.clusters);
    state.positions = model.rest;
    state.velocities.assign(model.rest.size(), Vec3::Zero());
    state.poses.assign(model.clusters.size(), ClusterPose());
  }

  void step(const Material& material, const BatchStep& s) {
    matchAndMove(model, material, s.gravity, s.h, state, scratch, counters);
    scratch.touched.clear();
    scratch.before_contact = state.positions;
    for (Index i = 0; s.ground && i < model.rest.size(); ++i) {
      Vec3& x = state.positions[i];
      const Projection out = projectOutOfGround(x, *s.ground);
      if (!out.inside) continue;
      x += out.depth * out.normal;
      x += frictionCorrection(x - scratch.previous[i], out.normal, out.depth, s.friction);
      scratch.touched.push_back({i, out.normal, 0.0});
    }
    velocitiesFromPositions(model, s.h, state, scratch);
  }

  // [m] across the rest shape
  double size() const {
    Box box;
    for (const Vec3& p : model.rest) box.extend(p);
    return (box.max - box.min).norm();
  }
};

// In no order, with masses of their own; every `hole`-th site empty, but for 0.
Plain makeBlock(Random& random, const Sites& size, int width, int hole = 0) {
  std::vector<Sites> places;
  for (int z = 0, n = 0; z < size[2]; ++z)
    for (int y = 0; y < size[1]; ++y)
      for (int x = 0; x < size[0]; ++x, ++n)
        if (hole == 0 || n % hole != 1) places.push_back({x, y, z});
  for (std::size_t i = places.size(); i > 1; --i)
    std::swap(places[i - 1], places[std::min<std::size_t>(i - 1, random.uniform(0.0, static_cast<double>(i)))]);
  Plain body;
  for (const Sites& p : places) body.add(p, random.uniform(0.5e-3, 1.5e-3));
  body.finish(width);
  return body;
}

// Two blocks joined by a thin bar: most of the bounds are empty.
Plain makeDumbbell(Random& random, int width) {
  Plain body;
  for (int z = 0; z < 5; ++z)
    for (int y = 0; y < 5; ++y)
      for (int x = 0; x < 15; ++x)
        if (x < 5 || x >= 10 || (y == 2 && z == 2)) body.add({x, y, z}, random.uniform(0.5e-3, 1.5e-3));
  body.finish(width);
  return body;
}

// Turned, deformed and in motion.
void disturb(Plain& body, Random& random, double strain = 0.1) {
  const Mat3 map = random.rotation().toRotationMatrix() * (Mat3::Identity() + random.matrix(strain));
  const Vec3 c = rigidMotionOf(body.model, body.state.positions, body.state.velocities).centre;
  const Vec3 spin = random.vector(5.0), velocity = random.vector(0.2);
  for (std::size_t i = 0; i < body.model.rest.size(); ++i) {
    const Vec3 r = map * (body.state.positions[i] - c);
    body.state.positions[i] = c + r + random.vector(0.1 * strain * kSpacing);
    body.state.velocities[i] = velocity + spin.cross(r) + random.vector(0.02);
  }
}

Material appearance(MatchMode mode, double damping) {
  Material m;
  m.mode = mode;
  m.alpha = 0.6;
  m.beta = 0.5;
  m.damping = damping;
  return m;
}

template <class Batch>
void write(const Plain& body, Batch& batch) {
  std::vector<Quat> rotations;
  for (const ClusterPose& p : body.state.poses) rotations.push_back(p.rotation);
  batch.setState(body.state.positions, body.state.velocities, rotations);
}
template <class Batch>
void read(const Batch& batch, BodyState& to) {
  std::vector<Quat> rotations;
  batch.getState(to.positions, to.velocities, rotations);
  for (std::size_t c = 0; c < rotations.size(); ++c) to.poses[c].rotation = rotations[c];
}

double largestDistance(const Points& a, const Points& b) {
  double largest = a.size() == b.size() ? 0.0 : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    if (!((a[i] - b[i]).norm() <= largest)) largest = (a[i] - b[i]).norm();
  return largest;
}

TEST(SummedBatch, HoldsNeighbourhoodsOfALattice) {
  Random random(1);
  for (const Sites& size : {Sites{5, 6, 7}, Sites{9, 1, 4}, Sites{1, 1, 8}, Sites{4, 4, 4}})
    for (int width : {1, 2, 3, 9})
      for (int hole : {0, 3}) EXPECT_TRUE(SummedBatch::holds(makeBlock(random, size, width, hole).input()));
  EXPECT_TRUE(SummedBatch::holds(makeDumbbell(random, 2).input()));
  EXPECT_TRUE(SummedBatch::holds(makeBlock(random, {1, 1, 1}, 1).input()));
}

TEST(SummedBatch, HoldsNothingThatHasFlowed) {
  Random random(1);
  const Plain body = makeBlock(random, {3, 3, 3}, 1);
  const std::vector<PlasticShape> flowed(body.model.clusters.size());
  MatchInput input = body.input();
  EXPECT_TRUE(SummedBatch::holds(input));
  input.plastic = &flowed;
  EXPECT_FALSE(SummedBatch::holds(input));
}

TEST(SummedBatch, HoldsNothingElse) {
  Random random(2);
  const Plain good = makeBlock(random, {5, 4, 6}, 1);
  ASSERT_TRUE(SummedBatch::holds(good.input()));
  const auto refuses = [&](const char* what, const std::function<void(Plain&)>& spoil) {
    Plain body = good;
    spoil(body);
    EXPECT_FALSE(SummedBatch::holds(body.input())) << what;
  };
  refuses("an uneven lattice", [&](Plain& b) {
    for (Vec3& p : b.model.rest) p += random.vector(0.05 * kSpacing);
  });
  refuses("a turned lattice", [](Plain& b) {
    for (Vec3& p : b.model.rest) p = Eigen::AngleAxisd(0.3, Vec3::UnitZ()) * p;
  });
  refuses("NaN", [](Plain& b) { b.model.rest[7].y() = std::numeric_limits<double>::quiet_NaN(); });
  refuses("two particles at a site", [](Plain& b) { b.model.rest[7] = b.model.rest[8]; });
  refuses("unequal weights", [](Plain& b) { b.model.clusters.weights[11] *= 1.01; });
  refuses("a weight that is NaN",
          [](Plain& b) { b.model.clusters.weights[11] = std::numeric_limits<double>::quiet_NaN(); });
  refuses("a cluster less", [](Plain& b) {
    b.model.clusters.members.resize(b.model.clusters.offsets[b.places.size() - 1]);
    b.model.clusters.offsets.pop_back();
  });
  refuses("a member twice, another not at all",
          [](Plain& b) { b.model.clusters.members[1] = b.model.clusters.members[0]; });
  refuses("a wider cluster among the others", [](Plain& b) {
    ClusterSet& set = b.model.clusters;
    Plain wide;
    wide.places = b.places;
    wide.model.rest = b.model.rest;
    wide.model.masses = b.model.masses;
    wide.finish(2);
    const Index last = static_cast<Index>(b.places.size()) - 1;
    set.members.resize(set.offsets[last]);
    for (Index k = wide.model.clusters.offsets[last]; k < wide.model.clusters.offsets[last + 1]; ++k)
      set.members.push_back(wide.model.clusters.members[k]);
    set.offsets[last + 1] = static_cast<Index>(set.members.size());
    set.weights.clear();
    std::vector<double> count(b.places.size(), 0.0);
    for (Index i : set.members) count[i] += 1.0;
    for (Index i : set.members) set.weights.push_back(1.0 / count[i]);
  });
  refuses("clusters around other particles than their own", [](Plain& b) {
    ClusterSet& set = b.model.clusters;
    std::vector<Index> first(set.members.begin() + set.offsets[0], set.members.begin() + set.offsets[1]);
    set.members.erase(set.members.begin(), set.members.begin() + set.offsets[1]);
    set.members.insert(set.members.end(), first.begin(), first.end());
    const Index size = static_cast<Index>(first.size());
    for (Index& o : set.offsets) o -= std::min(o, size);
    set.offsets.erase(set.offsets.begin());
    set.offsets.push_back(static_cast<Index>(set.members.size()));
    std::vector<double> count(b.places.size(), 0.0);
    for (Index i : set.members) count[i] += 1.0;
    for (std::size_t k = 0; k < set.members.size(); ++k) set.weights[k] = 1.0 / count[set.members[k]];
  });
}

struct Shape {
  const char* name;
  Sites size;
  int width, hole;
};
const Shape kShapes[] = {{"block", {9, 7, 8}, 1, 0},  {"wide", {9, 7, 8}, 2, 0},   {"wider", {7, 9, 8}, 3, 0},
                         {"all", {5, 4, 6}, 9, 0},    {"sheet", {11, 9, 1}, 1, 0}, {"flat", {1, 8, 9}, 2, 0},
                         {"holes", {9, 8, 7}, 1, 5},  {"sieve", {8, 8, 8}, 2, 3},  {"bar", {33, 3, 2}, 3, 0},
                         {"column", {2, 3, 33}, 4, 0}};

TEST(SummedBatch, GoalsAreTheReferences) {
  for (const Shape& shape : kShapes)
    for (MatchMode mode : {MatchMode::kRigid, MatchMode::kLinear})
      for (double strain : {0.0, 0.03, 0.3}) {
        Random random(13);
        Plain body = makeBlock(random, shape.size, shape.width, shape.hole);
        disturb(body, random, strain);
        for (Vec3& x : body.state.positions) x += Vec3(100.0, -50.0, 3.0);
        SummedBatch batch(body.input());
        std::vector<ClusterPose> poses = body.state.poses;
        Points goals, expected;
        MatchCounters counters, reference;
        batch.match(body.state.positions, mode, 0.7, poses, goals, counters);
        matchShapes(body.input(), body.state.positions, mode, 0.7, body.state.poses, expected, reference);
        EXPECT_LE(largestDistance(goals, expected), (strain < 0.1 ? 2e-7 : 1e-6) * body.size())
            << shape.name << strain << toString(mode);
        EXPECT_EQ(counters.rotations, reference.rotations);
        for (std::size_t c = 0; c < poses.size(); ++c)
          ASSERT_LE((poses[c].centre - body.state.poses[c].centre).norm(), 1e-7 * body.size()) << shape.name;
      }
}

// Goals of float are as far from the plain path's as those of sums over pairs are, or nearer.
TEST(SummedBatch, IsNotLessExactThanSumsOverPairs) {
  for (int width : {1, 2, 3}) {
    Random random(31);
    Plain body = makeBlock(random, {12, 12, 12}, width);
    disturb(body, random, 0.1);
    SummedBatch summed(body.input());
    OverlapBatch pairs(body.input());
    std::vector<ClusterPose> a = body.state.poses, b = a;
    Points by_sums, by_pairs, expected;
    MatchCounters counters;
    summed.match(body.state.positions, MatchMode::kLinear, 0.7, a, by_sums, counters);
    pairs.match(body.state.positions, MatchMode::kLinear, 0.7, b, by_pairs, counters);
    matchShapes(body.input(), body.state.positions, MatchMode::kLinear, 0.7, body.state.poses, expected, counters);
    EXPECT_LE(largestDistance(by_sums, expected), 1.5 * largestDistance(by_pairs, expected)) << width;
  }
}

TEST(SummedBatch, StepsAsTheReference) {
  for (InstructionSet set : sets())
    for (const Shape& shape : kShapes)
      for (MatchMode mode : {MatchMode::kRigid, MatchMode::kLinear}) {
        Random random(17);
        Plain body = makeBlock(random, shape.size, shape.width, shape.hole);
        disturb(body, random);
        const Material material = appearance(mode, 1.0);
        BatchStep step = batchStep(material, 1.0 / 120.0);
        step.set = set;
        SummedBatch batch(body.input());
        write(body, batch);
        MatchCounters counters;
        constexpr int kSteps = 40;
        for (int n = 0; n < kSteps; ++n) {
          batch.step(step, counters);
          body.step(material, step);
          if (n != 0 && n != kSteps - 1) continue;
          BodyState found = body.state;
          read(batch, found);
          const double fallen = 0.5 * step.gravity.norm() * std::pow(kSteps * step.h, 2.0);
          EXPECT_LE(largestDistance(found.positions, body.state.positions),
                    n == 0 ? 1e-7 * body.size() : 5e-6 * body.size() + 1e-6 * fallen)
              << shape.name << toString(mode) << n;
        }
        EXPECT_EQ(counters.rotations, kSteps * body.model.clusters.size());
        EXPECT_EQ(counters.linear_fits, mode == MatchMode::kRigid ? 0u : kSteps * body.model.clusters.size());
      }
}

TEST(SummedBatch, StaysWithTheReferenceOnTheGround) {
  Random random(19);
  Plain body = makeDumbbell(random, 2);
  disturb(body, random, 0.02);
  double lowest = 10.0;
  for (const Vec3& x : body.state.positions) lowest = std::min(lowest, x.z());
  const Material material = appearance(MatchMode::kLinear, 1.0);
  BatchStep step = batchStep(material, 1.0 / 120.0);
  step.ground = lowest - 0.01;
  MatchCounters counters;
  SummedBatch batch(body.input());
  write(body, batch);
  for (int n = 0; n < 150; ++n) {
    batch.step(step, counters);
    body.step(material, step);
    BodyState found = body.state;
    read(batch, found);
    ASSERT_LE(largestDistance(found.positions, body.state.positions), 1e-6 * body.size()) << n;
    body.state = found;  // a particle that touches one step sooner by rounding lets them part
  }
}

// [relative to the sum of the particles' amounts] what the batch adds to linear and angular momentum.
template <class Batch>
std::array<double, 2> drift(const Plain& body, const BatchStep& step, int steps) {
  Batch batch(body.input());
  write(body, batch);
  MatchCounters counters;
  for (int n = 0; n < steps; ++n) batch.step(step, counters);
  BodyState after = body.state;
  read(batch, after);
  const RigidMotion before = rigidMotionOf(body.model, body.state.positions, body.state.velocities);
  const RigidMotion now = rigidMotionOf(body.model, after.positions, after.velocities);
  Vec3 change = Vec3::Zero(), turning = Vec3::Zero();
  double movement = 0.0, levered = 0.0;
  for (std::size_t i = 0; i < body.model.rest.size(); ++i) {
    const double m = body.model.masses[i];
    const Vec3 r = body.state.positions[i] - before.centre, v = body.state.velocities[i];
    change += m * (after.velocities[i] - v);
    turning += m * ((after.positions[i] - now.centre).cross(after.velocities[i]) - r.cross(v));
    movement += m * v.norm();
    levered += m * r.norm() * v.norm();
  }
  return {change.norm() / movement, turning.norm() / levered};
}

TEST(SummedBatch, KeepsMomentum) {
  for (MatchMode mode : {MatchMode::kRigid, MatchMode::kLinear})
    for (std::uint32_t seed : {23u, 24u, 25u}) {
      Random random(seed);
      Plain body = makeBlock(random, {6, 7, 5}, 2, 6);
      disturb(body, random);
      constexpr int kSteps = 1000;
      for (double damping : {0.0, 20.0}) {
        BatchStep step = batchStep(appearance(mode, damping), 1.0 / 120.0);
        step.gravity.setZero();
        const auto summed = drift<SummedBatch>(body, step, kSteps), pairs = drift<OverlapBatch>(body, step, kSteps);
        EXPECT_LE(summed[0], 3e-8 * kSteps);
        EXPECT_LE(summed[1], 3e-8 * kSteps);
        EXPECT_LE(summed[0], 1.2 * pairs[0] + 1e-9 * kSteps);
      }
    }
}

TEST(SummedBatch, ThreadsAndHistoryLeaveNoTrace) {
  Random random(29);
  Plain body = makeBlock(random, {11, 10, 9}, 2, 7);
  disturb(body, random);
  BatchStep step = batchStep(appearance(MatchMode::kLinear, 1.0), 1.0 / 120.0);
  step.ground = 0.0;
  const auto backwards = [](std::size_t count, const std::function<void(std::size_t)>& work) {
    for (std::size_t i = count; i > 0; --i) work(i - 1);
  };
  const auto threads = [](std::size_t count, const std::function<void(std::size_t)>& work) {
    std::thread other([&] {
      for (std::size_t i = 1; i < count; i += 2) work(i);
    });
    for (std::size_t i = 0; i < count; i += 2) work(i);
    other.join();
  };
  SummedBatch batch(body.input());
  MatchCounters counters;
  BodyState expected = body.state;
  for (const ForEach& for_each : {ForEach(oneAfterAnother), ForEach(backwards), ForEach(threads)}) {
    write(body, batch);
    for (int n = 0; n < 30; ++n) batch.step(step, counters, for_each);
    BodyState found = body.state;
    read(batch, found);
    if (expected.positions == body.state.positions) expected = found;
    EXPECT_EQ(largestDistance(found.positions, expected.positions), 0.0);
    EXPECT_EQ(largestDistance(found.velocities, expected.velocities), 0.0);
  }
  EXPECT_GT(largestDistance(expected.positions, body.state.positions), 0.0);
}

// What is not finite reaches the clusters' particles, as in the plain path, and the step returns.
TEST(SummedBatch, SurvivesWhatIsNotFinite) {
  Random random(37);
  Plain body = makeBlock(random, {6, 6, 6}, 1);
  body.state.velocities[3].x() = std::numeric_limits<double>::infinity();
  SummedBatch batch(body.input());
  write(body, batch);
  MatchCounters counters;
  const BatchStep step = batchStep(appearance(MatchMode::kLinear, 1.0), 1.0 / 120.0);
  for (int n = 0; n < 3; ++n) batch.step(step, counters);
  EXPECT_EQ(counters.rotations, 3 * body.model.clusters.size());
  // Put back to rest, nothing of it is left.
  body.state.velocities[3].setZero();
  write(body, batch);
  BatchStep still = step;
  still.gravity.setZero();
  batch.step(still, counters);
  BodyState found = body.state;
  read(batch, found);
  EXPECT_LE(largestDistance(found.positions, body.model.rest), 1e-7 * body.size());
}

}  // namespace
}  // namespace meshless
