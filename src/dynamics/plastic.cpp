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

std::size_t flow(const MatchInput& in, const Plasticity& plasticity, double h, std::vector<ClusterPose>& poses,
                 std::vector<PlasticShape>& shapes) {
  const double share = 1.0 - std::exp(-h * plasticity.creep);
  if (!(share > 0.0) || !(plasticity.maximum > 0.0)) return 0;
  std::size_t flowed = 0;
  for (Index c = 0; c < in.clusters.size(); ++c) {
    if (!in.shape.clusters[c].linear_rank) continue;
    PlasticShape shape;
    if (!shapes.empty()) shape = shapes[c];
    if (!flowCluster(plasticity, share, poses[c], shape)) continue;
    if (shapes.empty()) shapes.resize(in.clusters.size());
    shapes[c] = shape;
    ++flowed;
  }
  return flowed;
}

Mat3 logarithm(const PlasticShape& shape) {
  const Solver solver(shape.stretch);
  return rebuilt(solver.eigenvectors(), solver.eigenvalues().array().log());
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

std::vector<PlasticShape> inheritShapes(const std::vector<PlasticShape>& parent, const ClusterSet& parent_clusters,
                                        const ClusterSet& clusters, const std::vector<Index>& origin,
                                        const std::vector<Index>& parent_particles) {
  std::vector<PlasticShape> shapes;
  if (parent.empty()) return shapes;
  std::vector<Mat3> of_particles;
  const auto formParticles = [&] {
    Index count = 0;
    for (Index i : parent_clusters.members) count = std::max(count, i + 1);
    of_particles.assign(count, Mat3::Zero());
    for (Index c = 0; c < parent_clusters.size(); ++c) {
      const Mat3 l = logarithm(parent[c]);
      for (Index k = parent_clusters.offsets[c]; k < parent_clusters.offsets[c + 1]; ++k)
        of_particles[parent_clusters.members[k]] += parent_clusters.weights[k] * l;
    }
  };
  for (Index c = 0; c < clusters.size(); ++c) {
    if (origin[c] != kNoIndex) {
      shapes.push_back(parent[origin[c]]);
      continue;
    }
    if (of_particles.empty()) formParticles();
    Mat3 sum = Mat3::Zero();
    double count = 0.0;
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
      const Index i = parent_particles[clusters.members[k]];
      if (i == kNoIndex) continue;
      sum += of_particles[i];
      count += 1.0;
    }
    shapes.push_back(plasticShape(count > 0.0 ? Mat3(sum / count) : sum));
  }
  return shapes;
}

}  // namespace meshless
