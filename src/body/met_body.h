// A body as a blade meets it: as it lies now, its wounds closed where they are closed.
#pragma once

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/geometry/query/blade.h"

namespace meshless {

/// The sides of a closed wound press into each other or leave gaps, coarser than the surface and as coarse as cells
/// are. At rest they fit, and no tissue lies in itself. So where they are closed, the copies of a corner of the lattice
/// are taken to be at one position, their mean, and the surface there where the corners have it: what a blade meets is
/// one map of the rest shape on both sides, and both are cut alike. Sides that are apart stay apart, and what has no
/// wound is where it is.
struct MetBody {
  MetBody(const BodyModel& model, const BodyState& state);
  /// As it is at rest.
  explicit MetBody(const BodyModel& model);

  Points positions;        // [m] of the particles
  TriangleMesh surface;    // patches filled
  TriangleMesh collision;  // likewise; empty where the body has none of its own
};

}  // namespace meshless
