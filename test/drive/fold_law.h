// A surface that was flat does not fold over, but where the tissue beneath it does.
#pragma once

#include "drive/finding.h"
#include "drive/seen.h"

namespace meshless {

struct Folds {
  std::size_t of_surface = 0;  // edges that nothing beneath explains
  std::size_t of_tissue = 0;   // edges where the cells or particles that an end follows are stretched or pressed more
                               // than twofold, or turned by more than 60 degrees from one to the next
};

/// Edges whose two triangles are turned against each other by less than 30 degrees at rest, and by more than 60 now.
/// Slivers (at rest or now flatter than a fiftieth of the mean edge of the body at rest) have no normal to speak of,
/// and are not looked at. Tissue is known where `model` and `particles` are there.
Folds foldsOf(const SeenBody& body);

/// At most two thousandths of all edges are folds that nothing beneath explains.
Finding foldLaw(const Seen& seen);

}  // namespace meshless
