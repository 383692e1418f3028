#include "meshless_surgery/body/incise_body.h"

#include <algorithm>

#include "cut_cells.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr double kFollow = 0.05;  // [spacing] a blade that close to a wound that runs along it goes into it
constexpr double kBand = 3e-3;    // [spacing] vertices that close to a blade are on it: no edges are shorter than that

Result<IncisedBody> inciseFilled(const BodyModel& model, const BodyState& state, const Blade& blade,
                                 const InciseOptions& options, const std::vector<TissuePlace>& places) {
  Result<Incision> incision = Error(), contact_incision = Error();
  const MetBody met(model, state);
  atOnce([&] { incision = incise(met.surface, blade, options); },
         [&] {
           if (model.collision) contact_incision = incise(met.collision, blade, options);
         });
  if (!incision) return incision.error();
  std::vector<CellPieceSource> sources, collision;
  for (const IncisedPiece& piece : incision->pieces) sources.push_back({piece.mesh, piece.origins});
  if (contact_incision)
    for (const IncisedPiece& piece : contact_incision->pieces) collision.push_back({piece.mesh, piece.origins});
  IncisedBody result;
  result.opened_area = incision->opened_area;
  Result<std::vector<BodyPiece>> pieces =
      cutCells(model, state, met, BladeGate(blade), sources, collision, places, options.patch, result.work);
  if (!pieces) return pieces.error();
  result.pieces = std::move(*pieces);
  return result;
}

}  // namespace

Result<IncisedBody> inciseBody(const BodyModel& model, const BodyState& state, const Blade& blade,
                               const std::vector<TissuePlace>& places) {
  if (!model.solid) return Error{ErrorCode::kUnsuitableShape, "its surface is open, so it has no inside to be opened"};
  InciseOptions options;
  options.patch = model.next_patch;
  options.follow = kFollow * model.spacing;
  const double extent = boundsOf(state.surface).diagonal();
  if (extent > 0.0) options.band = std::min(kBand * model.spacing / extent, 1e-3);
  return inciseFilled(model, state, blade, options, places);
}

}  // namespace meshless
