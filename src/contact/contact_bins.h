/// The triangles of a shape by bins of a grid.
#pragma once

#include "grid_rings.h"
#include "meshless_surgery/contact/contact_shape.h"

namespace meshless {

// visit(k) for the places in bin_triangles_ of the bins that a box touches.
template <class Visit>
void ContactShape::visitBins(const Box& box, const Visit& visit) const {
  std::array<int, 3> first, last;
  for (int d = 0; d < 3; ++d) {
    const double low = (box.min[d] - bin_origin_[d]) / bin_edge_, high = (box.max[d] - bin_origin_[d]) / bin_edge_;
    if (!(high >= 0.0) || !(low <= bins_[d])) return;
    first[d] = low > 0.0 ? std::min(static_cast<int>(low), bins_[d] - 1) : 0;
    last[d] = high < bins_[d] ? static_cast<int>(high) : bins_[d] - 1;
  }
  for (int x = first[0]; x <= last[0]; ++x)
    for (int y = first[1]; y <= last[1]; ++y)
      for (int z = first[2]; z <= last[2]; ++z) {
        const std::size_t bin = (static_cast<std::size_t>(x) * bins_[1] + y) * bins_[2] + z;
        for (Index k = bin_offsets_[bin]; k < bin_offsets_[bin + 1]; ++k) visit(k);
      }
}

}  // namespace meshless
