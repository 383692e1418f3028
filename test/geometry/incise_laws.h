// What every incision promises, and blades to try it with.
#pragma once

#include <set>

#include "meshless_surgery/geometry/surgery/incise.h"
#include "support/mesh_laws.h"
#include "support/random.h"
#include "support/shapes.h"

namespace meshless::laws {

inline int eulerCharacteristic(const TriangleMesh& mesh) {
  return static_cast<int>(mesh.vertices.size()) - static_cast<int>(mesh.triangles.size()) / 2;
}

/// Area of the part of the solid's section that lies in the rectangle [m^2], by integrating winding numbers. For
/// surfaces without faces in the blade's plane.
inline double openedAreaOracle(const TriangleMesh& mesh, const Blade& blade) {
  const Plane plane = blade.plane();
  double area = 0.0;
  for (const Triangle& t : mesh.triangles) {
    Vec2 enters = Vec2::Zero(), leaves = Vec2::Zero();
    bool crossed = false;
    for (int k = 0; k < 3; ++k) {
      const Vec3 &p = mesh.vertices[t[k]], &q = mesh.vertices[t[(k + 1) % 3]];
      const double hp = plane.height(p), hq = plane.height(q);
      if ((hp >= 0.0) == (hq >= 0.0)) continue;
      crossed = true;
      const Vec3 x = p + hp / (hp - hq) * (q - p) - blade.origin;
      (hp >= 0.0 ? leaves : enters) = Vec2(blade.x_axis.dot(x), blade.y_axis.dot(x));
    }
    if (!crossed) continue;
    // The solid is to the left of leaves -> enters: it counts for what is to the left along -x, up to the rectangle's
    // side.
    Vec2 a = leaves, b = enters;
    const double sign = b.y() > a.y() ? 1.0 : -1.0;
    if (sign < 0.0) std::swap(a, b);
    if (a.y() == b.y()) continue;
    const auto xAt = [&](double y) { return a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x()); };
    std::vector<double> stops = {std::max(a.y(), -blade.depth), std::min(b.y(), 0.0)};
    if (!(stops[0] < stops[1])) continue;
    for (const double x : {0.0, blade.length}) {
      if (a.x() == b.x()) continue;
      const double y = a.y() + (x - a.x()) / (b.x() - a.x()) * (b.y() - a.y());
      if (y > stops[0] && y < stops[1]) stops.push_back(y);
    }
    std::sort(stops.begin(), stops.end());
    for (std::size_t i = 0; i + 1 < stops.size(); ++i) {
      const double reach = std::min(std::max(xAt(0.5 * (stops[i] + stops[i + 1])), 0.0), blade.length);
      area += sign * reach * (stops[i + 1] - stops[i]);
    }
  }
  return area;
}

