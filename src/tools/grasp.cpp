#include "meshless_surgery/tools/grasp.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/QR>

#include "meshless_surgery/body/filled_cells.h"

namespace meshless {
namespace {

constexpr double kOnEdge = 1e-12;           // of a triangle: a ray along an edge meets both faces, and not neither
constexpr double kSpanned = 0.01;         // variance over the largest: in flatter directions a patch does not reach
const double kLongestWay = std::sqrt(3.0);  // along the edges of a cubic lattice, over the straight one

// Where some of it is fixed the rest would be drawn beyond the end, for the mean to come there.
void letGoOfFixed(const BodyModel& model, Pick& pick) {
  double free = 0.0;
  for (std::size_t k = 0; k < pick.patch.size(); ++k)
    if (!model.fixed[pick.patch[k]]) free += pick.weights[k];
  if (!(free > 0.0)) return;
  std::size_t kept = 0;
  for (std::size_t k = 0; k < pick.patch.size(); ++k) {
    if (model.fixed[pick.patch[k]]) continue;
    pick.patch[kept] = pick.patch[k];
    pick.weights[kept++] = pick.weights[k] / free;
  }
  pick.patch.resize(kept);
  pick.weights.resize(kept);
}

// The free particle that is nearest to a fixed one, within a distance [m]; else that one. Cells in a clamp have particles
// of their own, which no link joins to those beside it.
Index freeNear(const BodyModel& model, Index particle, double within) {
  Index nearest = particle;
  double least = within;
  if (!model.fixed[particle]) return particle;
  for (Index i = 0; i < model.rest.size(); ++i) {
    const double away = (model.rest[i] - model.rest[particle]).norm();
    if (model.fixed[i] || !(away < least)) continue;
    least = away;
    nearest = i;
  }
  return nearest;
}

void leadMeanTo(const Vec3& point, const Points& positions, Pick& pick) {
  const Vec3 mean = graspMean(pick, positions);
  Mat3 spread = Mat3::Zero();
  for (std::size_t k = 0; k < pick.patch.size(); ++k) {
    const Vec3 arm = positions[pick.patch[k]] - mean;
    spread += pick.weights[k] * arm * arm.transpose();
  }
  Eigen::CompleteOrthogonalDecomposition<Mat3> spanned;
  spanned.setThreshold(kSpanned);
  const Vec3 slope = spanned.compute(spread).solve(point - mean);
  for (std::size_t k = 0; k < pick.patch.size(); ++k)
    pick.weights[k] *= 1.0 + slope.dot(positions[pick.patch[k]] - mean);
}

}  // namespace

double graspInverseMass(const BodyModel& model, const Pick& pick) {
  double inverse_mass = 0.0;
  for (std::size_t k = 0; k < pick.patch.size(); ++k)
    if (!model.fixed[pick.patch[k]]) inverse_mass += pick.weights[k] * pick.weights[k] / model.masses[pick.patch[k]];
  return inverse_mass;
}

void makeGrasp(const BodyModel& model, const Points& positions, Index centre, double radius, const Vec3& point,
               Pick& pick) {
  pick.patch.clear();
  pick.weights.clear();
  double total = 0.0;
  const Index middle = freeNear(model, centre, radius);
  for (const auto& [i, along] : GraphSearch(model.graph).from(middle, kLongestWay * radius)) {
    const double straight = (model.rest[i] - model.rest[middle]).norm();
    const double s = radius > 0.0 ? std::max(straight, along / kLongestWay) / radius : 0.0;
    if (!(s < 1.0)) continue;
    pick.patch.push_back(i);
    pick.weights.push_back(model.masses[i] * (1.0 - s * s) * (1.0 - s * s));
    total += pick.weights.back();
  }
  for (double& w : pick.weights) w /= total;
  letGoOfFixed(model, pick);
  pick.particle = pick.patch[0];
  leadMeanTo(pick.particle == centre ? point : positions[pick.particle], positions, pick);
  pick.position = graspMean(pick, positions);
}

TissuePlace placeOf(const BodyModel& model, Index particle) {
  TissuePlace place;
  if (!model.lattice) return place;
  const Vec3& rest = model.rest[particle];
  double least = std::numeric_limits<double>::infinity();
  for (Index c = 0; c < model.lattice->cells.size(); ++c) {
    const LatticeCell& cell = model.lattice->cells[c];
    if (cell.isBridge(c) || std::find(cell.corners.begin(), cell.corners.end(), particle) == cell.corners.end())
      continue;
    const Vec3 at = model.lattice->placeIn(cell, rest);
    const double squared = squaredToSamples(cell.samples, at);
    if (!(squared < least)) continue;
    least = squared;
    place = {c, at};
  }
  return place;
}

Vec3 graspMean(const Pick& pick, const Points& positions) {
  Vec3 sum = Vec3::Zero();
  const Vec3& origin = positions[pick.patch[0]];
  for (std::size_t k = 0; k < pick.patch.size(); ++k) sum += pick.weights[k] * (positions[pick.patch[k]] - origin);
  return origin + sum;
}

double graspStiffness(const BodyModel& model, const Pick& pick, double h) {
  return pick.stiffness / (1.0 + pick.stiffness * h * h * graspInverseMass(model, pick));
}

RayHit castRay(const Points& vertices, const std::vector<Triangle>& triangles, const Vec3& origin,
               const Vec3& direction) {
  RayHit best;
  best.distance = std::numeric_limits<double>::infinity();
  const Vec3 d = direction.normalized();
  for (std::size_t t = 0; t < triangles.size(); ++t) {  // Moeller and Trumbore 1997
    const Vec3& a = vertices[triangles[t][0]];
    const Vec3 e1 = vertices[triangles[t][1]] - a, e2 = vertices[triangles[t][2]] - a;
    const Vec3 p = d.cross(e2);
    const double det = e1.dot(p);
    if (det == 0.0) continue;
    const Vec3 s = origin - a;
    const double u = s.dot(p) / det;
    if (!(u >= -kOnEdge && u <= 1.0 + kOnEdge)) continue;
    const Vec3 q = s.cross(e1);
    const double v = d.dot(q) / det;
    if (!(v >= -kOnEdge && u + v <= 1.0 + kOnEdge)) continue;
    const double distance = e2.dot(q) / det;
    if (!(distance >= 0.0 && distance < best.distance)) continue;
    best.hit = true;
    best.distance = distance;
    best.triangle = static_cast<Index>(t);
  }
  if (best.hit) best.point = origin + best.distance * d;
  return best;
}

}  // namespace meshless
