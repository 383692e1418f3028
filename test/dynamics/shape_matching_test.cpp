#include "meshless_surgery/dynamics/shape_matching.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace meshless {
namespace shape_matching_test {

using test::Random;

// Random particles with random masses in random overlapping clusters.
struct Cloud {
  Points rest;
  std::vector<double> masses;
  ClusterSet clusters;
  RestShape shape;
  std::vector<ClusterPose> poses;

  MatchInput input() const { return {rest, masses, clusters, shape}; }
  void finish() {
    shape = makeRestShape(rest, masses, clusters);
    addQuadraticRest(rest, masses, clusters, shape);
    poses.assign(clusters.size(), ClusterPose());
  }
};

Cloud randomCloud(Random& random, Index particles, Index clusters, const Vec3& stretch = Vec3::Ones()) {
  Cloud cloud;
  for (Index i = 0; i < particles; ++i) {
    cloud.rest.push_back(random.vector(1.0).cwiseProduct(stretch));
    cloud.masses.push_back(random.uniform(0.1, 2.0));
  }
  std::vector<std::vector<double>> share(clusters, std::vector<double>(particles, 0.0));
  for (Index i = 0; i < particles; ++i) {
    double total = 0.0;
    for (Index c = 0; c < clusters; ++c)
      if (c == i % clusters || random.uniform(0, 1) < 0.5) total += share[c][i] = random.uniform(0.1, 1.0);
    for (Index c = 0; c < clusters; ++c) share[c][i] /= total;
  }
  cloud.clusters.offsets.push_back(0);
  for (Index c = 0; c < clusters; ++c) {
    for (Index i = 0; i < particles; ++i)
      if (share[c][i] > 0.0) {
        cloud.clusters.members.push_back(i);
        cloud.clusters.weights.push_back(share[c][i]);
      }
    cloud.clusters.offsets.push_back(static_cast<Index>(cloud.clusters.members.size()));
  }
  cloud.finish();
  return cloud;
}

Points goalsOf(Cloud& cloud, const Points& y, MatchMode mode, double beta, MatchCounters* counters = nullptr) {
  Points goals;
  MatchCounters mine;
  matchShapes(cloud.input(), y, mode, beta, cloud.poses, goals, counters ? *counters : mine);
  return goals;
}

const MatchMode kModes[] = {MatchMode::kRigid, MatchMode::kLinear, MatchMode::kQuadratic};

TEST(MatchShapes, ARigidMotionIsItsOwnGoalInEveryModeFarAwayToo) {
  Random random(1);
  for (const Vec3& far : {Vec3(0, 0, 0), Vec3(1000, -500, 200)})
    for (MatchMode mode : kModes)
      for (double beta : {0.0, 0.4, 1.0}) {
        Cloud cloud = randomCloud(random, 60, 4);
        const Quat turn = random.rotation();
        Points y;
        for (const Vec3& q : cloud.rest) y.push_back(turn * q + far);
        const Points goals = goalsOf(cloud, y, mode, beta);
        for (std::size_t i = 0; i < y.size(); ++i) EXPECT_LT((goals[i] - y[i]).norm(), 1e-11 * (1.0 + far.norm()));
      }
}

TEST(MatchShapes, AnyVolumeKeepingAffineFieldIsReproducedByLinearAndAnyQuadraticFieldByQuadratic) {
  Random random(2);
  for (int round = 0; round < 20; ++round)
    for (double scale : {1e-6, 1.0, 1e6}) {
      Cloud cloud = randomCloud(random, 80, round % 2 ? 1 : 3);
      for (Vec3& q : cloud.rest) q *= scale;
      cloud.finish();
      Mat3 map = Mat3::Identity() + random.matrix(0.3);
      map /= std::cbrt(map.determinant());
      const Vec3 shift = random.vector(scale);
      Points y;
      for (const Vec3& q : cloud.rest) y.push_back(map * q + shift);
      const Points linear = goalsOf(cloud, y, MatchMode::kLinear, 1.0);
      for (std::size_t i = 0; i < y.size(); ++i) EXPECT_LT((linear[i] - y[i]).norm(), 1e-12 * scale * 10);

      Mat39 quadratic;
      quadratic << map, Eigen::Matrix<double, 3, 6>::Zero();
      for (int k = 0; k < 18; ++k) quadratic(k / 6, 3 + k % 6) = random.uniform(-0.05, 0.05);
      for (std::size_t i = 0; i < y.size(); ++i) {
        const Vec3 q = cloud.rest[i] / scale;
        Vec9 b;
        b << q.x(), q.y(), q.z(), q.x() * q.x(), q.y() * q.y(), q.z() * q.z(), q.x() * q.y(), q.y() * q.z(),
            q.z() * q.x();
        y[i] = scale * (quadratic * b) + shift;
      }
      const Points goals = goalsOf(cloud, y, MatchMode::kQuadratic, 1.0);
      for (std::size_t i = 0; i < y.size(); ++i) EXPECT_LT((goals[i] - y[i]).norm(), 1e-12 * scale * 10);
    }
}

// What is moved along u and then along v is to cost what it costs the other way round: else a way round brings energy.
TEST(MatchShapes, ThePullOfAFittedGoalIsNearlyAGradient) {
  Random random(4);
  double worst = 0.0;
  for (int round = 0; round < 200; ++round) {
    Cloud cloud = randomCloud(random, 40, 1);
    const Mat3 map = Mat3::Identity() + random.matrix(0.4);
    if (!(map.determinant() > 0.3)) continue;
    const Mat3 by_u = random.matrix(1.0), by_v = random.matrix(1.0);
    Points y, u, v;
    for (const Vec3& q : cloud.rest) {
      y.push_back(map * q);
      u.push_back(by_u * q);
      v.push_back(by_v * q);
    }
    const auto slope = [&](const Points& along, const Points& of) {
      constexpr double kStep = 1e-5;
      double sum = 0.0;
      for (const double side : {1.0, -1.0}) {
        Points there = y;
        for (std::size_t i = 0; i < y.size(); ++i) there[i] += side * kStep * along[i];
        const Points goals = goalsOf(cloud, there, MatchMode::kLinear, 1.0);
        for (std::size_t i = 0; i < y.size(); ++i)
          sum += side * cloud.masses[i] * of[i].dot(goals[i] - there[i]) / (2.0 * kStep);
      }
      return sum;
    };
    double length_u = 0.0, length_v = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i) {
      length_u += cloud.masses[i] * u[i].squaredNorm();
      length_v += cloud.masses[i] * v[i].squaredNorm();
    }
    worst = std::max(worst, std::abs(slope(u, v) - slope(v, u)) / std::sqrt(length_u * length_v));
  }
  EXPECT_LT(worst, 0.2);  // 0.11; A / cbrt(det A) has 0.62
}

