// Opening a body along a blade that need not go all the way through.
#pragma once

#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/geometry/surgery/incise.h"

namespace meshless {

struct IncisedBody {
  /// One where the body holds together: its particles are the parent's, in their order. Else largest volume first. What
  /// is less than a sample of a cell comes apart from no piece: it stays with the largest.
  std::vector<BodyPiece> pieces;
  double opened_area = 0.0;  // [m^2] of one wound face
  CutWork work;
};

/// The blade is in the world frame and meets the present shape. Links between particles that pass through the blade are
/// cut. Clusters that it parts grow again along the links that are left. Vertices of a wound face follow only particles
/// on its side. Positions, velocities and masses stay. Refuses as incise() does, and a body that is no solid. places:
/// to be followed, in a body of cells.
Result<IncisedBody> inciseBody(const BodyModel& model, const BodyState& state, const Blade& blade,
                               const std::vector<TissuePlace>& places = {});

}  // namespace meshless
