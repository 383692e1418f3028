// The stages of a cut, one after the other: heights and sides, the rim, the cap, pairing and umbrellas, solids, checks.
#include "meshless_surgery/geometry/cut.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "cut_cap.h"
#include "cut_parts.h"
#include "cut_pieces.h"
#include "cut_rim.h"
#include "meshless_surgery/geometry/measures.h"

namespace meshless {
namespace {

using namespace cutting;

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.12g", x);
  return text;
}

Status checkInput(const TriangleMesh& mesh, const Plane& plane, const CutOptions& options) {
  if (!plane.point.allFinite() || !plane.normal.allFinite())
    return Error{ErrorCode::kInvalidArgument, "the plane has a coordinate that is not finite"};
  if (!(std::abs(plane.normal.norm() - 1.0) < 1e-6))
    return Error{ErrorCode::kInvalidArgument, "the plane's normal has length " + number(plane.normal.norm()) +
                                                  "; it must be 1 (within 1e-6)"};
  if (!(options.band >= 1e-12 && options.band <= 1e-3))
    return Error{ErrorCode::kInvalidArgument,
                 "the cut's band is " + number(options.band) + "; it must be within 1e-12 .. 1e-3"};
  if (mesh.triangles.empty()) return Error{ErrorCode::kUnsuitableShape, "the surface has no triangles"};
  if (!mesh.patches.empty() && mesh.patches.size() != mesh.triangles.size())
    return Error{ErrorCode::kInvalidArgument, "the surface has " + std::to_string(mesh.patches.size()) +
                                                  " patch ids for " + std::to_string(mesh.triangles.size()) +
                                                  " triangles; it must have one each, or none"};
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    if (!mesh.vertices[v].allFinite())
      return Error{ErrorCode::kUnsuitableShape, "vertex " + std::to_string(v) + " of the surface is not finite"};
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const Index v : mesh.triangles[t])
      if (v >= mesh.vertices.size())
        return Error{ErrorCode::kUnsuitableShape, "triangle " + std::to_string(t) + " names vertex " +
                                                      std::to_string(v) + " of " +
                                                      std::to_string(mesh.vertices.size())};
  return Done{};
}

/// Puts the cap on both sides, layer by layer of winding. Returns the area of one side [m^2].
double addCap(Workpiece& work, const std::vector<Index>& vertex_of_node, const std::vector<CapTriangle>& cap,
              std::uint32_t patch) {
  double area = 0.0;
  for (const CapTriangle& c : cap) {
    const Index i = vertex_of_node[c.nodes[0]], j = vertex_of_node[c.nodes[1]], k = vertex_of_node[c.nodes[2]];
    const double size =
        0.5 * (work.positions[j] - work.positions[i]).cross(work.positions[k] - work.positions[i]).norm();
    const int sign = c.winding > 0 ? 1 : -1;
    for (int layer = sign; std::abs(layer) <= std::abs(c.winding); layer += sign) {
      const Triangle facing_up = {i, j, k}, facing_down = {k, j, i};
      work.sides[kLower].addCap(sign > 0 ? facing_up : facing_down, patch, layer);
      work.sides[kUpper].addCap(sign > 0 ? facing_down : facing_up, patch, layer);
      area += size;
    }
  }
  return area;
}

/// A last look at what would be handed out.
Status checkPieces(const TriangleMesh& mesh, const std::vector<CutPiece>& pieces) {
  double sum = 0.0, magnitude = 0.0;
  for (const CutPiece& piece : pieces) {
    // Every directed edge adds a number that its opposite takes away again: nothing is left of a closed surface.
    std::uint64_t balance = 0;
    for (const Triangle& t : piece.mesh.triangles) {
      for (int k = 0; k < 3; ++k) {
        const std::uint64_t a = t[k], b = t[(k + 1) % 3];
        std::uint64_t mixed = ((std::min(a, b) << 32) | std::max(a, b)) + 0x9e3779b97f4a7c15u;
        mixed = (mixed ^ (mixed >> 30)) * 0xbf58476d1ce4e5b9u;
        mixed = (mixed ^ (mixed >> 27)) * 0x94d049bb133111ebu;
        mixed ^= mixed >> 31;
        balance += a < b ? mixed : ~mixed + 1u;
        if (a == b) return Error{ErrorCode::kUnsuitableShape, "the cut would leave a triangle without area"};
      }
    }
    if (balance != 0) return Error{ErrorCode::kUnsuitableShape, "the surface is open or not oriented: it has edges with more triangles in "
                                                     "one direction than in the other"};
    const double volume = signedVolume(piece.mesh);
    sum += volume;
    magnitude += std::abs(volume);
  }
  const double whole = signedVolume(mesh);
  // Crumbs far from the origin are only as exact as their coordinates.
  const Box box = boundsOf(mesh.vertices);
  const double rounding = 4e-16 * std::max(box.min.cwiseAbs().maxCoeff(), box.max.cwiseAbs().maxCoeff());
  if (!(std::abs(sum - whole) <= 1e-9 * magnitude + rounding * surfaceArea(mesh)))
    return Error{ErrorCode::kUnsuitableShape, "the pieces' volumes would add up to " + number(sum) + " instead of " +
                                                  number(whole) +
                                                  " m^3; the surface crosses itself too badly where it is cut"};
  return Done{};
}

