#include "meshless_surgery/body/unwind.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/dynamics/rotation.h"

namespace meshless {
namespace {

constexpr double kHalfMostTurn = M_PI / 3.0;  // [rad] half of what clusters may be turned against their neighbours
constexpr double kSlow = 0.05;                // [1/s] times its radius: root mean square speed of what deforms
constexpr double kTime = 0.1;                 // [s] in which what is wrong falls to 1/e
constexpr double kThere = 0.02;               // of the radius, farthest particle

// Of the rest shape: root of the mean square distance from its centre [m], and that centre.
struct RestWhole {
  Vec3 centre = Vec3::Zero();
  double radius = 0.0;
};

RestWhole restWholeOf(const BodyModel& model) {
  RestWhole whole;
  for (std::size_t i = 0; i < model.rest.size(); ++i) whole.centre += model.masses[i] / model.mass * model.rest[i];
  double squared = 0.0;
  for (std::size_t i = 0; i < model.rest.size(); ++i)
    squared += model.masses[i] / model.mass * (model.rest[i] - whole.centre).squaredNorm();
  whole.radius = std::sqrt(squared);
  return whole;
}

// cos of half the angle between two orientations.
double halfTurn(const Quat& a, const Quat& b) { return std::abs(a.dot(b)); }

bool neighboursTurned(const BodyModel& model, const BodyState& state) {
  const ClusterSet& clusters = model.clusters;
  std::vector<std::vector<Index>> of_particle(model.rest.size());
  for (Index c = 0; c < clusters.size(); ++c)
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
      std::vector<Index>& others = of_particle[clusters.members[k]];
      for (Index other : others)
        if (halfTurn(state.poses[c].rotation, state.poses[other].rotation) < std::cos(kHalfMostTurn)) return true;
      others.push_back(c);
    }
  return false;
}

bool isSlow(const BodyModel& model, const BodyState& state) {
  const RigidMotion together = rigidMotionOf(model, state.positions, state.velocities);
  double squared = 0.0;
  for (std::size_t i = 0; i < state.velocities.size(); ++i) {
    const Vec3 rigid = together.velocity + together.spin.cross(state.positions[i] - together.centre);
    squared += model.masses[i] / model.mass * (state.velocities[i] - rigid).squaredNorm();
  }
  return squared <= std::pow(kSlow * restWholeOf(model).radius, 2);
}

}  // namespace

bool isWoundUp(const BodyModel& model, const Material& material, const BodyState& state) {
  if (state.poses.size() < 2 || model.any_fixed || material.plastic() || !state.plastic.empty() || !state.eased.empty())
    return false;
  // Where all are within half of that of the first, no two are farther apart.
  const Quat& first = state.poses.front().rotation;
  const double near = std::cos(0.5 * kHalfMostTurn);
  if (std::all_of(state.poses.begin(), state.poses.end(),
                  [&](const ClusterPose& pose) { return halfTurn(first, pose.rotation) > near; }))
    return false;
  return isSlow(model, state) && neighboursTurned(model, state);
}

void unwind(const BodyModel& model, const Vec3& gravity, double h, BodyState& state, StepScratch& scratch) {
  Points& x = state.positions;
  Points& v = state.velocities;
  const RigidMotion before = rigidMotionOf(model, x, v);
  const RestWhole rest = restWholeOf(model);
  Mat3 moment = Mat3::Zero();
  for (std::size_t i = 0; i < x.size(); ++i)
    moment += model.masses[i] * (x[i] - before.centre) * (model.rest[i] - rest.centre).transpose();
  // Nearest to the rotation of before: where several are equally near, it stays with one.
  const Quat turn = nearestRotation(moment, state.poses.front().rotation).rotation;
  const double share = 1.0 - std::exp(-h / kTime);
  double farthest = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vec3 way = before.centre + turn * (model.rest[i] - rest.centre) - x[i];
    farthest = std::max(farthest, way.squaredNorm());
    x[i] += share * way;
  }
  // The momentum that it had, in the shape that it has now.
  scratch.previous = x;
  const Vec3 spin = spinWith(model, x, before.angular_momentum);
  for (std::size_t i = 0; i < x.size(); ++i) {
    v[i] = before.velocity + spin.cross(x[i] - before.centre) + h * gravity;
    x[i] += h * v[i];
  }
  for (ClusterPose& pose : state.poses) pose.rotation = turn;
  state.unwinding = farthest > std::pow(kThere * rest.radius, 2);
}

}  // namespace meshless
