// Laws that surfaces and cuts obey, and oracles that compute the same numbers another way. Each law answers with an
// AssertionResult that says where it is broken.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/plane_cut.h"

namespace meshless::laws {

using DirectedEdge = std::pair<Index, Index>;

inline std::vector<DirectedEdge> directedEdges(const TriangleMesh& mesh) {
  std::vector<DirectedEdge> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) edges.emplace_back(t[k], t[(k + 1) % 3]);
  std::sort(edges.begin(), edges.end());
  return edges;
}

/// Every edge has exactly two triangles, one in each direction.
inline testing::AssertionResult isClosedOriented(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) return testing::AssertionFailure() << "no triangles";
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t)
      if (v >= mesh.vertices.size()) return testing::AssertionFailure() << "vertex " << v << " is not there";
  const std::vector<DirectedEdge> edges = directedEdges(mesh);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const auto [a, b] = edges[i];
    if (a == b) return testing::AssertionFailure() << "an edge from " << a << " to itself";
    if (i > 0 && edges[i] == edges[i - 1]) return testing::AssertionFailure() << "edge " << a << " " << b << " twice";
    if (!std::binary_search(edges.begin(), edges.end(), DirectedEdge(b, a)))
      return testing::AssertionFailure() << "edge " << a << " " << b << " is open";
  }
  return testing::AssertionSuccess();
}

inline testing::AssertionResult hasNoDuplicateTriangles(const TriangleMesh& mesh) {
  std::vector<Triangle> sorted = mesh.triangles;
  for (Triangle& t : sorted) std::sort(t.begin(), t.end());
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice == sorted.end()) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "triangle " << (*twice)[0] << " " << (*twice)[1] << " " << (*twice)[2]
                                     << " twice";
}

inline testing::AssertionResult usesEveryVertex(const TriangleMesh& mesh) {
  std::vector<bool> used(mesh.vertices.size(), false);
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) used[v] = true;
  const auto unused = std::find(used.begin(), used.end(), false);
  if (unused == used.end()) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "vertex " << (unused - used.begin()) << " belongs to no triangle";
}

inline double triangleArea(const TriangleMesh& mesh, std::size_t t) {
  const Triangle& c = mesh.triangles[t];
  const Vec3 ab = mesh.vertices[c[1]] - mesh.vertices[c[0]], ac = mesh.vertices[c[2]] - mesh.vertices[c[0]];
  return 0.5 * ab.cross(ac).norm();
}

/// Triangles smaller than `ratio` of the mean area.
inline std::size_t countTiny(const TriangleMesh& mesh, double ratio = 1e-14) {
  const double limit = ratio * surfaceArea(mesh) / static_cast<double>(mesh.triangles.size());
  std::size_t tiny = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) tiny += !(triangleArea(mesh, t) > limit);
  return tiny;
}

/// Every vertex on the piece's own side of the plane, or nearer to it than `band` [m].
inline testing::AssertionResult staysOnItsSide(const CutPiece& piece, const Plane& plane, double band) {
  for (std::size_t v = 0; v < piece.mesh.vertices.size(); ++v) {
    const double height = plane.height(piece.mesh.vertices[v]);
    if (!(piece.side * height >= -band))
      return testing::AssertionFailure() << "vertex " << v << " is at " << height << " on side " << piece.side;
  }
  return testing::AssertionSuccess();
}

/// The weights of each origin add up to 1 and make the vertex out of its parents, to `tolerance` [m]; those inside the
/// cap, and no others, have no parents.
inline testing::AssertionResult comesFromItsParents(const CutPiece& piece, const TriangleMesh& parent,
                                                    double tolerance) {
  std::vector<bool> inside(piece.mesh.vertices.size(), false);
  for (const Index v : piece.cap_interior) {
    if (v >= inside.size() || inside[v])
      return testing::AssertionFailure() << "inside the cap, twice or not there: " << v;
    inside[v] = true;
  }
  if (piece.origins.size() != piece.mesh.vertices.size())
    return testing::AssertionFailure() << piece.origins.size() << " origins for " << piece.mesh.vertices.size();
  for (std::size_t v = 0; v < piece.origins.size(); ++v) {
    const VertexOrigin& origin = piece.origins[v];
    if ((origin.parents[0] == kNoIndex) != inside[v])
      return testing::AssertionFailure() << "vertex " << v << (inside[v] ? " has parents" : " has no parents");
    Vec3 made = Vec3::Zero();
    double sum = 0.0;
    for (std::size_t k = 0; k < 4; ++k) {
      if (origin.parents[k] == kNoIndex) {
        if (origin.weights[k] != 0.0) return testing::AssertionFailure() << "vertex " << v << ": weight of no parent";
        continue;
      }
      if (origin.parents[k] >= parent.vertices.size())
        return testing::AssertionFailure() << "vertex " << v << " has no parent " << origin.parents[k];
      if (!(origin.weights[k] >= 0.0)) return testing::AssertionFailure() << "vertex " << v << ": a negative weight";
      made += origin.weights[k] * parent.vertices[origin.parents[k]];
      sum += origin.weights[k];
    }
    if (inside[v]) continue;
    if (!(std::abs(sum - 1.0) < 1e-12)) return testing::AssertionFailure() << "vertex " << v << ": weights sum " << sum;
    if (!((made - piece.mesh.vertices[v]).norm() <= tolerance))
      return testing::AssertionFailure() << "vertex " << v << " is " << (made - piece.mesh.vertices[v]).norm()
                                         << " m from where its parents put it";
  }
  return testing::AssertionSuccess();
}

