// The stages of an incision, one after the other: the wound rim, the wound faces, the joined surface, solids, checks.
#include "meshless_surgery/geometry/surgery/incise.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "mesh/edge_balance.h"
#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "surgery_parts.h"

namespace meshless {
namespace {

using namespace surgery;

std::string number(double x) { return numberText(x, 12); }

Status checkBlade(const Blade& blade) {
  if (!blade.origin.allFinite() || !blade.x_axis.allFinite() || !blade.y_axis.allFinite())
    return Error{ErrorCode::kInvalidArgument, "the blade's pose has a coordinate that is not finite"};
  if (!(std::abs(blade.x_axis.norm() - 1.0) < 1e-6 && std::abs(blade.y_axis.norm() - 1.0) < 1e-6))
    return Error{ErrorCode::kInvalidArgument, "the blade's axes have lengths " + number(blade.x_axis.norm()) + " and " +
                                                  number(blade.y_axis.norm()) + "; they must be 1 (within 1e-6)"};
  if (!(std::abs(blade.x_axis.dot(blade.y_axis)) < 1e-6))
    return Error{ErrorCode::kInvalidArgument, "the blade's axes have a dot product of " +
                                                  number(blade.x_axis.dot(blade.y_axis)) +
                                                  "; it must be 0 (within 1e-6)"};
  const auto outOfRange = [](const char* what, double value, const char* bound) {
    return Error{ErrorCode::kInvalidArgument,
                 std::string("the blade's ") + what + " is " + number(value) + " m; it must be " + bound};
  };
  if (!blade.bounded()) return Done{};
  if (!(blade.length > 0.0) || !std::isfinite(blade.length))
    return outOfRange("length", blade.length, "above 0 and finite");
  if (!(blade.depth > 0.0) || !std::isfinite(blade.depth))
    return outOfRange("depth", blade.depth, "above 0 and finite");
  if (!(blade.rise >= 0.0) || !std::isfinite(blade.rise))
    return outOfRange("rise", blade.rise, "0 or above, and finite");
  if (!(blade.behind >= 0.0) || !std::isfinite(blade.behind))
    return outOfRange("reach behind its origin", blade.behind, "0 or above, and finite");
  return Done{};
}

Status checkOptions(const InciseOptions& options) {
  if (!(options.band >= 1e-12 && options.band <= 1e-3))
    return Error{ErrorCode::kInvalidArgument,
                 "the blade's band is " + number(options.band) + "; it must be within 1e-12 .. 1e-3"};
  if (!(options.spacing >= 0.0) || !std::isfinite(options.spacing))
    return Error{ErrorCode::kInvalidArgument,
                 "the wound faces' spacing is " + number(options.spacing) + " m; it must be 0 or above, and finite"};
  if (!(options.roughness >= 0.0 && options.roughness < 1e300))
    return Error{ErrorCode::kInvalidArgument,
                 "the cut's roughness is " + number(options.roughness) + " m; it must not be negative"};
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

/// Bounds, and what rounding makes of a coordinate there: crumbs may lie far from the origin.
struct Extent {
  Box box;
  double farthest;  // [m]
};

Extent extentOf(const TriangleMesh& mesh) {
  const Box box = boundsOf(mesh.vertices);
  return {box, std::max(box.min.cwiseAbs().maxCoeff(), box.max.cwiseAbs().maxCoeff())};
}

Frame frameOf(const Blade& blade, const Extent& extent) {
  Frame f;
  f.origin = blade.origin;
  f.x_axis = blade.x_axis.normalized();
  f.y_axis = (blade.y_axis - f.x_axis.dot(blade.y_axis) * f.x_axis).normalized();
  f.normal = f.x_axis.cross(f.y_axis);
  f.bounded = blade.bounded();
  if (f.bounded) {
    f.low = Vec2(-blade.behind, -blade.depth);
    f.high = Vec2(blade.length, blade.rise);
  } else {
    // A plane given by a far point would cost digits at every vertex.
    const Vec3 middle = 0.5 * (extent.box.min + extent.box.max);
    f.origin = middle - f.normal.dot(middle - blade.origin) * f.normal;
  }
  return f;
}

/// A plane that goes through a solid leaves something thicker than the band on both sides.
Status checkSides(const std::vector<IncisedPiece>& pieces, const Frame& frame, double band) {
  bool any_above = false, any_below = false;
  for (const IncisedPiece& piece : pieces) {
    double low = 0.0, high = 0.0;
    for (Index v = 0; v < piece.mesh.vertices.size(); ++v) {
      if (piece.origins.insideCap(v)) continue;
      const double height = frame.height(piece.mesh.vertices[v]);
      low = std::min(low, height);
      high = std::max(high, height);
    }
    if (!(high > frame.band) && !(low < -frame.band))
      return Error{ErrorCode::kMissed,
                   "the plane only grazes the surface: a piece would be thinner than " + number(band) + " of its size"};
    (high > -low ? any_above : any_below) = true;
  }
  if (!any_above || !any_below)
    return Error{ErrorCode::kMissed, "the plane only grazes the surface: a side would be empty"};
  return Done{};
}

Result<Incision> inciseIn(const TriangleMesh& mesh, Frame frame, const Extent& extent, const InciseOptions& options) {
  const double rounding = std::max(extent.farthest, frame.bounded ? frame.origin.cwiseAbs().maxCoeff() : 0.0);
  frame.band = std::max(options.band * extent.box.diagonal(), 1e-14 * rounding);
  Result<SplitSurface> surface = splitAtBlade(mesh, frame, options.follow);
  if (!surface) return surface.error();
  const Result<Wound> wound = fillWound(*surface, options);
  if (!wound) return wound.error();
  Incision incision;
  for (const WoundTriangle& t : wound->triangles) incision.layered |= t.winding != 1;
  const Result<OpenedSurface> opened = join(std::move(*surface), *wound, options.patch);
  if (!opened) return opened.error();
  std::array<double, 2> volumes;
  incision.pieces = separate(*opened, frame, volumes);
  const double before = signedVolume(mesh);
  const double off = std::abs(volumes[0] - before);
  if (!(off <= 1e-9 * volumes[1]) && !(off <= 1e-9 * volumes[1] + 4e-16 * extent.farthest * surfaceArea(mesh)))
    return Error{ErrorCode::kUnsuitableShape, "the pieces' volumes would add up to " + number(volumes[0]) +
                                                  " instead of " + number(before) +
                                                  " m^3; the surface crosses itself too badly where it is cut"};
  if (!frame.bounded) {
    const Status sides = checkSides(incision.pieces, frame, options.band);
    if (!sides) return sides.error();
  }
  std::array<double, 2> areas{0.0, 0.0};
  for (std::size_t t = 0; t < opened->mesh.triangles.size(); ++t) {
    if (opened->facing[t] == 0) continue;
    // As they lie in the plane, however rough they are.
    const Triangle& v = opened->mesh.triangles[t];
    const Vec2 a = frame.flat(opened->mesh.vertices[v[0]]), b = frame.flat(opened->mesh.vertices[v[1]]) - a,
               c = frame.flat(opened->mesh.vertices[v[2]]) - a;
    areas[opened->facing[t] > 0] += 0.5 * std::abs(b.x() * c.y() - b.y() * c.x());
  }
  // A sheet without thickness between an earlier wound face and a new one is nothing that was opened.
  incision.opened_area = std::min(areas[0], areas[1]);
  return incision;
}

}  // namespace

Result<Incision> incise(const TriangleMesh& mesh, const Blade& blade, const InciseOptions& options) {
  Status checked = checkBlade(blade);
  if (checked) checked = checkOptions(options);
  if (checked) checked = checkMesh(mesh);
  if (!checked) return checked.error();
  const Extent extent = extentOf(mesh);
  return inciseIn(mesh, frameOf(blade, extent), extent, options);
}

}  // namespace meshless
