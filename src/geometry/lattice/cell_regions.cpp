#include "meshless_surgery/geometry/lattice/cell_regions.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace meshless {
namespace {

struct ByPlace {
  using Place = std::array<std::int32_t, 3>;
  bool operator()(const CellRegions::Part& a, const Place& b) const { return a.place < b; }
  bool operator()(const Place& a, const CellRegions::Part& b) const { return a < b.place; }
};

}  // namespace

CellRegions::Range CellRegions::at(const std::array<std::int32_t, 3>& place) const {
  const auto [first, last] = std::equal_range(parts_.begin(), parts_.end(), place, ByPlace());
  return {parts_.data() + (first - parts_.begin()), parts_.data() + (last - parts_.begin())};
}

Index CellRegions::regionOf(const CellLattice& lattice, const Vec3& rest) const {
  if (!(((rest - lattice.origin) / lattice.spacing).cwiseAbs().maxCoeff() < 1e9)) return kNoIndex;
  const auto place = lattice.placeOf(rest);
  const Range parts = at(place);
  if (parts.first == parts.last) return kNoIndex;
  const Vec3 in = (rest - lattice.origin) / lattice.spacing - Vec3(place[0], place[1], place[2]);
  int sample[3];
  for (int k = 0; k < 3; ++k) sample[k] = std::clamp(static_cast<int>(kCellSamples * in[k]), 0, kCellSamples - 1);
  const SampleSet bit = SampleSet{1} << sampleBit(sample[0], sample[1], sample[2]);
  for (const Part& part : parts)
    if (part.samples & bit) return part.region;
  return kNoIndex;
}

CellRegions findCellRegions(const CellLattice& lattice, std::size_t count, const RegionHeight& height) {
  std::set<std::array<std::int32_t, 3>> places;
  for (const LatticeCell& cell : lattice.cells) places.insert(cell.place);
  const double half = 0.8661 * lattice.spacing;  // diagonal
  std::vector<CellRegions::Part> parts;
  for (const auto& place : places) {
    const Vec3 low = lattice.origin + lattice.spacing * Vec3(place[0], place[1], place[2]);
    SampleSet left = kAllSamples;
    for (std::size_t region = count; region-- > 0 && left;) {
      const double middle = height(region, low + Vec3::Constant(0.5 * lattice.spacing));
      if (middle > half) continue;
      SampleSet inside = middle < -half ? left : kNoSample;
      if (!inside)
        for (SampleSet rest = left; rest; rest &= rest - 1) {
          const int bit = lowestSample(rest);
          if (height(region, low + lattice.spacing * samplePlace(bit)) <= 0.0) inside |= SampleSet{1} << bit;
        }
      if (!inside) continue;
      parts.push_back({place, static_cast<std::uint32_t>(region), inside});
      left &= ~inside;
    }
  }
  return CellRegions(std::move(parts));
}

}  // namespace meshless