/// What a plane makes of a solid, summed triangle by triangle without building anything. Heights within `band` [m] of
/// the plane count as 0.
struct SectionOracle {
  double area = 0.0;          // [m^2] signed, of what is solid on both sides of the plane
  double volume_above = 0.0;  // [m^3] signed
  double volume_below = 0.0;
};

inline SectionOracle sectionOracle(const TriangleMesh& mesh, const Plane& plane, double band) {
  SectionOracle oracle;
  const Vec3 u = plane.normal.unitOrthogonal(), w = plane.normal.cross(u);
  const Vec3 base = mesh.vertices[0] - plane.height(mesh.vertices[0]) * plane.normal;
  const auto heightOf = [&](const Vec3& p) {
    const double h = plane.normal.dot(p - base);
    return std::abs(h) <= band ? 0.0 : h;
  };
  for (const Triangle& t : mesh.triangles) {
    const std::array<Vec3, 3> p{mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
    const std::array<double, 3> h{heightOf(p[0]), heightOf(p[1]), heightOf(p[2])};
    const double shadow = 0.5 * plane.normal.dot((p[1] - p[0]).cross(p[2] - p[0]));  // area seen along the normal
    if (h[0] == 0.0 && h[1] == 0.0 && h[2] == 0.0) {
      if (shadow > 0.0) oracle.area -= shadow;  // a face that looks up: solid below it alone
      continue;
    }
    // Divergence theorem with the field height * normal, which is 0 on the cut face: the integral of the height over
    // the triangle's part on one side. That part is the triangle less similar corners.
    const double all = shadow * (h[0] + h[1] + h[2]) / 3.0;
    double above = 0.0;
    const int positive = (h[0] > 0.0) + (h[1] > 0.0) + (h[2] > 0.0),
              negative = (h[0] < 0.0) + (h[1] < 0.0) + (h[2] < 0.0);
    if (negative == 0) {
      above = all;
    } else if (positive > 0) {
      for (int k = 0; k < 3; ++k) {
        const double a = h[k], b = h[(k + 1) % 3], c = h[(k + 2) % 3];
        if (a > 0.0 && b <= 0.0 && c <= 0.0) above = shadow * a * a * a / ((a - b) * (a - c)) / 3.0;
        if (a < 0.0 && b >= 0.0 && c >= 0.0) above = all - shadow * a * a * a / ((a - b) * (a - c)) / 3.0;
      }
    }
    oracle.volume_above += above;
    oracle.volume_below += all - above;

    // The section just below the plane, by the shoelace formula: 0 counts as above.
    Vec2 enters = Vec2::Zero(), leaves = Vec2::Zero();
    bool crossed = false;
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      if ((h[k] >= 0.0) == (h[next] >= 0.0)) continue;
      crossed = true;
      const Vec3 x = p[k] + h[k] / (h[k] - h[next]) * (p[next] - p[k]) - base;
      (h[k] >= 0.0 ? leaves : enters) = Vec2(u.dot(x), w.dot(x));
    }
    // The upper part of the triangle runs from where its outline goes down to where it comes up again.
    if (crossed) oracle.area += 0.5 * (leaves.x() * enters.y() - leaves.y() * enters.x());
  }
  return oracle;
}

/// Area of the triangles of one patch [m^2].
inline double patchArea(const TriangleMesh& mesh, std::uint32_t patch) {
  double area = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (mesh.patchOf(t) == patch) area += triangleArea(mesh, t);
  return area;
}

