// What every piece of a body has from its parent, whether of particles or of cells. Private to body.
#pragma once

#include <memory>

#include "meshless_surgery/body/cut_body.h"

namespace meshless {

/// A piece's model before its particles: `present` is its surface in the parent's present shape, `rest` its vertices at
/// rest.
std::shared_ptr<BodyModel> beginPiece(const BodyModel& parent, const TriangleMesh& present, Points rest, bool incised);

/// Once its particles are there: its cavities, what its state goes on with, and its surface.
void finishPiece(const BodyState& parent, std::shared_ptr<BodyModel> model, BodyPiece& piece);

}  // namespace meshless
