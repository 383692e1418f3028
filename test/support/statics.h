// Statics of bodies of cells by conjugate gradients, where displacements are so small that the material is linear.
#pragma once

#include <functional>

#include <gtest/gtest.h>

#include "meshless_surgery/body/body.h"

namespace meshless::test {

/// Twice the work [J] of a field of accelerations [m/s^2] on a body whose corners at some places are held.
inline double workOf(const BodyModel& model, const ElasticParameters& material, const Vec3& field,
                     const std::function<bool(const Vec3& rest)>& is_held) {
  constexpr double kTiny = 1e-5;  // [spacings]
  const std::size_t n = model.rest.size();
  std::vector<bool> held(n);
  for (std::size_t i = 0; i < n; ++i) held[i] = is_held(model.rest[i]);
  ElasticBatchState scratch;
  Points y(n), a;
  MatchCounters counters;
  const auto stiffness = [&](const Points& u, Points& force) {
    double most = 0.0;
    for (const Vec3& d : u) most = std::max(most, d.norm());
    const double tiny = kTiny * model.spacing / most;
    for (std::size_t i = 0; i < n; ++i) y[i] = model.rest[i] + tiny * u[i];
    model.elastic_batch->setRotations(std::vector<ClusterPose>(model.groups()), scratch);
    model.elastic_batch->accelerate(matchInput(model), material, y, scratch, a, counters);
    force.resize(n);
    for (std::size_t i = 0; i < n; ++i) force[i] = held[i] ? Vec3(Vec3::Zero()) : Vec3(-model.masses[i] / tiny * a[i]);
  };
  const auto dot = [&](const Points& p, const Points& q) {
    double sum = 0.0;
    for (std::size_t i = 0; i < n; ++i) sum += p[i].dot(q[i]);
    return sum;
  };
  Points load(n, Vec3::Zero()), u(n, Vec3::Zero()), r, z(n), p, ap;
  for (std::size_t i = 0; i < n; ++i)
    if (!held[i]) load[i] = model.masses[i] * field;
  r = load;
  const auto preconditioned = [&] {
    for (std::size_t i = 0; i < n; ++i) z[i] = r[i] / model.masses[i];
  };
  preconditioned();
  p = z;
  double rz = dot(r, z);
  const double start = rz;
  for (int k = 0; k < 40000 && rz > 1e-14 * start; ++k) {
    stiffness(p, ap);
    const double step = rz / dot(p, ap);
    for (std::size_t i = 0; i < n; ++i) {
      u[i] += step * p[i];
      r[i] -= step * ap[i];
    }
    preconditioned();
    const double next = dot(r, z);
    for (std::size_t i = 0; i < n; ++i) p[i] = z[i] + next / rz * p[i];
    rz = next;
  }
  EXPECT_LE(rz, 1e-12 * start);
  return dot(load, u);
}

}  // namespace meshless::test
