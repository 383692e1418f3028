#include "meshless_surgery/dynamics/elastic.h"

#include <algorithm>
#include <cmath>

#include "elastic_law.h"
#include "rotation.h"

namespace meshless {
namespace {

constexpr double kHourglass = 0.3;  // stiffness of what is not affine, in units of E / s^2
constexpr int kPowerIterations = 60;

struct ClusterFit {
  Vec3 centre;
  Mat3 gradient;  // F, from the first rest shape
  Mat3 strained;  // from the one without stress
  Mat3 rotation;
  bool solid;
};

ClusterFit fit(const MatchInput& in, Index c, const Points& y, ClusterPose& pose, MatchCounters& counters) {
  const Index begin = in.clusters.offsets[c], end = in.clusters.offsets[c + 1];
  const ClusterRest& rest = in.shape.clusters[c];
  ClusterFit result;
  const Vec3 origin = y[in.clusters.members[begin]];
  Vec3 sum = Vec3::Zero();
  for (Index k = begin; k < end; ++k) {
    const Index i = in.clusters.members[k];
    sum += in.masses[i] * in.clusters.weights[k] * (y[i] - origin);
  }
  result.centre = origin + sum / rest.mass;
  Mat3 a = Mat3::Zero();
  for (Index k = begin; k < end; ++k) {
    const Index i = in.clusters.members[k];
    a += in.masses[i] * in.clusters.weights[k] * (y[i] - result.centre) * (in.rest[i] - rest.centre).transpose();
  }
  result.solid = rest.linear_rank;
  ++counters.clusters;
  ++counters.rotations;
  if (result.solid) {
    result.gradient = a * rest.moment_inverse;
    ++counters.linear_fits;
  } else {
    ++counters.rank_fallbacks;
  }
  const PlasticShape* const plastic = result.solid ? in.plasticShapeOf(c) : nullptr;
  result.strained = plastic ? Mat3(result.gradient * plastic->inverse) : result.gradient;
  const RotationResult found = nearestRotation(result.solid ? result.strained : a, pose.rotation);
  if (!found.warm) ++counters.cold_rotations;
  pose.centre = result.centre;
  pose.rotation = found.rotation;
  result.rotation = found.rotation.toRotationMatrix();
  if (!result.solid) result.gradient = result.rotation;
  pose.deformation = result.gradient;
  return result;
}

}  // namespace

ElasticParameters elasticParameters(double youngs_modulus, double poissons_ratio, double density) {
  ElasticParameters p;
  p.youngs = youngs_modulus;
  p.mu = youngs_modulus / (2.0 * (1.0 + poissons_ratio));
  p.lambda = youngs_modulus * poissons_ratio / ((1.0 + poissons_ratio) * (1.0 - 2.0 * poissons_ratio));
  p.density = density;
  return p;
}

RelaxationStep relaxationStep(const std::vector<Relaxation>& relaxation, double h) {
  RelaxationStep step;
  for (const Relaxation& branch : relaxation) {
    step.shares[step.branches] = branch.share;
    step.taken[step.branches] = -std::expm1(-h / branch.time);
    step.all += branch.share;
    ++step.branches;
  }
  return step;
}

std::vector<ElasticRest> makeElasticRest(const RestShape& shape) {
  std::vector<ElasticRest> elastic(shape.clusters.size());
  for (std::size_t c = 0; c < elastic.size(); ++c) {
    const ClusterRest& rest = shape.clusters[c];
    elastic[c].spread_inverse = rest.mass * rest.moment_inverse;
    elastic[c].spread = rest.radius * rest.radius / 3.0;
  }
  return elastic;
}

double elasticAccelerations(const MatchInput& in, const std::vector<ElasticRest>& elastic,
                            const ElasticParameters& material, const Points& y, std::vector<ClusterPose>& poses,
                            Points& accelerations, MatchCounters& counters, double swelling) {
  accelerations.assign(y.size(), Vec3::Zero());
  double most = 3.0;
  for (Index c = 0; c < in.clusters.size(); ++c) {
    const double spread = elastic[c].spread;
    if (!(spread > 0.0)) continue;  // one point: nothing to deform
    const ClusterFit f = fit(in, c, y, poses[c], counters);
    const Vec3& rest_centre = in.shape.clusters[c].centre;
    Mat3 pull = Mat3::Zero();
    double hourglass = material.youngs / (material.density * spread);
    if (f.solid) {
      const Mat3 strained = f.strained / swelling;
      double steepness = 3.0;
      pull = elastic_law::stress(material, strained, f.rotation, steepness);
      if (const PlasticShape* plastic = in.plasticShapeOf(c)) {
        pull *= plastic->inverse;
        steepness *= plastic->stiffening * plastic->stiffening;
      }
      most = std::max(most, steepness);
      pull *= elastic[c].spread_inverse / material.density;
      hourglass *= kHourglass;
    }
    for (Index k = in.clusters.offsets[c]; k < in.clusters.offsets[c + 1]; ++k) {
      const Index i = in.clusters.members[k];
      const Vec3 q = in.rest[i] - rest_centre;
      accelerations[i] -= in.clusters.weights[k] * (pull * q + hourglass * (y[i] - f.centre - f.gradient * q));
    }
  }
  return std::sqrt(most / 3.0);
}

double elasticEnergy(const MatchInput& in, const std::vector<ElasticRest>& elastic, const ElasticParameters& material,
                     const Points& y, std::vector<ClusterPose> poses) {
  double energy = 0.0;
  MatchCounters uncounted;
  for (Index c = 0; c < in.clusters.size(); ++c) {
    const double spread = elastic[c].spread;
    if (!(spread > 0.0)) continue;
    const ClusterFit f = fit(in, c, y, poses[c], uncounted);
    const ClusterRest& rest = in.shape.clusters[c];
    double hourglass = material.youngs / (material.density * spread);
    if (f.solid) {
      hourglass *= kHourglass;
      energy += rest.mass / material.density * elastic_law::energyDensity(material, f.strained, f.rotation);
    }
    for (Index k = in.clusters.offsets[c]; k < in.clusters.offsets[c + 1]; ++k) {
      const Index i = in.clusters.members[k];
      energy += 0.5 * hourglass * in.masses[i] * in.clusters.weights[k] *
                (y[i] - f.centre - f.gradient * (in.rest[i] - rest.centre)).squaredNorm();
    }
  }
  return energy;
}

double highestFrequency(const MatchInput& in, const std::vector<ElasticRest>& elastic,
                        const ElasticParameters& material) {
  const std::size_t n = in.rest.size();
  double size = 0.0;
  for (const ElasticRest& e : elastic) size = std::max(size, std::sqrt(e.spread));
  if (!(size > 0.0)) return 0.0;
  const double small = 1e-6 * size;
  Points mode(n), y(n), a;
  // Neighbours against each other, as the highest modes are, and something of every other mode.
  for (std::size_t i = 0; i < n; ++i) {
    const double t = static_cast<double>(i);
    mode[i] = Vec3(std::sin(1.0 + 12.9898 * t), std::sin(2.0 + 78.233 * t), std::sin(3.0 + 37.719 * t));
  }
  std::vector<ClusterPose> poses(in.clusters.size());
  MatchCounters uncounted;
  double squared = 0.0;
  for (int iteration = 0; iteration < kPowerIterations; ++iteration) {
    double norm = 0.0;
    for (std::size_t i = 0; i < n; ++i) norm += in.masses[i] * mode[i].squaredNorm();
    double mass = 0.0;
    for (double m : in.masses) mass += m;
    norm = std::sqrt(norm / mass);
    if (!(norm > 0.0)) return std::sqrt(squared);
    for (std::size_t i = 0; i < n; ++i) {
      mode[i] /= norm;
      y[i] = in.rest[i] + small * mode[i];
    }
    elasticAccelerations(in, elastic, material, y, poses, a, uncounted);
    double work = 0.0;
    for (std::size_t i = 0; i < n; ++i) work -= in.masses[i] * mode[i].dot(a[i]) / small;
    squared = work / mass;
    for (std::size_t i = 0; i < n; ++i) mode[i] = -a[i] / small;
  }
  return std::sqrt(std::max(0.0, squared));
}

}  // namespace meshless
