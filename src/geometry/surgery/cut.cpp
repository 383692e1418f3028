// The stages of a cut, one after the other: heights and sides, the rim, the cap, pairing and umbrellas, solids, checks.
#include "meshless_surgery/geometry/surgery/cut.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "cap_apart.h"
#include "cap_rough.h"
#include "cut_cap.h"
#include "cut_parts.h"
#include "cut_pieces.h"
#include "cut_rim.h"
#include "mesh/edge_balance.h"
#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

using namespace cutting;

std::string number(double x) { return numberText(x, 12); }

/// Bounds [m] that are not finite where a point is not.
Box boundsOfAll(const Points& points) {
  // Two points at a time, for the sake of vectors; an odd last one is looked at twice.
  using Two = Eigen::Array<double, 6, 1>;
  Box box;
  if (points.empty()) return box;
  Two low, high;
  low << points.back().array(), points.back().array();
  high = low;
  Two nothing = 0.0 * low;
  for (std::size_t i = 0; i + 1 < points.size(); i += 2) {
    const Eigen::Map<const Two> p(points[i].data());
    low = low.min(p);
    high = high.max(p);
    nothing += 0.0 * p;
  }
  box.min = low.head<3>().min(low.tail<3>()).matrix();
  box.max = high.head<3>().max(high.tail<3>()).matrix();
  box.min.x() += nothing.sum();
  return box;
}

Status checkInput(const TriangleMesh& mesh, const Plane& plane, const CutOptions& options, Box& box) {
  if (!plane.point.allFinite() || !plane.normal.allFinite())
    return Error{ErrorCode::kInvalidArgument, "the plane has a coordinate that is not finite"};
  if (!(std::abs(plane.normal.norm() - 1.0) < 1e-6))
    return Error{ErrorCode::kInvalidArgument,
                 "the plane's normal has length " + number(plane.normal.norm()) + "; it must be 1 (within 1e-6)"};
  if (!(options.band >= 1e-12 && options.band <= 1e-3))
    return Error{ErrorCode::kInvalidArgument,
                 "the cut's band is " + number(options.band) + "; it must be within 1e-12 .. 1e-3"};
  if (mesh.triangles.empty()) return Error{ErrorCode::kUnsuitableShape, "the surface has no triangles"};
  if (!mesh.patches.empty() && mesh.patches.size() != mesh.triangles.size())
    return Error{ErrorCode::kInvalidArgument, "the surface has " + std::to_string(mesh.patches.size()) +
                                                  " patch ids for " + std::to_string(mesh.triangles.size()) +
                                                  " triangles; it must have one each, or none"};
  if (!(options.roughness >= 0.0 && options.roughness < 1e300))
    return Error{ErrorCode::kInvalidArgument,
                 "the cut's roughness is " + number(options.roughness) + " m; it must not be negative"};
  box = boundsOfAll(mesh.vertices);
  const bool finite = box.min.allFinite() && box.max.allFinite();
  for (std::size_t v = 0; !finite && v < mesh.vertices.size(); ++v)
    if (!mesh.vertices[v].allFinite())
      return Error{ErrorCode::kUnsuitableShape, "vertex " + std::to_string(v) + " of the surface is not finite"};
  // The highest bit tells: of v, or of last - v. (There are fewer than 2^31 vertices.)
  const Index last = static_cast<Index>(mesh.vertices.size()) - 1;
  Index beyond = mesh.vertices.empty() ? ~Index{0} : 0;
  const Index* corners = mesh.triangles.front().data();
  for (std::size_t i = 0; i < 3 * mesh.triangles.size(); ++i) beyond |= corners[i] | (last - corners[i]);
  for (std::size_t t = 0; (beyond >> 31) != 0 && t < mesh.triangles.size(); ++t)
    for (const Index v : mesh.triangles[t])
      if (v >= mesh.vertices.size())
        return Error{ErrorCode::kUnsuitableShape, "triangle " + std::to_string(t) + " names vertex " +
                                                      std::to_string(v) + " of " +
                                                      std::to_string(mesh.vertices.size())};
  return Done{};
}

/// A mesh taken apart at the plane, with the cap that is to close it.
struct Section {
  Workpiece work;
  Nodes nodes;
  std::vector<OutlineSegment> outline;
  CapCore core;
  std::vector<CapTriangle> cap;  // all but the core's triangles
  bool apart = false;            // of parts that overlap
};

