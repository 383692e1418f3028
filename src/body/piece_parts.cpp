#include "piece_parts.h"

#include <utility>

#include "meshless_surgery/body/cavities.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {

std::shared_ptr<BodyModel> beginPiece(const BodyModel& parent, const TriangleMesh& present, Points rest, bool incised) {
  auto piece = std::make_shared<BodyModel>();
  piece->solid = true;
  piece->spacing = parent.spacing;
  piece->own = parent.own;
  piece->unstressed = parent.unstressed;
  piece->fibre_direction = parent.fibre_direction;
  piece->specific_fibres = parent.specific_fibres;
  piece->grouping = parent.grouping;
  piece->length = parent.length;
  piece->specific_stiffness = parent.specific_stiffness;
  piece->poissons_ratio = parent.poissons_ratio;
  piece->texture = parent.texture;
  piece->next_patch = parent.next_patch + 1;
  piece->incised = parent.incised || incised;
  piece->held_middles = parent.held_middles;
  piece->surface.triangles = present.triangles;
  piece->surface.patches = present.patches;
  piece->surface.vertices = std::move(rest);
  piece->rest_volume = signedVolume(piece->surface);
  piece->rest_area = surfaceArea(piece->surface);
  return piece;
}

void finishPiece(const BodyState& parent, std::shared_ptr<BodyModel> model, BodyPiece& piece) {
  piece.state.stretch = parent.stretch;
  piece.state.swelling = parent.swelling;
  piece.state.pace = parent.pace;
  piece.state.stiffened = parent.stiffened;
  piece.state.placed = parent.placed;
  piece.state.held = parent.held;
  for (std::uint32_t entry = 0; entry < piece.state.held.size(); ++entry)
    if (!model->isHeldBy(entry)) piece.state.held[entry].left = 0.0;
  makeCavities(*model);
  piece.state.cavities = inheritedCavities(parent.cavities, *model, piece.state.positions);
  updateSurface(*model, piece.state);
  piece.model = std::move(model);
}

}  // namespace meshless
