#include "meshless_surgery/dynamics/shape_matching.h"

#include <cmath>

#include <Eigen/Eigenvalues>

#include "cofactor.h"
#include "rotation.h"

namespace meshless {
namespace {

constexpr double kLinearRankRatio = 1e-8;     // of the moment's eigenvalues, smallest to largest
constexpr double kQuadraticRankRatio = 1e-7;  // of the basis in units of the cluster's size
constexpr double kSpannedRatio = 0.03;        // of the moment's eigenvalues: what is flatter tells no stretch across it
constexpr int kVolumeSteps = 4;               // of Newton, towards determinant 1
constexpr double kLeastSlope = 1e-3;          // of the first step's
constexpr double kFullBetaDeterminant = 0.1;  // below it the fitted map fades out, at 0 only the rotation is left

// A, led to determinant 1 along the gradient of the determinant: near A in the metric of the particles, and so without
// torque. A / cbrt(det A) is no gradient and feeds energy in.
Mat3 withVolumeOfRest(const Mat3& a, double determinant, const Mat3& moment_inverse) {
  if (!(determinant > 0.0)) return a;
  const Mat3 cofactors = cofactor(a), towards = cofactors * moment_inverse;
  const Mat3 gradient = towards / cofactors.cwiseProduct(towards).sum(), second = cofactor(gradient);
  // det (A - t G) is a cubic, convex up to its first root: Newton's method passes it at most in its first step.
  const double c2 = std::max(0.0, a.cwiseProduct(second).sum()), c3 = std::max(0.0, gradient.row(0).dot(second.row(0)));
  const double target = std::min(1.0, determinant / kFullBetaDeterminant);
  double t = 0.0;
  for (int n = 0; n < kVolumeSteps; ++n) {
    const double value = determinant - t * (1.0 - t * (c2 - t * c3)), slope = 1.0 - t * (2.0 * c2 - 3.0 * t * c3);
    t += (value - target) / std::max(slope, kLeastSlope);
  }
  return a - t * gradient;
}

Vec9 quadraticBasis(const Vec3& q) {
  Vec9 b;
  b << q.x(), q.y(), q.z(), q.x() * q.x(), q.y() * q.y(), q.z() * q.z(), q.x() * q.y(), q.y() * q.z(), q.z() * q.x();
  return b;
}

struct Moments {
  Vec3 centre;  // [m]
  Mat3 cross;   // [kg m^2] C
};

// In one pass, in numbers of their own instead of matrices: four times as fast. Places count from the
// first member: as rest shapes are about their centre, what C is about does not matter.
Moments momentsOf(const MatchInput& in, Index c, const Points& y) {
  const ClusterRest& rest = in.shape.clusters[c];
  const Index begin = in.clusters.offsets[c], end = in.clusters.offsets[c + 1];
  const Vec3 origin = y[in.clusters.members[begin]], middle = rest.centre;
  double sx = 0.0, sy = 0.0, sz = 0.0;
  double xx = 0.0, xy = 0.0, xz = 0.0, yx = 0.0, yy = 0.0, yz = 0.0, zx = 0.0, zy = 0.0, zz = 0.0;
  for (Index k = begin; k < end; ++k) {
    const Index i = in.clusters.members[k];
    const double m = in.masses[i] * in.clusters.weights[k];
    const double qx = in.rest[i].x() - middle.x(), qy = in.rest[i].y() - middle.y(), qz = in.rest[i].z() - middle.z();
    const double px = m * (y[i].x() - origin.x()), py = m * (y[i].y() - origin.y()), pz = m * (y[i].z() - origin.z());
    sx += px, sy += py, sz += pz;
    xx += px * qx, xy += px * qy, xz += px * qz;
    yx += py * qx, yy += py * qy, yz += py * qz;
    zx += pz * qx, zy += pz * qy, zz += pz * qz;
  }
  Moments moments;
  moments.centre = origin + Vec3(sx, sy, sz) / rest.mass;
  moments.cross << xx, xy, xz, yx, yy, yz, zx, zy, zz;
  return moments;
}

// Centre, rotation and best affine fit; the counters say what it took.
void fitCluster(const MatchInput& in, Index c, const Points& y, bool affine, ClusterPose& pose,
                MatchCounters& counters) {
  const ClusterRest& rest = in.shape.clusters[c];
  const Moments moments = momentsOf(in, c, y);
  pose.centre = moments.centre;
  const Mat3& a = moments.cross;
  const PlasticShape* const plastic = in.plasticShapeOf(c);
  const RotationResult found = nearestRotation(plastic ? Mat3(a * plastic->stretch) : a, pose.rotation);
  pose.rotation = found.rotation;
  ++counters.rotations;
  if (!found.warm) ++counters.cold_rotations;
  if (!found.unique) ++counters.rank_fallbacks;
  if (affine && rest.linear_rank) {
    pose.deformation = a * rest.moment_inverse;
    ++counters.linear_fits;
  } else {
    pose.deformation = pose.rotation.toRotationMatrix();
    if (plastic) pose.deformation *= plastic->stretch;
    if (affine) ++counters.rank_fallbacks;
  }
}

}  // namespace

MatchCounters& MatchCounters::operator+=(const MatchCounters& other) {
  clusters += other.clusters;
  rotations += other.rotations;
  cold_rotations += other.cold_rotations;
  linear_fits += other.linear_fits;
  quadratic_moments += other.quadratic_moments;
  plastic_flows += other.plastic_flows;
  rank_fallbacks += other.rank_fallbacks;
  return *this;
}

RestShape makeRestShape(const Points& rest, const std::vector<double>& masses, const ClusterSet& clusters) {
  RestShape shape;
  shape.clusters.resize(clusters.size());
  for (Index c = 0; c < clusters.size(); ++c) {
    ClusterRest& r = shape.clusters[c];
    const Vec3 origin = rest[clusters.members[clusters.offsets[c]]];
    Vec3 sum = Vec3::Zero();
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
      const Index i = clusters.members[k];
      const double m = masses[i] * clusters.weights[k];
      r.mass += m;
      sum += m * (rest[i] - origin);
    }
    r.centre = origin + sum / r.mass;
    Mat3 moment = Mat3::Zero();
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
      const Index i = clusters.members[k];
      const Vec3 q = rest[i] - r.centre;
      moment += (masses[i] * clusters.weights[k]) * q * q.transpose();
    }
    r.radius = std::sqrt(moment.trace() / r.mass);
    const double scale = moment.trace();
    if (!(scale > 0.0)) continue;
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(moment / scale);
    r.linear_rank = solver.eigenvalues()[0] > kLinearRankRatio * solver.eigenvalues()[2];
    if (r.linear_rank)
      r.moment_inverse = solver.eigenvectors() * solver.eigenvalues().cwiseInverse().asDiagonal() *
                         solver.eigenvectors().transpose() / scale;
  }
  return shape;
}