/// Puts the cap on both sides, layer by layer of winding. Returns the area of one side [m^2], in the
/// plane.
double addCap(Section& section, const CutOptions& options) {
  Workpiece& work = section.work;
  work.first_inner = work.endVertex();
  work.new_positions.reserve(work.new_positions.size() + section.core.places.size());
  work.new_origins.reserve(work.new_origins.size() + section.core.places.size());
  for (const Vec2& place : section.core.places) work.addVertex(work.solid(place), VertexOrigin());
  std::vector<Index> vertex_of_node = section.nodes.lowestVertices();
  for (Index v = work.first_inner; v < work.endVertex(); ++v) vertex_of_node.push_back(v);
  const auto sizeOf = [&](Index i, Index j, Index k) {
    return 0.5 * (work.position(j) - work.position(i)).cross(work.position(k) - work.position(i)).norm();
  };
  double area = 0.0;
  for (const CapTriangle& c : section.cap) {
    const Index i = vertex_of_node[c.nodes[0]], j = vertex_of_node[c.nodes[1]], k = vertex_of_node[c.nodes[2]];
    const double size = sizeOf(i, j, k);
    const int sign = c.winding > 0 ? 1 : -1;
    for (int layer = sign; std::abs(layer) <= std::abs(c.winding); layer += sign) {
      const Triangle facing_up = {i, j, k}, facing_down = {k, j, i};
      work.sides[kLower].addCap(sign > 0 ? facing_up : facing_down, options.cap_patch, layer);
      work.sides[kUpper].addCap(sign > 0 ? facing_down : facing_up, options.cap_patch, layer);
      area += size;
    }
  }
  const Index first = work.first_inner;
  for (const Triangle& t : section.core.triangles) area += sizeOf(first + t[0], first + t[1], first + t[2]);

  if (options.roughness > 0.0) {
    std::vector<Triangle> inner;
    for (const CapTriangle& c : section.cap) {
      const Triangle t = {vertex_of_node[c.nodes[0]], vertex_of_node[c.nodes[1]], vertex_of_node[c.nodes[2]]};
      if (t[0] >= first || t[1] >= first || t[2] >= first) inner.push_back(t);
    }
    for (const Triangle& t : section.core.triangles) inner.push_back({first + t[0], first + t[1], first + t[2]});
    roughen(work, section.nodes.places, section.outline, section.core, inner, options.roughness, options.seed);
  }
  return area;
}

double sixVolumes(const Points& points, const std::vector<Triangle>& triangles, std::size_t first, const Vec3& origin) {
  double sum = 0.0;
  for (std::size_t t = first; t < triangles.size(); ++t) {
    const Vec3 a = points[triangles[t][0]] - origin, b = points[triangles[t][1]] - origin;
    sum += a.dot(b.cross(points[triangles[t][2]] - origin));
  }
  return sum;
}

Error volumeError(double sum, double whole) {
  return {ErrorCode::kUnsuitableShape, "the pieces' volumes would add up to " + number(sum) + " instead of " +
                                           number(whole) +
                                           " m^3; the surface crosses itself too badly where it is cut"};
}

/// What rounding makes of a volume: crumbs far from the origin are only as exact as their coordinates.
double roundingOf(const TriangleMesh& mesh, const Box& box) {
  const double rounding = 4e-16 * std::max(box.min.cwiseAbs().maxCoeff(), box.max.cwiseAbs().maxCoeff());
  return rounding * surfaceArea(mesh);
}

