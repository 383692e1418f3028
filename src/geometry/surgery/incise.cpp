// The stages of an incision, one after the other: the wound rim, the wound faces, the joined surface, solids, checks.
#include "meshless_surgery/geometry/surgery/incise.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "incise_parts.h"
#include "mesh/edge_balance.h"
#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

using namespace incising;

std::string number(double x) { return numberText(x, 12); }

Status checkBlade(const Blade& blade, const InciseOptions& options) {
  if (!blade.origin.allFinite() || !blade.x_axis.allFinite() || !blade.y_axis.allFinite())
    return Error{ErrorCode::kInvalidArgument, "the blade's pose has a coordinate that is not finite"};
  if (!(std::abs(blade.x_axis.norm() - 1.0) < 1e-6 && std::abs(blade.y_axis.norm() - 1.0) < 1e-6))
    return Error{ErrorCode::kInvalidArgument, "the blade's axes have lengths " + number(blade.x_axis.norm()) + " and " +
                                                  number(blade.y_axis.norm()) + "; they must be 1 (within 1e-6)"};
  if (!(std::abs(blade.x_axis.dot(blade.y_axis)) < 1e-6))
    return Error{ErrorCode::kInvalidArgument, "the blade's axes have a dot product of " +
                                                  number(blade.x_axis.dot(blade.y_axis)) +
                                                  "; it must be 0 (within 1e-6)"};
  if (!(blade.length > 0.0) || !std::isfinite(blade.length))
    return Error{ErrorCode::kInvalidArgument,
                 "the blade's length is " + number(blade.length) + " m; it must be above 0 and finite"};
  if (!(blade.depth > 0.0) || !std::isfinite(blade.depth))
    return Error{ErrorCode::kInvalidArgument,
                 "the blade's depth is " + number(blade.depth) + " m; it must be above 0 and finite"};
  if (!(options.band >= 1e-12 && options.band <= 1e-3))
    return Error{ErrorCode::kInvalidArgument,
                 "the incision's band is " + number(options.band) + "; it must be within 1e-12 .. 1e-3"};
  if (!(options.spacing >= 0.0) || !std::isfinite(options.spacing))
    return Error{ErrorCode::kInvalidArgument,
                 "the wound faces' spacing is " + number(options.spacing) + " m; it must be 0 or above, and finite"};
  return Done{};
}

Status checkMesh(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) return Error{ErrorCode::kUnsuitableShape, "the surface has no triangles"};
  if (!mesh.patches.empty() && mesh.patches.size() != mesh.triangles.size())
    return Error{ErrorCode::kInvalidArgument, "the surface has " + std::to_string(mesh.patches.size()) +
                                                  " patch ids for " + std::to_string(mesh.triangles.size()) +
                                                  " triangles; it must have one each, or none"};
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    if (!mesh.vertices[v].allFinite())
      return Error{ErrorCode::kUnsuitableShape, "vertex " + std::to_string(v) + " of the surface is not finite"};
  std::uint64_t balance = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& triangle = mesh.triangles[t];
    for (const Index v : triangle)
      if (v >= mesh.vertices.size())
        return Error{ErrorCode::kUnsuitableShape, "triangle " + std::to_string(t) + " names vertex " +
                                                      std::to_string(v) + " of " +
                                                      std::to_string(mesh.vertices.size())};
    if (namesAVertexTwice(triangle))
      return Error{ErrorCode::kUnsuitableShape, "triangle " + std::to_string(t) + " has a vertex twice"};
    balance += edgeBalance(triangle);
  }
  if (balance != 0)
    return Error{
        ErrorCode::kUnsuitableShape,
        "the surface is open or not oriented: it has edges with more triangles in one direction than in the other"};
  return Done{};
}

double areaOf(const TriangleMesh& mesh, std::size_t t) {
  const Triangle& v = mesh.triangles[t];
  return 0.5 * (mesh.vertices[v[1]] - mesh.vertices[v[0]]).cross(mesh.vertices[v[2]] - mesh.vertices[v[0]]).norm();
}

