#include "meshless_surgery/body/cut_body.h"

#include <algorithm>

#include "cut_cells.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr double kSnap = 0.2;  // [spacing] shorter edges would cost contact much, and cells do not resolve them

}  // namespace

CutWork& CutWork::operator+=(const CutWork& other) {
  new_vertices += other.new_vertices;
  new_triangles += other.new_triangles;
  bound_embedded += other.bound_embedded;
  kept_embedded += other.kept_embedded;
  kept_clusters += other.kept_clusters;
  rebuilt_clusters += other.rebuilt_clusters;
  return *this;
}

namespace {

Result<CutBody> cutFilled(const BodyModel& model, const BodyState& state, const Plane& plane, const CutOptions& options,
                          const std::vector<TissuePlace>& places) {
  Result<CutSurface> cut = Error(), cut_contact = Error();
  const MetBody met(model, state);
  atOnce([&] { cut = cutByPlane(met.surface, plane, options); },
         [&] {
           if (!model.collision) return;
           CutOptions likewise = options;
           likewise.rest = &model.collision->mesh.vertices;
           cut_contact = cutByPlane(met.collision, plane, likewise);
         });
  if (!cut) return cut.error();
  std::vector<CellPieceSource> sources, collision;
  for (const CutPiece& piece : cut->pieces) sources.push_back({piece.mesh, piece.origins});
  if (cut_contact)
    for (const CutPiece& piece : cut_contact->pieces) collision.push_back({piece.mesh, piece.origins});
  CutBody result;
  result.cap_area = cut->cap_area;
  Result<std::vector<BodyPiece>> pieces =
      cutCells(model, state, met, BladeGate(plane), sources, collision, places, options.cap_patch, result.work);
  if (!pieces) return pieces.error();
  result.pieces = std::move(*pieces);
  return result;
}

}  // namespace

Result<CutBody> cutBody(const BodyModel& model, const BodyState& state, const Plane& plane,
                        const CutBodyOptions& wanted) {
  if (!model.solid)
    return Error{ErrorCode::kUnsuitableShape, "its surface is open, so it cannot be cut into closed pieces"};
  CutOptions options;
  options.cap_patch = model.next_patch;
  options.cap_points = kUsualCapPoints;
  options.roughness = wanted.roughness;
  options.seed = wanted.seed;
  options.rest = &model.surface.vertices;
  options.apart = kOneTissue * model.spacing;
  options.snap = kSnap * model.spacing;
  return cutFilled(model, state, plane, options, wanted.places);
}

}  // namespace meshless