/// True where the pieces' volumes add up to the mesh's. Untouched triangles count the same in both; left are those that
/// were touched, in whole and in parts, and the caps.
Status checkVolumes(const Workpiece& work, const std::vector<Shell>& shells, const Box& box) {
  double before = 0.0, after = 0.0, magnitude = 0.0;
  const Points& points = work.mesh->vertices;
  std::vector<Triangle> touched;
  for (const Index t : work.touched) touched.push_back(work.mesh->triangles[t]);
  // A vertex of the mesh: of a flat one the parts are then as small as its volume.
  const Vec3 origin = touched.empty() ? work.center : points[touched[0][0]];
  before = sixVolumes(points, touched, 0, origin);
  double sum = 0.0;
  for (const Shell& shell : shells) {
    after += sixVolumes(shell.piece.mesh.vertices, shell.piece.mesh.triangles, shell.untouched, origin);
    magnitude += std::abs(shell.volume);
    sum += shell.volume;
  }
  const double off = (after - before) / 6.0;
  if (std::abs(off) <= 1e-9 * magnitude) return Done{};
  // Rounding, in flat crumbs: what the whole sums say counts.
  const double whole = signedVolume(*work.mesh);
  if (std::abs(sum - whole) <= 1e-9 * magnitude + roundingOf(*work.mesh, box)) return Done{};
  return volumeError(sum, whole);
}

/// The same for every triangle and edge, from the pieces alone.
Status checkPieces(const TriangleMesh& mesh, const Box& box, const std::vector<CutPiece>& pieces) {
  double sum = 0.0, magnitude = 0.0;
  for (const CutPiece& piece : pieces) {
    std::uint64_t balance = 0;
    for (const Triangle& t : piece.mesh.triangles) {
      balance += edgeBalance(t);
      if (namesAVertexTwice(t))
        return Error{ErrorCode::kUnsuitableShape, "the cut would leave a triangle without area"};
    }
    if (balance != 0) return Error{ErrorCode::kUnsuitableShape, "a piece of the cut would be open"};
    const double volume = signedVolume(piece.mesh);
    sum += volume;
    magnitude += std::abs(volume);
  }
  const double whole = signedVolume(mesh);
  if (!(std::abs(sum - whole) <= 1e-9 * magnitude + roundingOf(mesh, box))) return volumeError(sum, whole);
  return Done{};
}

/// A cap with points inside, and without where those do not fit.
CapState fill(const Section& section, const std::vector<OutlineSegment>& outline, const CutOptions& options,
              CapCore& core, std::vector<CapTriangle>& cap) {
  const std::vector<Vec2>& places = section.nodes.places;
  core = coreOf(places, outline, section.work.spacing, options.cap_points);
  const CapState state = triangulateCap(places, outline, core, cap);
  if (state == CapState::kFilled || core.places.empty()) return state;
  core = {};
  return triangulateCap(places, outline, core, cap);
}

/// A cap for each of the parts that overlap. False where they cannot be told, or one of them overlaps itself.
bool fillApart(Section& section, const CutOptions& options) {
  if (!options.rest) return false;
  Points rest;
  for (const Index v : section.nodes.lowestVertices()) {
    rest.push_back(Vec3::Zero());
    const VertexOrigin origin = section.work.originOf(v);
    for (int k = 0; k < 4; ++k)
      if (origin.parents[k] != kNoIndex) rest.back() += origin.weights[k] * (*options.rest)[origin.parents[k]];
  }
  const Index first = static_cast<Index>(section.nodes.places.size());
  CapCore all;
  std::vector<CapTriangle> cap;
  for (const std::vector<OutlineSegment>& outline :
       curvesApart(section.nodes.places, section.outline, rest, options.apart)) {
    CapCore core;
    std::vector<CapTriangle> part;
    if (fill(section, outline, options, core, part) != CapState::kFilled) return false;
    const Index before = static_cast<Index>(all.places.size());
    for (CapTriangle& t : part) {
      for (Index& node : t.nodes)
        if (node >= first) node += before;
      cap.push_back(t);
    }
    all.spacing = std::max(all.spacing, core.spacing);
    all.places.insert(all.places.end(), core.places.begin(), core.places.end());
    all.inside.insert(all.inside.end(), core.inside.begin(), core.inside.end());
    for (const Triangle& t : core.triangles) all.triangles.push_back({t[0] + before, t[1] + before, t[2] + before});
    for (const auto& [from, to] : core.border) all.border.emplace_back(from + before, to + before);
    for (const Index of : core.part_of_point) all.part_of_point.push_back(of + all.parts);
    all.parts += core.parts;
  }
  if (cap.empty()) return false;
  section.core = std::move(all);
  section.cap = std::move(cap);
  section.apart = true;
  return true;
}

