// Which samples of a lattice lie in which of several regions.
#pragma once

#include <functional>

#include "meshless_surgery/geometry/lattice/cell_lattice.h"

namespace meshless {

/// It goes by places, so that every copy of a cell has the same: no blade changes it.
class CellRegions {
 public:
  struct Part {
    std::array<std::int32_t, 3> place{};
    std::uint32_t region = 0;
    SampleSet samples = kNoSample;
  };
  struct Range {
    const Part *first, *last;
    const Part* begin() const { return first; }
    const Part* end() const { return last; }
  };

  CellRegions() = default;
  /// By place, ascending; the parts of a place have no sample in common.
  explicit CellRegions(std::vector<Part> parts) : parts_(std::move(parts)) {}

  /// What of a place lies in regions; empty where nothing does.
  Range at(const std::array<std::int32_t, 3>& place) const;
  /// Of the sample that a rest place lies in; kNoIndex where that is in none.
  Index regionOf(const CellLattice& lattice, const Vec3& rest) const;

  const std::vector<Part>& parts() const { return parts_; }

 private:
  std::vector<Part> parts_;
};

/// [m] from a rest place to each of `count` regions, below 0 inside, growing no faster than the distance does.
using RegionHeight = std::function<double(std::size_t region, const Vec3& rest)>;

/// Of several regions that a sample lies in, the last one has it.
CellRegions findCellRegions(const CellLattice& lattice, std::size_t count, const RegionHeight& height);

}  // namespace meshless