/// A mesh taken apart at the plane, with the cap that is to close it.
struct Section {
  Workpiece work;
  Nodes nodes;
  std::vector<CapTriangle> cap;
};

/// Splits the rim where it meets itself and fills it anew. False where rounding does not let it.
bool resolve(const std::vector<RimEdge>& rim, Section& section) {
  if (!splitRim(section.work, rim, section.nodes)) return false;
  const Result<std::vector<RimEdge>> split = rimOf(section.work);
  return split && triangulateCap(section.nodes.places, outlineOf(section.nodes, *split), section.cap) == CapState::kFilled;
}

Result<CutSurface> finish(const TriangleMesh& mesh, Section section, const CutOptions& options) {
  CutSurface cut;
  cut.cap_area = addCap(section.work, section.nodes.lowestVertices(), section.cap, options.cap_patch);
  const std::vector<Index> merged = section.nodes.mergedVertices();
  std::vector<Shell> shells;
  for (const Side side : {kUpper, kLower}) {
    Result<std::vector<Shell>> found = shellsOf(section.work, merged, side);
    if (!found) return found.error();
    if (found->empty()) return Error{ErrorCode::kMissed, "the plane only grazes the surface: a side would be empty"};
    for (Shell& shell : *found) {
      if (shell.flat)
        return Error{ErrorCode::kMissed, "the plane only grazes the surface: a piece would be thinner than " +
                                             number(options.band) + " of its size"};
      shells.push_back(std::move(shell));
    }
  }
  cut.pieces = piecesOf(std::move(shells));
  const Status sound = checkPieces(mesh, cut.pieces);
  if (!sound) return sound.error();
  return cut;
}

Result<CutSurface> cutOnce(const TriangleMesh& mesh, const Plane& plane, const CutOptions& options) {
  Result<Workpiece> split = splitAtPlane(mesh, plane, options);
  if (!split) return split.error();
  const Result<std::vector<RimEdge>> rim = rimOf(*split);
  if (!rim) return rim.error();
  Section plain{std::move(*split), {}, {}};
  plain.nodes = nodesOf(plain.work, *rim);
  const CapState state = triangulateCap(plain.nodes.places, outlineOf(plain.nodes, *rim), plain.cap);
  if (state == CapState::kUnbalanced)
    return Error{ErrorCode::kUnsuitableShape, "the surface is open or not oriented where the plane meets it"};
  const bool filled = state == CapState::kFilled;
  if (filled && !hasSlivers(plain.nodes.places, plain.cap)) return finish(mesh, std::move(plain), options);

  // The rim crosses itself, or lies on itself but for rounding.
  Section resolved{plain.work, plain.nodes, {}};
  Result<CutSurface> cut = Error{ErrorCode::kUnsuitableShape,
                                 "the surface crosses itself where it is cut, and cannot be closed there"};
  if (resolve(*rim, resolved)) cut = finish(mesh, std::move(resolved), options);
  if (!cut && filled) return finish(mesh, std::move(plain), options);
  return cut;
}

}  // namespace

Result<CutSurface> cutByPlane(const TriangleMesh& mesh, const Plane& plane, const CutOptions& options) {
  const Status checked = checkInput(mesh, plane, options);
  if (!checked) return checked.error();
  Result<CutSurface> cut = cutOnce(mesh, plane, options);
  // Vertices used where they are, a little off the plane, can make a sound rim cross itself: a narrower band has fewer.
  CutOptions narrower = options;
  for (int retry = 0; retry < 2 && !cut && cut.error().code == ErrorCode::kUnsuitableShape; ++retry) {
    narrower.band *= 1e-2;
    Result<CutSurface> again = cutOnce(mesh, plane, narrower);
    if (again) return again;
  }
  return cut;
}

}  // namespace meshless