/// A last check of what would be handed out.
Status checkOpened(const TriangleMesh& mesh, const OpenedSurface& opened) {
  const double before = signedVolume(mesh), after = signedVolume(opened.mesh), area = surfaceArea(mesh);
  const Box box = boundsOf(mesh.vertices);
  // Crumbs far from the origin are only as exact as their coordinates.
  const double rounding = 4e-16 * std::max(box.min.cwiseAbs().maxCoeff(), box.max.cwiseAbs().maxCoeff());
  if (!(std::abs(after - before) <= 1e-9 * std::abs(before) + rounding * area))
    return Error{ErrorCode::kUnsuitableShape,
                 "the volume would become " + number(after) + " instead of " + number(before) + " m^3"};
  const double least = 1e-13 * area / static_cast<double>(mesh.triangles.size());
  for (std::size_t t = 0; t < opened.mesh.triangles.size(); ++t) {
    if (t < mesh.triangles.size() && opened.mesh.triangles[t] == mesh.triangles[t]) continue;
    if (areaOf(opened.mesh, t) > least) continue;
    if (t < mesh.triangles.size() && !(areaOf(mesh, t) > 100.0 * least)) continue;  // it was like that
    return Error{ErrorCode::kUnsuitableShape, "the incision would leave a triangle without area"};
  }
  return Done{};
}

/// `in_surface`: set where triangles of the mesh lie in the blade.
Result<Incision> inciseOnce(const TriangleMesh& mesh, const Blade& blade, const InciseOptions& options,
                            bool& in_surface) {
  Result<SplitSurface> surface = splitAtBlade(mesh, blade, options.band, options.follow);
  if (!surface) return surface.error();
  in_surface |= surface->lies_in_surface;
  // Fronts and rims of earlier incisions in the plane may lie on the rim, split in other places.
  if (surface->along_edges) splitRimAtVertices(*surface);
  Result<WoundFaces> wound = fillWoundFaces(*surface, options, true);
  const auto failed = [&] { return !wound && wound.error().code == ErrorCode::kUnsuitableShape; };
  if (failed() && splitRimAtVertices(*surface)) wound = fillWoundFaces(*surface, options, true);
  // Where the rim crosses itself, what only touches the plane may be why.
  if (failed()) wound = fillWoundFaces(*surface, options, false);
  if (!wound) return wound.error();
  const Result<OpenedSurface> opened = seal(*surface, *wound, options.patch);
  if (!opened) return opened.error();
  const Status sound = checkOpened(mesh, *opened);
  if (!sound) return sound.error();
  Result<std::vector<IncisedPiece>> pieces = separate(*opened);
  if (!pieces) return pieces.error();
  Incision incision;
  incision.pieces = std::move(*pieces);
  for (std::size_t t = 0; t < opened->mesh.triangles.size(); ++t)
    if (opened->facing[t] > 0) incision.opened_area += areaOf(opened->mesh, t);
  return incision;
}

}  // namespace

Result<Incision> incise(const TriangleMesh& mesh, const Blade& blade, const InciseOptions& options) {
  Status checked = checkBlade(blade, options);
  if (checked) checked = checkMesh(mesh);
  if (!checked) return checked.error();
  bool in_surface = false;
  Result<Incision> incision = inciseOnce(mesh, blade, options, in_surface);
  const auto failed = [&] { return !incision && incision.error().code == ErrorCode::kUnsuitableShape; };
  // Vertices used where they are, a little off the plane, can make a sound rim cross itself: a narrower band has fewer.
  InciseOptions narrower = options;
  for (int retry = 0; retry < 2 && failed(); ++retry) {
    narrower.band *= 1e-2;
    Result<Incision> again = inciseOnce(mesh, blade, narrower, in_surface);
    if (again) return again;
  }
  // Wound faces that nearly lie in the blade's plane cross it wherever rounding has it; a little beside the plane they
  // do not. This is not done where wound faces do lie in it: a second cut beside the first would part a sheet from the
  // tissue.
  for (int retry = 0; retry < 2 && failed() && !in_surface; ++retry) {
    Blade beside = blade;
    beside.origin +=
        (retry == 0 ? 4.0 : -4.0) * options.band * boundsOf(mesh.vertices).diagonal() * blade.plane().normal;
    Result<Incision> again = inciseOnce(mesh, beside, options, in_surface);
    if (again) return again;
  }
  return incision;
}

}  // namespace meshless
