#include "meshless_surgery/dynamics/elastic_cells.h"

#include <algorithm>
#include <cmath>

#include "elastic_law.h"
#include "lanczos.h"
#include "rotation.h"

namespace meshless {
namespace {

// Of the trilinear map about the centroid, each the coefficient of the product of the coordinates whose bits are set:
// 0 the centroid itself, 1, 2 and 4 the gradient's columns, the others hourglass modes.
struct Coefficients {
  Vec3 of[8];

  Vec3& operator[](int k) { return of[k]; }
  const Vec3& operator[](int k) const { return of[k]; }
};

// Axis by axis the two ends become their weighted mean and half their difference.
Coefficients coefficientsOf(const ElasticCell& cell, const Points& y, const Vec3& origin) {
  Coefficients a;
  for (int k = 0; k < 8; ++k) a[k] = y[cell.corners[k]] - origin;
  for (int axis = 0; axis < 3; ++axis)
    for (int k = 0; k < 8; ++k) {
      if (k >> axis & 1) continue;
      Vec3 &low = a[k], &high = a[k | 1 << axis];
      const Vec3 difference = 0.5 * (high - low);
      low = 0.5 * (low + high) + cell.centroid[axis] * difference;
      high = difference;
    }
  return a;
}

// The transpose: what works on coefficients, as forces on the corners.
void addForces(const ElasticCell& cell, Coefficients f, Points& forces) {
  for (int axis = 0; axis < 3; ++axis)
    for (int k = 0; k < 8; ++k) {
      if (k >> axis & 1) continue;
      Vec3 &mean = f[k], &difference = f[k | 1 << axis];
      const Vec3 apart = 0.5 * (cell.centroid[axis] * mean + difference), half = 0.5 * mean;
      mean = half - apart;
      difference = half + apart;
    }
  for (int k = 0; k < 8; ++k) forces[cell.corners[k]] += f[k];
}

// In half edges.
elastic_law::Bending bendingOf(const ElasticCells& body, const ElasticCell& cell, const ElasticParameters& material,
                               const Mat3& gradient, Coefficients a) {
  for (Vec3& coefficient : a.of) coefficient /= body.half_edge;
  return elastic_law::bending(material, gradient, cell.variance, a.of);
}

Mat3 gradientOf(const Coefficients& a, double half_edge) {
  Mat3 gradient;
  gradient << a[1], a[2], a[4];
  return gradient / half_edge;
}

// The derivatives of the energy by the coefficients; `stress` is what it is by the gradient, but for bending.
Coefficients slopes(const ElasticCells& body, const ElasticCell& cell, const ElasticParameters& material,
                    const Mat3& stress, const elastic_law::Bending& bending) {
  const double pull = cell.mass / material.density / body.half_edge;
  Coefficients f;
  f[0].setZero();
  for (int axis = 0; axis < 3; ++axis) f[1 << axis] = pull * (stress + bending.by_gradient).col(axis);
  for (const int mode : {3, 5, 6, 7}) f[mode] = pull * bending.by_mode[mode];
  return f;
}

const PlasticShape* shapeOf(const std::vector<PlasticShape>* plastic, std::size_t c) {
  return plastic && !plastic->empty() ? &(*plastic)[c] : nullptr;
}

struct Fit {
  Coefficients coefficients;
  Mat3 strained;  // the gradient, from the rest shape without stress
  Mat3 rotation;
};

Fit fit(const ElasticCells& body, const ElasticCell& cell, const Points& y, double swelling, const PlasticShape* shape,
        ClusterPose& pose, MatchCounters& counters) {
  const Vec3 origin = y[cell.corners[0]];
  Fit result;
  result.coefficients = coefficientsOf(cell, y, origin);
  pose.centre = origin + result.coefficients[0];
  pose.deformation = gradientOf(result.coefficients, body.half_edge);
  const Mat3 unstressed = shape ? Mat3(pose.deformation * shape->inverse) : pose.deformation;
  const RotationResult found = nearestRotation(unstressed, pose.rotation);
  pose.rotation = found.rotation;
  result.rotation = found.rotation.toRotationMatrix();
  result.strained = unstressed / swelling;
  ++counters.clusters;
  ++counters.rotations;
  ++counters.linear_fits;
  if (!found.warm) ++counters.cold_rotations;
  return result;
}

}  // namespace

double elasticAccelerations(const ElasticCells& body, const ElasticParameters& material, const Points& y,
                            std::vector<ClusterPose>& poses, Points& accelerations, MatchCounters& counters,
                            double swelling, const std::vector<PlasticShape>* plastic,
                            std::vector<RelaxedStrain>* relaxed) {
  Points& forces = accelerations;  // less their sign, until the end
  forces.assign(y.size(), Vec3::Zero());
  double most = 3.0;
  for (std::size_t c = 0; c < body.cells.size(); ++c) {
    const ElasticCell& cell = body.cells[c];
    const PlasticShape* const shape = shapeOf(plastic, c);
    const Fit f = fit(body, cell, y, swelling, shape, poses[c], counters);
    double steepness = 3.0;
    const ElasticParameters mixed = cell.mix.of(material);
    RelaxedStrain* const taken = relaxed ? &(*relaxed)[c] : nullptr;
    if (taken) elastic_law::takeOn(mixed.relaxation, elastic_law::deviatorOf(f.strained, f.rotation), *taken);
    Mat3 by_gradient = elastic_law::stress(mixed, f.strained, f.rotation, steepness, taken);
    elastic_law::pullFibres(mixed, f.strained, cell.fibre, by_gradient, steepness);
    if (shape) {
      by_gradient *= shape->inverse;
      steepness *= shape->stiffening * shape->stiffening;
    }
    most = std::max(most, steepness);
    const elastic_law::Bending bending = bendingOf(body, cell, mixed, poses[c].deformation, f.coefficients);
    addForces(cell, slopes(body, cell, mixed, by_gradient, bending), forces);
  }
  for (std::size_t i = 0; i < forces.size(); ++i) accelerations[i] = -forces[i] / body.masses[i];
  return std::sqrt(most / 3.0);
}

double relaxingShare(const ElasticCells& body, const RelaxationStep& relaxation, const Points& y,
                     const std::vector<ClusterPose>& poses, const std::vector<RelaxedStrain>& relaxed, double swelling,
                     const std::vector<PlasticShape>& plastic) {
  double most = 0.0, largest = kLeastStrain;
  for (std::size_t c = 0; c < body.cells.size(); ++c) {
    Mat3 gradient = gradientOf(body.cells[c], body.half_edge, y) / swelling;
    if (!plastic.empty()) gradient *= plastic[c].inverse;
    const auto d = elastic_law::followed(elastic_law::deviatorOf(gradient, poses[c].rotation.toRotationMatrix()));
    std::array<double, 6> left{};
    for (int k = 0; k < relaxation.branches; ++k)
      for (int n = 0; n < 6; ++n) left[n] += relaxation.shares[k] * (d[n] - relaxed[c].of[k][n]);
    most = std::max(most, elastic_law::symmetric(left).norm());
    largest = std::max(largest, elastic_law::symmetric(d).norm());
  }
  return most / largest;
}

Mat3 gradientOf(const ElasticCell& cell, double half_edge, const Points& y) {
  return gradientOf(coefficientsOf(cell, y, y[cell.corners[0]]), half_edge);
}

double elasticEnergy(const ElasticCells& body, const ElasticParameters& material, const Points& y,
                     std::vector<ClusterPose> poses, double swelling, const std::vector<PlasticShape>* plastic,
                     const std::vector<RelaxedStrain>* relaxed) {
  double energy = 0.0;
  MatchCounters uncounted;
  for (std::size_t c = 0; c < body.cells.size(); ++c) {
    const ElasticCell& cell = body.cells[c];
    const Fit f = fit(body, cell, y, swelling, shapeOf(plastic, c), poses[c], uncounted);
    // By F, not F / swelling: the factor is the derivative's.
    const ElasticParameters mixed = cell.mix.of(material);
    const double volume = cell.mass / mixed.density;
    const double density =
        elastic_law::energyDensity(mixed, f.strained, f.rotation, relaxed ? &(*relaxed)[c] : nullptr) +
        elastic_law::fibreEnergy(mixed, f.strained, cell.fibre);
    energy += volume * (swelling * density + bendingOf(body, cell, mixed, poses[c].deformation, f.coefficients).energy);
  }
  return energy;
}

std::vector<Mat3> cellStresses(const ElasticCells& body, const ElasticParameters& material, const Points& y,
                               std::vector<ClusterPose>& poses, double swelling,
                               const std::vector<PlasticShape>* plastic, const std::vector<RelaxedStrain>* relaxed) {
  std::vector<Mat3> stresses;
  MatchCounters uncounted;
  for (std::size_t c = 0; c < body.cells.size(); ++c) {
    const ElasticCell& cell = body.cells[c];
    const PlasticShape* const shape = shapeOf(plastic, c);
    const Fit f = fit(body, cell, y, swelling, shape, poses[c], uncounted);
    double unused = 0.0;
    const ElasticParameters mixed = cell.mix.of(material);
    stresses.push_back(elastic_law::stress(mixed, f.strained, f.rotation, unused, relaxed ? &(*relaxed)[c] : nullptr));
    elastic_law::pullFibres(mixed, f.strained, cell.fibre, stresses.back(), unused);
    if (shape) stresses.back() *= shape->inverse;
  }
  return stresses;
}

double highestFrequency(const ElasticCells& body, const ElasticParameters& material) {
  return highestFrequency(body.masses, [&](const Points& displacements, Points& accelerations) {
    Points& forces = accelerations;
    forces.assign(displacements.size(), Vec3::Zero());
    for (const ElasticCell& cell : body.cells) {
      const Coefficients a = coefficientsOf(cell, displacements, Vec3::Zero());
      const Mat3 g = gradientOf(a, body.half_edge);
      const ElasticParameters mixed = cell.mix.of(material);
      const Mat3 by_gradient = mixed.mu * (g + g.transpose()) + mixed.lambda * g.trace() * Mat3::Identity() +
                               mixed.fibres * cell.fibre.dot(g * cell.fibre) * cell.fibre * cell.fibre.transpose();
      elastic_law::Bending bending = bendingOf(body, cell, mixed, Mat3::Identity(), a);
      bending.by_gradient.setZero();  // of the second order
      addForces(cell, slopes(body, cell, mixed, by_gradient, bending), forces);
    }
    for (std::size_t i = 0; i < forces.size(); ++i) accelerations[i] = -forces[i] / body.masses[i];
  });
}

}  // namespace meshless
