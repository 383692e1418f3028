#include "meshless_surgery/body/clamp.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <Eigen/SparseCholesky>

namespace meshless {
namespace {

constexpr double kStiff = 40.0;  // layers of cells that a spring is as heavy as
constexpr double kTouch = 1e-6;  // of the spacing: so near is on the border
constexpr int kHalvings = 40;

// How much of the link lies before what is held, which is no nearer than its height; above 1: all of it, or it is not
// come upon, as where the link runs along the border.
double startOfHeld(const HeldHeight& held, const Vec3& from, const Vec3& along, double touch) {
  double way = 0.0;
  for (int n = 0; n < kHalvings && way <= 1.0; ++n) {
    const double height = held(from + way * along);
    if (height <= touch) return way;
    way += height / along.norm();
  }
  return 2.0;
}

}  // namespace

std::vector<ClampPoint> findClampPoints(const CellLattice& lattice, const SolidQuery& solid, const HeldHeight& held) {
  std::vector<ClampPoint> points;
  const double step = lattice.spacing / kCellSamples, touch = kTouch * lattice.spacing;
  for (Index c = 0; c < lattice.cells.size(); ++c) {
    const LatticeCell& cell = lattice.cells[c];
    if (cell.held) continue;
    for (SampleSet left = cell.samples; left; left &= left - 1) {
      const Vec3 from = lattice.restPlace(cell, samplePlace(lowestSample(left)));
      for (int axis = 0; axis < 3; ++axis)
        for (const double way : {-step, step}) {
          const Vec3 along = way * Vec3::Unit(axis);
          double out = 0.0, in = 1.0;
          // What is held may be thinner than the link is long.
          if (!(held(from + along) <= touch)) in = startOfHeld(held, from, along, touch);
          if (!(in <= 1.0)) continue;
          for (int n = 0; n < kHalvings; ++n) {
            const double middle = 0.5 * (out + in);
            (held(from + middle * along) <= 0.0 ? in : out) = middle;
          }
          // Through the air nothing is held.
          if (solid.crosses(from, from + (1.0 - 1e-3) * in * along)) continue;
          const Vec3 there = from + in * along, before = there - 0.02 * along;
          Vec3 slope;
          for (int k = 0; k < 3; ++k)
            slope[k] = held(before + 0.01 * step * Vec3::Unit(k)) - held(before - 0.01 * step * Vec3::Unit(k));
          const double area = step * step * std::abs(slope[axis]) / std::max(slope.norm(), 1e-300);
          if (area > 0.0) points.push_back({c, lattice.placeIn(cell, there), area, 0});
        }
    }
  }
  return points;
}

double springMass(const CellLattice& lattice, const ClampPoint& point, double density) {
  return kStiff * density * lattice.spacing * point.area;
}

Clamp::Clamp(const CellLattice& lattice, const std::vector<ClampPoint>& points,
             const std::vector<double>& corner_masses, double density) {
  std::vector<Index> number(lattice.corners, kNoIndex);
  std::map<std::pair<Index, Index>, double> sums;  // by column, then row
  for (const ClampPoint& point : points) {
    const LatticeCell& cell = lattice.cells[point.cell];
    for (const Index corner : cell.corners)
      if (number[corner] == kNoIndex) {
        number[corner] = static_cast<Index>(corners.size());
        corners.push_back(corner);
        masses.push_back(corner_masses[corner]);
      }
    const double mass = springMass(lattice, point, density);
    for (int a = 0; a < 8; ++a)
      for (int b = 0; b < 8; ++b) {
        const Index row = number[cell.corners[a]], column = number[cell.corners[b]];
        if (row < column) continue;
        sums[{column, row}] += mass * trilinearWeight(a, point.at) * trilinearWeight(b, point.at);
      }
  }
  for (const auto& [at, mass] : sums) springs.push_back({at.second, at.first, mass});
}

void ClampStep::hold(const std::shared_ptr<const Clamp>& clamp, double share, const Points& rest, const Pose& placed,
                     const Points& moved, Points& positions) {
  share = std::clamp(share, 1e-9, 1.0);
  if (clamp_ != clamp || share_ != share) {
    clamp_ = clamp;
    share_ = share;
    factorise(*clamp, share);
    ++factorised_;
  }
  const std::size_t n = order_.size();
  for (std::size_t i = 0; i < n; ++i) found_[i] = masses_[i] * (positions[order_[i]] - placed * rest[order_[i]]);
  if (!moved.empty())
    for (std::size_t i = 0; i < n; ++i) found_[i] += share * moved[order_[i]];
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 here = found_[i] / values_[columns_[i]];
    found_[i] = here;
    for (Index k = columns_[i] + 1; k < columns_[i + 1]; ++k) found_[rows_[k]] -= values_[k] * here;
  }
  for (std::size_t i = n; i-- > 0;) {
    Vec3 sum = found_[i];
    for (Index k = columns_[i] + 1; k < columns_[i + 1]; ++k) sum -= values_[k] * found_[rows_[k]];
    found_[i] = sum / values_[columns_[i]];
  }
  for (std::size_t i = 0; i < n; ++i) positions[order_[i]] = placed * rest[order_[i]] + found_[i];
}

void ClampStep::factorise(const Clamp& clamp, double share) {
  using Matrix = Eigen::SparseMatrix<double>;
  const auto n = static_cast<Eigen::Index>(clamp.corners.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index i = 0; i < n; ++i) entries.emplace_back(i, i, clamp.masses[static_cast<std::size_t>(i)]);
  for (const Clamp::Entry& spring : clamp.springs) entries.emplace_back(spring.row, spring.column, share * spring.mass);
  Matrix system(n, n);
  system.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLLT<Matrix, Eigen::Lower> factor(system);
  order_.clear();
  if (factor.info() != Eigen::Success) return;  // masses that no double can weigh against each other: nothing is held
  order_.resize(clamp.corners.size());
  masses_.resize(clamp.corners.size());
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto to = static_cast<std::size_t>(factor.permutationP().indices()[i]);
    order_[to] = clamp.corners[static_cast<std::size_t>(i)];
    masses_[to] = clamp.masses[static_cast<std::size_t>(i)];
  }
  const Matrix lower = factor.matrixL();
  columns_.assign(1, 0);
  rows_.clear();
  values_.clear();
  for (Eigen::Index column = 0; column < n; ++column) {
    for (Matrix::InnerIterator entry(lower, column); entry; ++entry) {
      rows_.push_back(static_cast<Index>(entry.row()));
      values_.push_back(entry.value());
    }
    columns_.push_back(static_cast<Index>(rows_.size()));
  }
  found_.resize(clamp.corners.size());
}

std::size_t ClampStep::bytes() const {
  return (order_.capacity() + columns_.capacity() + rows_.capacity()) * sizeof(Index) +
         (masses_.capacity() + values_.capacity()) * sizeof(double) + found_.capacity() * sizeof(Vec3);
}

}  // namespace meshless