TEST(MatchShapes, ThePullHasNeitherForceNorTorque) {
  Random random(3);
  for (int round = 0; round < 60; ++round)
    for (MatchMode mode : kModes) {
      // Flat, collinear and inverted clouds among them: the fallbacks must keep momentum too.
      const Vec3 stretch = round % 4 == 0 ? Vec3(1, 1, 0) : round % 4 == 1 ? Vec3(1, 0, 0) : Vec3::Ones();
      Cloud cloud = randomCloud(random, 40, 1 + static_cast<Index>(round % 5), stretch);
      const Mat3 map = random.matrix(1.0);
      Points y;
      for (const Vec3& q : cloud.rest) y.push_back(map * q + random.vector(0.5));
      const Points goals = goalsOf(cloud, y, mode, random.uniform(0, 1));
      Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
      double size = 0.0;
      for (std::size_t i = 0; i < y.size(); ++i) {
        const Vec3 pull = cloud.masses[i] * (goals[i] - y[i]);
        ASSERT_TRUE(pull.allFinite());
        force += pull;
        torque += y[i].cross(pull);
        size += pull.norm();
      }
      EXPECT_LT(force.norm(), 1e-12 * (1.0 + size));
      EXPECT_LT(torque.norm(), 1e-11 * (1.0 + size));
    }
}

TEST(MatchShapes, DeficientRankFallsBackAndCounts) {
  Random random(4);
  MatchCounters counters;
  Cloud flat = randomCloud(random, 30, 1, Vec3(1, 1, 0));
  EXPECT_FALSE(flat.shape.clusters[0].linear_rank);
  for (MatchMode mode : kModes) goalsOf(flat, flat.rest, mode, 0.5, &counters);
  EXPECT_EQ(counters.linear_fits, 0u);
  EXPECT_EQ(counters.quadratic_moments, 0u);
  EXPECT_EQ(counters.rank_fallbacks, 2u);

  Cloud few = randomCloud(random, 6, 1);  // enough for a linear map, not for a quadratic one
  EXPECT_TRUE(few.shape.clusters[0].linear_rank);
  EXPECT_FALSE(few.shape.clusters[0].quadratic_rank);
  counters = MatchCounters();
  goalsOf(few, few.rest, MatchMode::kQuadratic, 0.5, &counters);
  EXPECT_EQ(counters.linear_fits, 1u);
  EXPECT_EQ(counters.quadratic_moments, 0u);

  for (Index n : {1u, 2u, 3u}) {  // crumbs
    Cloud crumb = randomCloud(random, n, 1);
    Points y = crumb.rest;
    for (Vec3& p : y) p += Vec3(1, 2, 3);
    for (MatchMode mode : kModes) {
      const Points goals = goalsOf(crumb, y, mode, 1.0);
      for (Index i = 0; i < n; ++i) EXPECT_LT((goals[i] - y[i]).norm(), 1e-12);
    }
  }
  Cloud coincident = randomCloud(random, 5, 1, Vec3(0, 0, 0));
  for (MatchMode mode : kModes)
    for (const Vec3& g : goalsOf(coincident, coincident.rest, mode, 1.0)) EXPECT_TRUE(g.allFinite());
}

TEST(MatchShapes, AnInvertedClusterIsPulledBackByItsRotationAlone) {
  Random random(5);
  Cloud cloud = randomCloud(random, 60, 1);
  Points y;
  for (const Vec3& q : cloud.rest) y.push_back(Vec3(q.x(), q.y(), -0.8 * q.z()));
  const Points rigid = goalsOf(cloud, y, MatchMode::kRigid, 0.0);
  const Points linear = goalsOf(cloud, y, MatchMode::kLinear, 1.0);
  for (std::size_t i = 0; i < y.size(); ++i) EXPECT_LT((rigid[i] - linear[i]).norm(), 1e-9);
}

TEST(MatchShapes, WhatIsNotNeededIsNotFormed) {
  Random random(6);
  Cloud cloud = randomCloud(random, 60, 3);
  MatchCounters counters;
  goalsOf(cloud, cloud.rest, MatchMode::kRigid, 1.0, &counters);
  goalsOf(cloud, cloud.rest, MatchMode::kQuadratic, 0.0, &counters);
  EXPECT_EQ(counters.linear_fits, 0u);
  EXPECT_EQ(counters.quadratic_moments, 0u);
  EXPECT_EQ(counters.clusters, 6u);
  goalsOf(cloud, cloud.rest, MatchMode::kLinear, 0.5, &counters);
  EXPECT_EQ(counters.linear_fits, 3u);
  EXPECT_EQ(counters.quadratic_moments, 0u);
}

}  // namespace shape_matching_test
}  // namespace meshless
