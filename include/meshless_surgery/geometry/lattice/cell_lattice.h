// A solid divided into the cells of a cubic lattice, with corners that only connected cells share.
#pragma once

#include <functional>
#include <memory>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/lattice/cell_samples.h"
#include "meshless_surgery/geometry/query/inside.h"

namespace meshless {

/// How much of a cell resists, and where, in units of momentsOf(): what is filled, and of what is held nothing.
struct Resistance {
  double fraction = 1.0;
  Vec3 centroid = Vec3::Zero();
  Vec3 variance = Vec3::Constant(1.0 / 3.0);
};

/// A copy of a lattice cell: one for each part of the solid in it that hangs together (two fingers, the walls of a
/// slit, the sides of a cut, what is held and what is free), with all eight corners. Nesme et al. 2009; Sifakis et al.
/// 2007.
struct LatticeCell {
  std::array<Index, 8> corners{};       // bits 0, 1, 2 of the position: upper end along x, y, z
  std::array<std::int32_t, 3> place{};  // in the lattice
  SampleSet samples = kNoSample;        // the part; none of a crumb that is smaller than a sample
  SampleSet filled = kNoSample;         // what its moments are of: the part, or of a crumb the part that it came from
  bool held = false;                    // its tissue is held in place: it weighs, and does not resist
  Resistance resists;                   // of `filled`
  LinkSet parted{};                     // links of its samples that a blade has cut
  double mass_share = 1.0;              // of what `filled` weighs; 0 of a bridge
  double stiffness_share = 1.0;         // of what `filled` resists with
  /// Where a blade ends within the cell, the parts beside it are cells of their own and one more, the bridge, that has
  /// all of their samples holds them together with a share of their stiffness. kNoIndex: no bridge; of a bridge:
  /// itself.
  Index bridge = kNoIndex;
  /// Of a bridge and its part, where a blade ends in the face between a cell and the one above it: the axis of that
  /// face, whose corners the bridge has from the cell above. -1: the blade ended within the cell, or there is none.
  std::int8_t face = -1;

  bool isBridge(Index self) const { return bridge == self; }
};

class CellRegions;

struct CellLattice {
  double spacing = 0.0;        // [m]
  Vec3 origin = Vec3::Zero();  // [m] lower end of the cell 0, 0, 0
  Index corners = 0;           // how many
  std::vector<LatticeCell> cells;
  std::shared_ptr<const CellRegions> regions;  // which samples lie in which of the body's; null where it has none

  /// [m] of a point in a cell, each coordinate of `at` 0..1 inside of it.
  Vec3 restPlace(const LatticeCell& cell, const Vec3& at) const {
    return origin + spacing * (Vec3(cell.place[0], cell.place[1], cell.place[2]) + at);
  }
  /// Of the cells that a point is in, if there are any.
  std::array<std::int32_t, 3> placeOf(const Vec3& rest) const {
    const Vec3 at = ((rest - origin) / spacing).array().floor();
    return {static_cast<std::int32_t>(at.x()), static_cast<std::int32_t>(at.y()), static_cast<std::int32_t>(at.z())};
  }
  /// The inverse of restPlace().
  Vec3 placeIn(const LatticeCell& cell, const Vec3& rest) const {
    return (rest - origin) / spacing - Vec3(cell.place[0], cell.place[1], cell.place[2]);
  }
};

/// [m] of every corner.
Points cornerPlaces(const CellLattice& lattice);

/// Which cells use each corner (compressed rows).
struct CornerUses {
  std::vector<Index> offsets;  // corners + 1
  std::vector<Index> cells;
};
CornerUses cornerUses(const CellLattice& lattice);

/// What is left of a cell's resistance by a blade that leaves it `filled`.
Resistance resistanceOf(const LatticeCell& before, SampleSet filled);

/// [m] from a place to what is held, below 0 in it.
using HeldHeight = std::function<double(const Vec3& rest)>;
/// Parts each cell into what is held and what is free, which have no corner in common, and finds what resists, finer
/// than by whole samples: how far the surface and what is held reach into the eighth of a sample. Tissue that no sample
/// sees counts with the nearest cell that has one. `held` may be null.
void findResistance(const SolidQuery& solid, const HeldHeight& held, CellLattice& lattice);

/// The lattice is centred on the bounds; a box whose edges are whole multiples of the spacing is filled exactly. Gaps
/// thinner than a quarter of the spacing are not seen. Refuses (kInvalidArgument) a spacing with more than max_cells
/// cells in the bounds, (kUnsuitableShape) a solid so thin that no sample of a quarter of the spacing lies in it.
Result<CellLattice> divideIntoCells(const TriangleMesh& mesh, const SolidQuery& solid, double spacing,
                                    std::size_t max_cells = 4000000);

}  // namespace meshless
