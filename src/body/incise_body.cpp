#include "meshless_surgery/body/incise_body.h"

#include <algorithm>
#include <cmath>

#include "cut_cells.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr double kFollow = 0.05;  // [spacing] a blade that close to a wound that runs along it goes into it
constexpr double kBand = 3e-3;    // [spacing] vertices that close to a blade are on it: no edges are shorter than that

/// What is less than `least` [m^3] stays with the largest piece, as a part of its surface: needles between strokes are
/// no bodies.
void keepCrumbs(double least, std::vector<IncisedPiece>& pieces) {
  std::vector<IncisedPiece> kept;
  for (IncisedPiece& piece : pieces) {
    if (kept.empty() || signedVolume(piece.mesh) >= least) {
      kept.push_back(std::move(piece));
      continue;
    }
    IncisedPiece& main = kept.front();
    const Index first = static_cast<Index>(main.mesh.vertices.size());
    main.mesh.vertices.insert(main.mesh.vertices.end(), piece.mesh.vertices.begin(), piece.mesh.vertices.end());
    for (const Triangle& t : piece.mesh.triangles)
      main.mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    main.mesh.patches.insert(main.mesh.patches.end(), piece.mesh.patches.begin(), piece.mesh.patches.end());
    main.facing.insert(main.facing.end(), piece.facing.begin(), piece.facing.end());
    main.origins.append(piece.origins);
  }
  pieces = std::move(kept);
}

Result<IncisedBody> inciseFilled(const BodyModel& model, const BodyState& state, const Blade& blade,
                                 const InciseOptions& options, const std::vector<TissuePlace>& places) {
  Result<Incision> incision = Error(), contact_incision = Error();
  const MetBody met(model, state);
  atOnce([&] { incision = incise(met.surface, blade, options); },
         [&] {
           if (model.collision) contact_incision = incise(met.collision, blade, options);
         });
  if (!incision) return incision.error();
  keepCrumbs(kCrumb * std::pow(model.spacing, 3), incision->pieces);
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