void addQuadraticRest(const Points& rest, const std::vector<double>& masses, const ClusterSet& clusters,
                      RestShape& shape) {
  shape.quadratic.assign(clusters.size(), QuadraticRest());
  for (Index c = 0; c < clusters.size(); ++c) {
    ClusterRest& r = shape.clusters[c];
    QuadraticRest& quadratic = shape.quadratic[c];
    r.quadratic_rank = false;
    if (!r.linear_rank) continue;
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
      const Index i = clusters.members[k];
      quadratic.mean += (masses[i] * clusters.weights[k] / r.mass) * quadraticBasis((rest[i] - r.centre) / r.radius);
    }
    Mat9 moment = Mat9::Zero();
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
      const Index i = clusters.members[k];
      const Vec9 b = quadraticBasis((rest[i] - r.centre) / r.radius) - quadratic.mean;
      moment += (masses[i] * clusters.weights[k]) * b * b.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Mat9> solver(moment / r.mass);
    r.quadratic_rank = solver.eigenvalues()[0] > kQuadraticRankRatio * solver.eigenvalues()[8];
    if (r.quadratic_rank)
      quadratic.moment_inverse = solver.eigenvectors() * solver.eigenvalues().cwiseInverse().asDiagonal() *
                                 solver.eigenvectors().transpose() / r.mass;
  }
}

namespace {

// A cluster that is farther from its goals, by the root of the mean square, than it reaches along an axis of space does
// not know the way out of that: its goals draw by as much as at that distance, and the rest of each particle's pull is
// lost, to be given to the body as a whole.
template <class Goal>
void addGoals(const MatchInput& in, Index c, const Points& y, Points& goals, std::vector<double>& lost,
              const Goal& goal) {
  const ClusterRest& rest = in.shape.clusters[c];
  const Index begin = in.clusters.offsets[c], end = in.clusters.offsets[c + 1];
  double off = 0.0;
  for (Index k = begin; k < end; ++k) {
    const Index i = in.clusters.members[k];
    const Vec3 to = goal(i);
    off += in.masses[i] * in.clusters.weights[k] * (to - y[i]).squaredNorm();
    goals[i] += in.clusters.weights[k] * to;
  }
  const double known = rest.mass * rest.radius * rest.radius / 3.0;
  if (!(off > known) || in.clusters.size() == 1) return;
  lost.resize(y.size(), 0.0);
  for (Index k = begin; k < end; ++k) {
    const Index i = in.clusters.members[k];
    const double share = in.clusters.weights[k] * (1.0 - known / off);
    lost[i] += share;
    goals[i] += share * (y[i] - goal(i));
  }
}

// To where the rest shape, moved as a whole to fit them best, has what clusters have lost.
void addGoalsOfTheWhole(const MatchInput& in, const Points& y, const std::vector<double>& lost, const Quat& start,
                        double swelling, Points& goals) {
  double mass = 0.0;
  Vec3 centre = Vec3::Zero(), rest_centre = Vec3::Zero();
  for (std::size_t i = 0; i < y.size(); ++i) {
    const double m = in.masses[i] * lost[i];
    mass += m;
    centre += m * (y[i] - y[0]);
    rest_centre += m * (in.rest[i] - in.rest[0]);
  }
  if (!(mass > 0.0)) return;
  centre = y[0] + centre / mass;
  rest_centre = in.rest[0] + rest_centre / mass;
  Mat3 moment = Mat3::Zero();
  for (std::size_t i = 0; i < y.size(); ++i)
    moment += in.masses[i] * lost[i] * (y[i] - centre) * (in.rest[i] - rest_centre).transpose();
  const Mat3 rotation = nearestRotationExact(moment, start).rotation.toRotationMatrix();
  for (std::size_t i = 0; i < y.size(); ++i)
    goals[i] += lost[i] * (centre + swelling * (rotation * (in.rest[i] - rest_centre)) - y[i]);
}

}  // namespace

