#include "meshless_surgery/body/cut_body.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cut_cells.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr double kApart = 4.0;  // [spacing] tissue that meets now and is farther apart at rest lies in itself
constexpr double kBand = 3e-3;  // [spacing] vertices that close to a blade are on it: no edges are shorter than that

/// What is less than `least` [m^3] stays with the largest piece, as a part of its surface: needles between strokes are
/// no bodies.
void keepCrumbs(double least, std::vector<IncisedPiece>& pieces) {
  std::vector<IncisedPiece> kept;
  for (IncisedPiece& piece : pieces) {
    if (kept.empty() || signedVolume(piece.mesh) >= least)
      kept.push_back(std::move(piece));
    else
      kept.front().append(piece);
  }
  pieces = std::move(kept);
}

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

Result<CutBody> cutBody(const BodyModel& model, const BodyState& state, const Blade& blade,
                        const CutBodyOptions& wanted) {
  if (!model.solid) return Error{ErrorCode::kUnsuitableShape, "its surface is open, so it has no inside to be cut"};
  InciseOptions options;
  options.patch = model.next_patch;
  options.roughness = wanted.roughness;
  options.seed = wanted.seed;
  options.apart = kApart * model.spacing;
  options.follow = kFollow * model.spacing;
  const double extent = boundsOf(state.surface).diagonal();
  if (extent > 0.0) options.band = std::min(kBand * model.spacing / extent, 1e-3);
  const auto opened = [&](const TriangleMesh& mesh, const Blade& by, const Points* rest) {
    InciseOptions mine = options;
    mine.rest = rest;
    Result<Incision> incision = incise(mesh, by, mine);
    if (incision || incision.error().code != ErrorCode::kUnsuitableShape) return incision;
    // Vertices used where they are, a little off the blade, can make a sound rim cross itself.
    mine.band = InciseOptions().band;
    mine.follow = 0.0;
    Result<Incision> again = incise(mesh, by, mine);
    return again ? again : incision;
  };
  MetBody met = wanted.at_rest ? MetBody(model) : MetBody(model, state);
  const bool here = !wanted.at_rest;
  Blade by = blade;
  Result<Incision> seen = Error(), touched = Error();
  atOnce([&] { seen = opened(met.surface, by, here ? &model.surface.vertices : nullptr); },
         [&] {
           if (model.collision) touched = opened(met.collision, by, here ? &model.collision->mesh.vertices : nullptr);
         });
  // Where tissue lies in itself within the blade, at rest it does not.
  const bool clear = !here || (seen ? !seen->layered : seen.error().code != ErrorCode::kUnsuitableShape);
  if (!clear)
    if (const std::optional<Blade> led = bladeAtRest(model, state, blade)) {
      MetBody at_rest(model);
      Result<Incision> again = opened(at_rest.surface, *led, nullptr);
      if (again && !again->layered) {
        seen = std::move(again);
        if (model.collision) touched = opened(at_rest.collision, *led, nullptr);
        met = std::move(at_rest);
        by = *led;
      }
    }
  if (!seen) return seen.error();
  if (blade.bounded()) keepCrumbs(kCrumb * std::pow(model.spacing, 3), seen->pieces);
  CutBody result;
  result.opened_area = seen->opened_area;
  Result<std::vector<BodyPiece>> pieces = cutCells(model, state, met, by, std::move(seen->pieces),
                                                   touched ? std::move(touched->pieces) : std::vector<IncisedPiece>(),
                                                   wanted.places, options.patch, result.work);
  if (!pieces) return pieces.error();
  result.pieces = std::move(*pieces);
  return result;
}

}  // namespace meshless
