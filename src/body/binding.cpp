#include "meshless_surgery/body/binding.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>

namespace meshless {
namespace {

constexpr std::size_t kFewCarriers = 8;  // as a cell has corners: smooth surfaces have three times as many
constexpr double kRank = 0.03;           // of the moment's eigenvalues to the largest: below it, extrapolation is wild

}  // namespace

SurfaceBinding ownVertices(Index count) {
  SurfaceBinding binding;
  binding.offsets.resize(count + 1);
  std::iota(binding.offsets.begin(), binding.offsets.end(), Index{0});
  binding.carriers.assign(binding.offsets.begin(), binding.offsets.end() - 1);
  binding.weights.assign(count, 1.0);
  return binding;
}

SurfaceBinding fewerCarriers(const SurfaceBinding& binding, const Points& rest, double spacing) {
  struct Carrier {
    Index particle;
    double weight;
    Eigen::Vector4d terms;  // 1, and where it is from the vertex
  };
  std::vector<Carrier> carriers;
  SurfaceBinding fewer = binding;
  fewer.carriers.clear();
  fewer.weights.clear();
  for (Index r = 0; r < binding.size(); ++r) {
    const Vec3 place = binding.place(r, rest);
    carriers.clear();
    for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k) {
      carriers.push_back({binding.carriers[k], binding.weights[k], Eigen::Vector4d::UnitX()});
      carriers.back().terms.tail<3>() = (rest[binding.carriers[k]] - place) / spacing;
    }
    std::stable_sort(carriers.begin(), carriers.end(),
                     [](const Carrier& a, const Carrier& b) { return std::abs(a.weight) > std::abs(b.weight); });
    Eigen::Vector4d lacking = Eigen::Vector4d::UnitX();
    Eigen::Matrix4d moments = Eigen::Matrix4d::Zero();
    const std::size_t count = std::min(carriers.size(), kFewCarriers);
    for (std::size_t k = 0; k < count; ++k) {
      lacking -= carriers[k].weight * carriers[k].terms;
      moments += std::abs(carriers[k].weight) * carriers[k].terms * carriers[k].terms.transpose();
    }
    const Eigen::LDLT<Eigen::Matrix4d> solver(moments);
    if (count < carriers.size() && solver.rcond() > kRank * kRank) {
      carriers.resize(count);
      const Eigen::Vector4d more = solver.solve(lacking);
      for (Carrier& carrier : carriers) carrier.weight += std::abs(carrier.weight) * more.dot(carrier.terms);
    }
    for (const Carrier& carrier : carriers) {
      fewer.carriers.push_back(carrier.particle);
      fewer.weights.push_back(carrier.weight);
    }
    fewer.offsets[r + 1] = static_cast<Index>(fewer.carriers.size());
  }
  return fewer;
}

void addToParticles(const SurfaceBinding& binding, const Points& of_vertices, Points& of_particles) {
  for (Index v = 0; v < binding.size(); ++v)
    for (Index k = binding.offsets[v]; k < binding.offsets[v + 1]; ++k)
      of_particles[binding.carriers[k]] += binding.weights[k] * of_vertices[v];
}

SurfaceBinding cornerCarriers(const SurfaceBinding& binding, const CellLattice& lattice, const Points& rest) {
  constexpr double kNothing = 1e-9;  // of a weight: a vertex at a corner, along an edge or in a face
  SurfaceBinding fewer;
  fewer.offsets.push_back(0);
  for (Index v = 0; v < binding.size(); ++v) {
    const LatticeCell& cell = lattice.cells[binding.cells[v]];
    const Vec3 at = lattice.placeIn(cell, binding.place(v, rest));
    for (std::size_t c = 0; c < cell.corners.size(); ++c) {
      double weight = 1.0;
      for (int k = 0; k < 3; ++k) weight *= (c >> k & 1) ? at[k] : 1.0 - at[k];
      if (std::abs(weight) < kNothing) continue;
      fewer.carriers.push_back(cell.corners[c]);
      fewer.weights.push_back(weight);
    }
    fewer.offsets.push_back(static_cast<Index>(fewer.carriers.size()));
  }
  return fewer;
}

void carriedPlaces(const SurfaceBinding& binding, const Points& positions, Points& places) {
  places.resize(binding.size());
  for (Index v = 0; v < binding.size(); ++v) places[v] = binding.place(v, positions);
}

Points collisionPlaces(const BodyModel& model, const Points& positions) {
  Points places;
  carriedPlaces(model.collision->binding, positions, places);
  return places;
}

}  // namespace meshless