void matchShapes(const MatchInput& in, const Points& y, MatchMode mode, double beta, std::vector<ClusterPose>& poses,
                 Points& goals, MatchCounters& counters, double swelling, bool deformations) {
  goals.assign(y.size(), Vec3::Zero());
  const bool wants_fit = mode != MatchMode::kRigid && beta > 0.0;
  std::vector<double> lost;  // of each particle's pull, 0..1; empty where none is
  for (Index c = 0; c < in.clusters.size(); ++c) {
    const ClusterRest& rest = in.shape.clusters[c];
    ClusterPose& pose = poses[c];
    ++counters.clusters;
    fitCluster(in, c, y, wants_fit || deformations, pose, counters);
    Mat3 rotation = pose.rotation.toRotationMatrix();
    if (const PlasticShape* plastic = in.plasticShapeOf(c)) rotation *= plastic->stretch;
    Mat3 map = rotation;
    double share = 0.0;  // of the fitted map; less than beta where the cluster is nearly flat or inverted
    if (wants_fit && rest.linear_rank) {
      const double determinant = pose.deformation.determinant();
      share = beta * std::min(1.0, std::max(0.0, determinant / kFullBetaDeterminant));
      if (!(share > 0.0)) ++counters.rank_fallbacks;
      map = share * withVolumeOfRest(pose.deformation, determinant, rest.moment_inverse) + (1.0 - share) * rotation;
    }
    const Index begin = in.clusters.offsets[c], end = in.clusters.offsets[c + 1];
    if (mode == MatchMode::kQuadratic && share > 0.0 && !rest.quadratic_rank) ++counters.rank_fallbacks;
    if (mode == MatchMode::kQuadratic && share > 0.0 && rest.quadratic_rank) {
      const QuadraticRest& quadratic = in.shape.quadratic[c];
      ++counters.quadratic_moments;
      Mat39 moment = Mat39::Zero();
      for (Index k = begin; k < end; ++k) {
        const Index i = in.clusters.members[k];
        const Vec9 b = quadraticBasis((in.rest[i] - rest.centre) / rest.radius) - quadratic.mean;
        moment += (in.masses[i] * in.clusters.weights[k]) * (y[i] - pose.centre) * b.transpose();
      }
      const Mat39 fit = share * moment * quadratic.moment_inverse;
      addGoals(in, c, y, goals, lost, [&](Index i) -> Vec3 {
        const Vec3 q = in.rest[i] - rest.centre;
        const Vec9 b = quadraticBasis(q / rest.radius) - quadratic.mean;
        return pose.centre + swelling * (fit * b + (1.0 - share) * (rotation * q));
      });
    } else {
      addGoals(in, c, y, goals, lost,
               [&](Index i) -> Vec3 { return pose.centre + swelling * (map * (in.rest[i] - rest.centre)); });
    }
  }
  if (!lost.empty()) addGoalsOfTheWhole(in, y, lost, poses[0].rotation, swelling, goals);
}

void fitClusters(const MatchInput& in, const Points& positions, const std::vector<Index>& which,
                 std::vector<ClusterPose>& poses) {
  MatchCounters uncounted;
  for (Index c : which) {
    ClusterPose& pose = poses[c];
    fitCluster(in, c, positions, true, pose, uncounted);
    if (!in.shape.clusters[c].linear_rank) continue;
    const PlasticShape* const plastic = in.plasticShapeOf(c);
    const Mat3 turn = pose.rotation.toRotationMatrix() * (plastic ? plastic->stretch : Mat3(Mat3::Identity()));
    const Eigen::SelfAdjointEigenSolver<Mat3> inverse(in.shape.clusters[c].moment_inverse);  // the widest first
    for (int axis = 1; axis < 3; ++axis) {
      if (inverse.eigenvalues()[0] > kSpannedRatio * inverse.eigenvalues()[axis]) continue;
      const Vec3 across = inverse.eigenvectors().col(axis);
      pose.deformation += (turn - pose.deformation) * across * across.transpose();
    }
  }
}

void fitClusters(const MatchInput& in, const Points& positions, std::vector<ClusterPose>& poses) {
  MatchCounters uncounted;
  for (Index c = 0; c < in.clusters.size(); ++c) fitCluster(in, c, positions, true, poses[c], uncounted);
}

}  // namespace meshless
