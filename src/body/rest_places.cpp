#include "meshless_surgery/body/rest_places.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "meshless_surgery/dynamics/rotation.h"
#include "meshless_surgery/geometry/nearest.h"

namespace meshless {
namespace {

constexpr std::size_t kParticles = 16;
constexpr std::size_t kKnown = 8;
constexpr double kSpanned = 1e-4;      // eigenvalue of the spread over the largest: flatter is not spanned
constexpr double kMostStretch = 10.0;  // of the map: beyond it the particles tell nothing about lengths

// The affine map of particles near p from the present shape to rest.
Vec3 mapped(const BodyModel& model, const BodyState& state, const std::vector<Index>& near, const Vec3& p) {
  Vec3 present = Vec3::Zero(), rest = Vec3::Zero();
  double total = 0.0;
  const double reach = 1.1 * (state.positions[near.back()] - p).norm() + 1e-300;
  std::vector<double> weight(near.size());
  for (std::size_t k = 0; k < near.size(); ++k) {
    const double ratio = (state.positions[near[k]] - p).norm() / reach;
    weight[k] = (1.0 - ratio * ratio) + 1e-3;
    total += weight[k];
    present += weight[k] * state.positions[near[k]];
    rest += weight[k] * model.rest[near[k]];
  }
  present /= total;
  rest /= total;
  Mat3 spread = Mat3::Zero(), cross = Mat3::Zero();
  for (std::size_t k = 0; k < near.size(); ++k) {
    const Vec3 a = state.positions[near[k]] - present, b = model.rest[near[k]] - rest;
    spread += weight[k] / total * a * a.transpose();
    cross += weight[k] / total * b * a.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(spread);
  const Vec3 values = solver.eigenvalues();
  if (!(values[2] > 0.0)) return rest + (p - present);
  const Mat3 rotation = nearestRotation(cross, Quat::Identity()).rotation.toRotationMatrix();
  Vec3 moved = Vec3::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3 direction = solver.eigenvectors().col(axis);
    Vec3 image = rotation * direction;
    if (values[axis] > kSpanned * values[2]) {
      const Vec3 fitted = cross * direction / values[axis];
      if (fitted.norm() < kMostStretch) image = fitted;
    }
    moved += direction.dot(p - present) * image;
  }
  return rest + moved;
}

}  // namespace

Points restPlaces(const BodyModel& model, const BodyState& state, const Points& present,
                  const std::vector<KnownPlace>& known) {
  Points places;
  if (present.empty()) return places;
  const NearestPoints particles(state.positions);
  const auto guess = [&](const Vec3& p) { return mapped(model, state, particles.nearest(p, kParticles), p); };
  Points known_at, missed;
  for (const KnownPlace& k : known) {
    known_at.push_back(k.present);
    missed.push_back(k.rest - guess(k.present));
  }
  const NearestPoints rim(known_at);
  for (const Vec3& p : present) {
    Vec3 residual = Vec3::Zero();
    double total = 0.0;
    for (Index k : rim.nearest(p, kKnown)) {
      const double w = 1.0 / ((known_at[k] - p).squaredNorm() + 1e-24);
      residual += w * missed[k];
      total += w;
    }
    places.push_back(guess(p) + (total > 0.0 ? Vec3(residual / total) : residual));
  }
  return places;
}

}  // namespace meshless