CapState fill(Section& section, const std::vector<RimEdge>& rim, const CutOptions& options) {
  section.outline = outlineOf(section.nodes, rim);
  const CapState state = fill(section, section.outline, options, section.core, section.cap);
  return state == CapState::kCrossing && fillApart(section, options) ? CapState::kFilled : state;
}

/// Splits the rim where it meets itself and fills it anew. False where rounding does not let it.
bool resolve(const std::vector<RimEdge>& rim, Section& section, const CutOptions& options) {
  if (!splitRim(section.work, rim, section.nodes)) return false;
  const Result<std::vector<RimEdge>> split = rimOf(section.work);
  return split && fill(section, *split, options) == CapState::kFilled;
}

Result<CutSurface> finish(Section section, const Box& box, const CutOptions& options) {
  CutSurface cut;
  cut.cap_area = addCap(section, options);
  Workpiece& work = section.work;
  Result<std::vector<Shell>> shells = shellsOf(work, section.core, section.nodes.mergedVertices(), options.cap_patch);
  if (!shells) return shells.error();
  std::array<bool, 2> any{false, false};
  for (const Shell& shell : *shells) {
    if (shell.flat)
      return Error{ErrorCode::kMissed, "the plane only grazes the surface: a piece would be thinner than " +
                                           number(options.band) + " of its size"};
    any[shell.piece.side > 0] = true;
  }
  if (!any[0] || !any[1]) return Error{ErrorCode::kMissed, "the plane only grazes the surface: a side would be empty"};
  const Status sound = checkVolumes(work, *shells, box);
  if (!sound) return sound.error();
  cut.pieces = piecesOf(work, std::move(*shells));
  if (options.check_pieces) {
    const Status checked = checkPieces(*work.mesh, box, cut.pieces);
    if (!checked) return checked.error();
  }
  return cut;
}

Result<CutSurface> cutOnce(const TriangleMesh& mesh, const std::vector<SnappedVertex>& snapped, const Plane& plane,
                           const Box& box, const CutOptions& options) {
  Result<Workpiece> split = splitAtPlane(mesh, snapped, plane, options.band, box);
  if (!split) return split.error();
  const Result<std::vector<RimEdge>> rim = rimOf(*split);
  if (!rim) return rim.error();
  Section plain{std::move(*split), {}, {}, {}, {}, false};
  plain.nodes = nodesOf(plain.work, *rim);
  const CapState state = fill(plain, *rim, options);
  if (state == CapState::kUnbalanced)
    return Error{ErrorCode::kUnsuitableShape, "the surface is open or not oriented where the plane meets it"};
  const bool filled = state == CapState::kFilled;
  if (filled && (plain.apart || !hasSlivers(plain.nodes.places, plain.core, plain.cap)))
    return finish(std::move(plain), box, options);

  // The rim crosses itself, or lies on itself but for rounding.
  Section resolved{plain.work, plain.nodes, {}, {}, {}, false};
  Result<CutSurface> cut =
      Error{ErrorCode::kUnsuitableShape, "the surface crosses itself where it is cut, and cannot be closed there"};
  if (resolve(*rim, resolved, options)) cut = finish(std::move(resolved), box, options);
  if (!cut && filled) return finish(std::move(plain), box, options);
  return cut;
}

}  // namespace

Result<CutSurface> cutByPlane(const TriangleMesh& mesh, const Plane& plane, const CutOptions& options) {
  Box box;
  const Status checked = checkInput(mesh, plane, options, box);
  if (!checked) return checked.error();
  if (options.snap > 0.0) {
    TriangleMesh moved = mesh;
    const std::vector<SnappedVertex> snapped = snapToPlane(moved, plane, options.snap);
    Result<CutSurface> cut = cutOnce(moved, snapped, plane, box, options);
    if (cut) return cut;
  }
  Result<CutSurface> cut = cutOnce(mesh, {}, plane, box, options);
  // Vertices used where they are, a little off the plane, can make a sound rim cross itself: a narrower band has fewer.
  CutOptions narrower = options;
  for (int retry = 0; retry < 2 && !cut && cut.error().code == ErrorCode::kUnsuitableShape; ++retry) {
    narrower.band *= 1e-2;
    Result<CutSurface> again = cutOnce(mesh, {}, plane, box, narrower);
    if (again) return again;
  }
  return cut;
}

}  // namespace meshless
