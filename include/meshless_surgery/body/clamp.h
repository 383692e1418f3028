// What holds a body of filled cells in place: not corners of its lattice, but places in its cells.
#pragma once

#include <memory>
#include <vector>

#include "meshless_surgery/geometry/lattice/cell_lattice.h"

namespace meshless {

constexpr std::uint32_t kMaxHeldRegions = 1000;  // of a body

/// A piece of the border at which free tissue ends at what is held.
struct ClampPoint {
  Index cell = 0;            // the free tissue's
  Vec3 at = Vec3::Zero();    // in it, each coordinate 0..1 inside; by up to a quarter outside, to a sample that is held
  double area = 0.0;         // [m^2]
  std::uint32_t region = 0;  // of those that hold the body: its number
};
/// [kg] of the spring there in the longest step: kStiff layers of cells, kStiff A spacing density. Softer ones let the
/// body sink, stiffer ones at an angle to the lattice lock its cells, which cannot bend along the border
/// (docs/method.md, Clamps).
double springMass(const CellLattice& lattice, const ClampPoint& point, double density);

/// Where links from samples that are free lead into what is held, or end in its border, as at a face that is held.
std::vector<ClampPoint> findClampPoints(const CellLattice& lattice, const SolidQuery& solid, const HeldHeight& held);

/// Springs between clamp points and where they were put, as a system of the corners that they move.
struct Clamp {
  struct Entry {
    Index row, column;  // of `corners`; row >= column
    double mass;        // [kg] of the springs, in the longest step
  };
  std::vector<Index> corners;
  std::vector<double> masses;  // [kg] of them
  std::vector<Entry> springs;

  Clamp(const CellLattice& lattice, const std::vector<ClampPoint>& points, const std::vector<double>& corner_masses,
        double density);

  std::size_t bytes() const { return corners.size() * 12 + springs.size() * sizeof(Entry); }
};

/// Takes the springs' part of a step, implicitly: corners go where, by their masses and the springs, the least is
/// missing. Kept between steps, since it factorises the system anew where the step has changed.
class ClampStep {
 public:
  /// `share`: the square of the step over the longest at rest, so that the springs are as stiff in every step. moved:
  /// [kg m] of each corner, the springs times how far their places have been moved; empty: none has.
  void hold(const std::shared_ptr<const Clamp>& clamp, double share, const Points& rest, const Pose& placed,
            const Points& moved, Points& positions);
  std::size_t factorised() const { return factorised_; }  // so many times
  std::size_t bytes() const;

 private:
  void factorise(const Clamp& clamp, double share);

  std::shared_ptr<const Clamp> clamp_;
  double share_ = 0.0;
  std::size_t factorised_ = 0;
  // M + share sum of springs = P^T L L^T P; L by columns, the diagonal first.
  std::vector<Index> order_;  // of P: corners
  std::vector<double> masses_;
  std::vector<Index> columns_, rows_;
  std::vector<double> values_;
  Points found_;
};

}  // namespace meshless