/// All that an incision promises. `embedded`: the surface does not touch itself and has no faces in the blade's plane,
/// so that the opened area can be counted another way.
inline testing::AssertionResult incisionObeysLaws(const TriangleMesh& mesh, const Blade& blade,
                                                  const InciseOptions& options, const Incision& incision,
                                                  bool embedded) {
  const Box box = boundsOf(mesh.vertices);
  const double size = box.diagonal(), band = 1.01 * options.band * size;
  const Plane plane = blade.plane();
  if (incision.pieces.empty()) return testing::AssertionFailure() << "no pieces";
  if (!(incision.opened_area > 0.0)) return testing::AssertionFailure() << "opened " << incision.opened_area;
  double sum = 0.0;
  std::array<double, 2> wound_areas{0.0, 0.0};
  std::size_t tiny = 0;
  std::vector<int> seen(mesh.vertices.size(), 0);
  for (std::size_t i = 0; i < incision.pieces.size(); ++i) {
    const IncisedPiece& piece = incision.pieces[i];
    const auto where = [&] {
      return testing::AssertionFailure() << "piece " << i << " of " << incision.pieces.size() << ", "
                                         << piece.mesh.triangles.size() << " triangles: ";
    };
    if (piece.mesh.patches.size() != piece.mesh.triangles.size()) return where() << "patches missing";
    if (piece.facing.size() != piece.mesh.triangles.size()) return where() << "facing missing";
    if (piece.origins.size() != piece.mesh.vertices.size()) return where() << "origins missing";
    for (const auto& law :
         {isClosedOriented(piece.mesh), hasNoDuplicateTriangles(piece.mesh), usesEveryVertex(piece.mesh)})
      if (!law) return where() << law.message();
    const double volume = signedVolume(piece.mesh);
    if (!(volume > 0.0)) return where() << "volume " << volume;
    sum += volume;
    tiny += countTiny(piece.mesh);
    std::vector<bool> on_wound_face(piece.mesh.vertices.size(), false);
    for (std::size_t t = 0; t < piece.mesh.triangles.size(); ++t) {
      if (piece.facing[t] == 0) continue;
      const Triangle& v = piece.mesh.triangles[t];
      if (piece.mesh.patches[t] != options.patch)
        return where() << "triangle " << t << " of the wound faces has another patch";
      for (const Index k : v) on_wound_face[k] = true;
      const Vec3 normal = (piece.mesh.vertices[v[1]] - piece.mesh.vertices[v[0]])
                              .cross(piece.mesh.vertices[v[2]] - piece.mesh.vertices[v[0]]);
      wound_areas[piece.facing[t] > 0] += 0.5 * normal.norm();
      if (!(piece.facing[t] * normal.dot(plane.normal) > 0.0) && normal.norm() > band * size)
        return where() << "triangle " << t << " faces the other way";
    }
    for (Index v = 0; v < piece.mesh.vertices.size(); ++v) {
      const Vec3& p = piece.mesh.vertices[v];
      const VertexOrigin& origin = piece.origins[v];
      if (on_wound_face[v]) {
        const Vec3 r = p - blade.origin;
        const double x = blade.x_axis.dot(r), y = blade.y_axis.dot(r);
        if (!(std::abs(plane.height(p)) <= 5.0 * band && x >= -band && x <= blade.length + band &&
              y >= -blade.depth - band && y <= band))
          return where() << "vertex " << v << " of the wound faces is not within the blade: " << x << ", " << y << ", "
                         << plane.height(p);
      }
      if (origin.parents[0] == kNoIndex) {
        if (!on_wound_face[v]) return where() << "vertex " << v << " has no parents";
        continue;
      }
      Vec3 made = Vec3::Zero();
      double weights = 0.0;
      for (int k = 0; k < 4 && origin.parents[k] != kNoIndex; ++k) {
        if (!(origin.weights[k] >= 0.0)) return where() << "vertex " << v << ": a negative weight";
        made += origin.weights[k] * mesh.vertices[origin.parents[k]];
        weights += origin.weights[k];
      }
      if (!(std::abs(weights - 1.0) < 1e-12)) return where() << "vertex " << v << ": weights sum " << weights;
      if (!((made - p).norm() <= 1e-13 * size)) return where() << "vertex " << v << " is not where its parents put it";
      if (origin.weights[0] == 1.0) {
        if (p != mesh.vertices[origin.parents[0]]) return where() << "vertex " << v << " has moved";
        ++seen[origin.parents[0]];
      }
    }
  }
  for (Index v = 0; v < seen.size(); ++v) {
    const bool in_plane = std::abs(plane.height(mesh.vertices[v])) <= 5.0 * band;
    bool there = seen[v] > 0;
    // Where wound faces met at a point, another vertex at the same place may stand for it now.
    for (Index w = 0; in_plane && !there && w < seen.size(); ++w)
      there = seen[w] > 0 && (mesh.vertices[w] - mesh.vertices[v]).norm() <= band;
    if (!there || (seen[v] > 1 && !in_plane))
      return testing::AssertionFailure() << "vertex " << v << " is there " << seen[v] << " times";
  }
  const double whole = signedVolume(mesh);
  if (!(std::abs(sum - whole) <= 1e-11 * whole))
    return testing::AssertionFailure() << "volumes add up to " << sum << " instead of " << whole;
  if (tiny > countTiny(mesh, 1e-12)) return testing::AssertionFailure() << tiny << " triangles without area";
  const auto [smaller, larger] = std::minmax(wound_areas[0], wound_areas[1]);
  if (!(std::abs(smaller - incision.opened_area) <= 1e-12 * incision.opened_area + 1e-9 * band * size))
    return testing::AssertionFailure() << "a wound face of " << smaller << ", " << incision.opened_area << " reported";
  // Where a sheet without thickness lay between an earlier wound face and a new one, nothing is left of it.
  if (!(larger - smaller <= (embedded ? 1e-12 : 1e-3) * larger))
    return testing::AssertionFailure() << "wound faces of " << smaller << " and " << larger;
  if (embedded) {
    const double expected = openedAreaOracle(mesh, blade);
    if (!(std::abs(expected - incision.opened_area) <= 1e-9 * expected + 4.0 * band * size))
      return testing::AssertionFailure() << "opened " << incision.opened_area << " instead of " << expected;
  }
  return testing::AssertionSuccess();
}

