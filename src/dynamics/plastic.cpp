#include "meshless_surgery/dynamics/plastic.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace meshless {
namespace {

constexpr double kLeastVolume = 0.1;  // determinant of the deformation below which nothing flows
constexpr int kBisections = 40;

using Solver = Eigen::SelfAdjointEigenSolver<Mat3>;

Mat3 rebuilt(const Mat3& vectors, const Vec3& values) { return vectors * values.asDiagonal() * vectors.transpose(); }

double strainOf(const Vec3& logarithms) { return (logarithms.array().exp() - 1.0).matrix().norm(); }

// The largest share of the logarithms whose strain is within the maximum.
Vec3 bounded(const Vec3& logarithms, double maximum) {
  if (strainOf(logarithms) <= maximum) return logarithms;
  double low = 0.0, high = 1.0;
  for (int k = 0; k < kBisections; ++k) {
    const double middle = 0.5 * (low + high);
    (strainOf(middle * logarithms) <= maximum ? low : high) = middle;
  }
  return low * logarithms;
}

bool flowCluster(const Plasticity& plasticity, double share, ClusterPose& pose, PlasticShape& shape) {
  const Mat3 f = pose.deformation * shape.inverse;
  const double determinant = f.determinant();
  if (!(determinant > kLeastVolume)) return false;
  const Mat3 squared = f.transpose() * f / std::cbrt(determinant * determinant);
  // |S - 1| <= |S^2 - 1|: most clusters end here.
  if (!((squared - Mat3::Identity()).squaredNorm() > plasticity.yield * plasticity.yield)) return false;
  const Solver solver(squared);
  const Vec3 stretch = 0.5 * solver.eigenvalues().cwiseMax(1e-12).array().log();
  const double strain = strainOf(stretch);
  if (!(strain > plasticity.yield) || !std::isfinite(strain)) return false;
  const Vec3 left = bounded(stretch, plasticity.yield + (1.0 - share) * (strain - plasticity.yield));
  const Mat3 moved = rebuilt(solver.eigenvectors(), (stretch - left).array().exp()) * shape.stretch;
  const Solver polar(moved.transpose() * moved);
  const Vec3 free = 0.5 * polar.eigenvalues().cwiseMax(1e-12).array().log();
  const Vec3 deviatoric = free.array() - free.mean();
  const Mat3 turn = moved * rebuilt(polar.eigenvectors(), (-free).array().exp());
  const PlasticShape before = shape;
  shape = plasticShape(rebuilt(polar.eigenvectors(), bounded(deviatoric, plasticity.maximum)));
  pose.rotation = (pose.rotation * Quat(turn)).normalized();
  return (shape.stretch - before.stretch).squaredNorm() > 0.0;
}

}  // namespace

std::size_t flow(const Plasticity& plasticity, double h, const RestShape* rest, std::vector<ClusterPose>& poses,
                 std::vector<PlasticShape>& shapes) {
  const double share = 1.0 - std::exp(-h * plasticity.creep);
  if (!(share > 0.0) || !(plasticity.maximum > 0.0)) return 0;
  std::size_t flowed = 0;
  for (std::size_t c = 0; c < poses.size(); ++c) {
    if (rest && !rest->clusters[c].linear_rank) continue;
    PlasticShape shape;
    if (!shapes.empty()) shape = shapes[c];
    if (!flowCluster(plasticity, share, poses[c], shape)) continue;
    if (shapes.empty()) shapes.resize(poses.size());
    shapes[c] = shape;
    ++flowed;
  }
  return flowed;
}

PlasticShape plasticShape(const Mat3& logarithm) {
  const Solver solver(logarithm);
  const Vec3 values = solver.eigenvalues();
  PlasticShape shape;
  shape.stretch = rebuilt(solver.eigenvectors(), values.array().exp());
  shape.inverse = rebuilt(solver.eigenvectors(), (-values).array().exp());
  shape.stiffening = std::exp(-values.minCoeff());
  return shape;
}

}  // namespace meshless