/// All that a cut promises. `strict`: the mesh is embedded, so that a refusal of its shape is a fault, and every
/// section counts once. `worn`: it has been cut before and may have needles, whose parts are next to nothing, may be
/// refused, and may lose parts of a cap to faces that lie on it but for rounding.
inline testing::AssertionResult cutObeysLaws(const TriangleMesh& mesh, const Plane& plane, const CutOptions& options,
                                             const Result<CutSurface>& result, bool strict = true, bool worn = false) {
  const Box box = boundsOf(mesh.vertices);
  const double farthest = std::max(box.min.cwiseAbs().maxCoeff(), box.max.cwiseAbs().maxCoeff());
  const double rounding = 1e-15 * farthest;  // [m] to which coordinates are known
  const double size = box.diagonal(), band = std::max(options.band * size, 1e-14 * farthest);
  bool above = false, below = false, grazed = false;
  for (const Vec3& p : mesh.vertices) {
    const double height = plane.height(p);
    above |= height > 1.01 * band;
    below |= height < -1.01 * band;
    grazed |= std::abs(height) <= 1.01 * band;
  }
  if (!result) {
    const bool missed = result.error().code == ErrorCode::kMissed;
    if (missed && !(above && below)) return testing::AssertionSuccess();
    if ((!strict && !missed) || worn) return testing::AssertionSuccess();  // the caller counts them
    return testing::AssertionFailure() << "refused: " << result.error().detail;
  }
  const CutSurface& cut = *result;
  std::size_t tiny = 0, tiny_before = 0;
  double sum = 0.0, magnitude = 0.0, largest = 0.0;
  std::array<double, 2> volumes{0.0, 0.0}, areas{0.0, 0.0};
  std::array<int, 2> counts{0, 0};
  const bool fresh_patch = std::find(mesh.patches.begin(), mesh.patches.end(), options.cap_patch) == mesh.patches.end();
  for (std::size_t i = 0; i < cut.pieces.size(); ++i) {
    const CutPiece& piece = cut.pieces[i];
    const auto where = [&] {
      return testing::AssertionFailure() << "piece " << i << " of " << cut.pieces.size() << ", side " << piece.side
                                         << ", " << piece.mesh.triangles.size() << " triangles: ";
    };
    if (piece.side != 1 && piece.side != -1) return where() << "no side";
    if (piece.mesh.patches.size() != piece.mesh.triangles.size()) return where() << "patches missing";
    for (const auto& law :
         {isClosedOriented(piece.mesh), hasNoDuplicateTriangles(piece.mesh), usesEveryVertex(piece.mesh),
          staysOnItsSide(piece, plane, 1.01 * band + options.roughness + rounding),
          comesFromItsParents(piece, mesh, 1e-13 * size + rounding)})
      if (!law) return where() << law.message();
    const double volume = signedVolume(piece.mesh);
    // A crumb of a worn mesh can be as thin as rounding.
    const double flat =
        worn ? 1e-16 * std::pow(boundsOf(piece.mesh.vertices).diagonal(), 3) + rounding * size * size : 0.0;
    if (strict && !(volume > -flat) && !(worn && volume == 0.0)) return where() << "volume " << volume;
    if (i == 0) largest = volume;
    // Halves are as large as each other but for rounding.
    if (!(volume <= largest * (1.0 + 1e-12))) return where() << "larger than the first";
    tiny += countTiny(piece.mesh);
    sum += volume;
    magnitude += std::abs(volume);
    const int side = piece.side > 0 ? 0 : 1;
    volumes[side] += volume;
    areas[side] += patchArea(piece.mesh, options.cap_patch);
    ++counts[side];
  }
  if (counts[0] == 0 || counts[1] == 0) return testing::AssertionFailure() << "a side without a piece";
  const double whole = signedVolume(mesh);
  if (!(std::abs(sum - whole) <= (strict && !worn ? 1e-12 : 1e-9) * magnitude + rounding * size * size))
    return testing::AssertionFailure() << "volumes add up to " << sum << " instead of " << whole;
  // What came in as next to nothing may be cut in two, and then is less.
  tiny_before = countTiny(mesh, 1e-12);
  if (strict && !worn && tiny > 2 * tiny_before)
    return testing::AssertionFailure() << tiny << " triangles without area, before " << tiny_before;
  const SectionOracle oracle = sectionOracle(mesh, plane, band);
  const double volume_tolerance = options.roughness * cut.cap_area + (grazed ? 4.0 * band * size * size : 0.0) +
                                  1e-12 * size * size * size + 10.0 * rounding * size * size;
  if (!(std::abs(volumes[0] - oracle.volume_above) <= volume_tolerance))
    return testing::AssertionFailure() << "volume above " << volumes[0] << " instead of " << oracle.volume_above;
  if (!(std::abs(volumes[1] - oracle.volume_below) <= volume_tolerance))
    return testing::AssertionFailure() << "volume below " << volumes[1] << " instead of " << oracle.volume_below;
  const double area_tolerance = 1e-9 * cut.cap_area + 1e-11 * size * size + 10.0 * rounding * size;
  if (fresh_patch && options.roughness == 0.0 && !worn) {
    for (const double area : areas)
      if (!(std::abs(area - cut.cap_area) <= area_tolerance))
        return testing::AssertionFailure() << "cap of " << area << " on one side, " << cut.cap_area << " reported";
  }
  if (strict && !worn && !(std::abs(oracle.area - cut.cap_area) <= area_tolerance + (grazed ? band * size : 0.0)))
    return testing::AssertionFailure() << "cap of " << cut.cap_area << ", section of " << oracle.area;
  return testing::AssertionSuccess();
}

}  // namespace meshless::laws