inline int shellCount(const TriangleMesh& mesh) {
  std::vector<Index> parents(mesh.vertices.size());
  for (Index v = 0; v < parents.size(); ++v) parents[v] = v;
  const auto rootOf = [&](Index v) {
    while (parents[v] != v) v = parents[v] = parents[parents[v]];
    return v;
  };
  for (const Triangle& t : mesh.triangles)
    for (int k = 1; k < 3; ++k) parents[rootOf(t[k])] = rootOf(t[0]);
  int count = 0;
  for (Index v = 0; v < parents.size(); ++v) count += rootOf(v) == v;
  return count;
}

}  // namespace meshless::laws

namespace meshless::shapes {

/// A blade that points along `down` with its upper edge's middle at `middle`.
inline Blade bladeAt(const Vec3& middle, const Vec3& down, const Vec3& along, double length, double depth) {
  Blade blade;
  blade.y_axis = -down.normalized();
  blade.x_axis = (along - along.dot(blade.y_axis) * blade.y_axis).normalized();
  blade.origin = middle - 0.5 * length * blade.x_axis;
  blade.length = length;
  blade.depth = depth;
  return blade;
}

/// A blade from outside into the surface somewhere.
inline Blade anyBlade(const TriangleMesh& mesh, test::Random& random) {
  const double size = boundsOf(mesh.vertices).diagonal();
  const Triangle& t =
      mesh.triangles[static_cast<std::size_t>(random.integer(0, static_cast<int>(mesh.triangles.size()) - 1))];
  const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
  const double u = random.uniform(0.0, 0.5), w = random.uniform(0.0, 0.5);
  const Vec3 p = a + u * (b - a) + w * (c - a), outward = (b - a).cross(c - a).normalized();
  const Vec3 down = -outward + 0.6 * random.unit();
  const double above = random.uniform(0.0, 0.1) * size;
  return bladeAt(p - above * down.normalized(), down, random.unit(), random.uniform(0.05, 0.9) * size,
                 above + random.uniform(0.02, 0.6) * size);
}

/// Opens an incision as a load would, by a smooth field that moves each wound face by up to `gap` [m]. It fades out
/// away from the blade, and is nothing at its ends and its front.
inline void spread(IncisedPiece& piece, const Blade& blade, double gap) {
  const Plane plane = blade.plane();
  TriangleMesh& mesh = piece.mesh;
  const double size = boundsOf(mesh.vertices).diagonal(), reach = 8.0 * gap;
  std::vector<double> sides(mesh.vertices.size(), 0.0);
  for (std::size_t v = 0; v < sides.size(); ++v) {
    const double height = plane.height(mesh.vertices[v]);
    if (std::abs(height) > 1e-6 * size) sides[v] = height > 0.0 ? 1.0 : -1.0;
  }
  // In the plane: the side that the triangles there are on, or the wound face's; both is none.
  std::vector<int> marks(mesh.vertices.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    double sum = -2.0 * piece.facing[t];
    for (const Index v : mesh.triangles[t]) sum += sides[v];
    for (const Index v : mesh.triangles[t])
      if (sides[v] == 0.0 && sum != 0.0) marks[v] |= sum > 0.0 ? 1 : 2;
  }
  for (std::size_t v = 0; v < sides.size(); ++v) {
    Vec3& p = mesh.vertices[v];
    const double side = sides[v] != 0.0 ? sides[v] : marks[v] == 1 ? 1.0 : marks[v] == 2 ? -1.0 : 0.0;
    const double x = blade.x_axis.dot(p - blade.origin) / blade.length,
                 y = blade.y_axis.dot(p - blade.origin) / blade.depth;
    const double height = plane.height(p);
    if (x <= 0.0 || x >= 1.0 || y <= -1.0 || std::abs(height) >= reach) continue;
    const double fade = 1.0 - std::abs(height) / reach;
    p += side * gap * 4.0 * x * (1.0 - x) * std::min(1.0 + y, 1.0) * fade * fade * plane.normal;
  }
}

}  // namespace meshless::shapes
