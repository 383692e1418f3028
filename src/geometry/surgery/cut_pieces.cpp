#include "cut_pieces.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace cutting {
namespace {

/// Solid angle [sr] under which p sees the surface: 4 pi inside, 0 outside. van Oosterom and Strackee 1983.
double solidAngle(const TriangleMesh& mesh, const Vec3& p) {
  double half = 0.0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 a = mesh.vertices[t[0]] - p, b = mesh.vertices[t[1]] - p, c = mesh.vertices[t[2]] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    half += std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return 2.0 * half;
}

/// The vertex farthest from the plane: on the plane a cavity may touch the solid that holds it.
Vec3 deepestOf(const Workpiece& work, const CutPiece& piece) {
  Vec3 deepest = piece.mesh.vertices.front();
  double depth = -1.0;
  for (const Vec3& p : piece.mesh.vertices) {
    const double here = std::abs(work.normal.dot(p - work.center));
    if (here > depth) {
      depth = here;
      deepest = p;
    }
  }
  return deepest;
}

void append(const CutPiece& from, CutPiece& to) {
  const Index offset = static_cast<Index>(to.mesh.vertices.size());
  to.mesh.vertices.insert(to.mesh.vertices.end(), from.mesh.vertices.begin(), from.mesh.vertices.end());
  to.origins.append(from.origins);
  to.mesh.patches.insert(to.mesh.patches.end(), from.mesh.patches.begin(), from.mesh.patches.end());
  for (const Index v : from.cap_interior) to.cap_interior.push_back(v + offset);
  for (const Triangle& t : from.mesh.triangles)
    to.mesh.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
}

}  // namespace

std::vector<CutPiece> piecesOf(const Workpiece& work, std::vector<Shell> shells) {
  std::vector<Box> boxes;
  if (std::any_of(shells.begin(), shells.end(), [](const Shell& shell) { return shell.volume < 0.0; }))
    for (const Shell& shell : shells) boxes.push_back(boundsOf(shell.piece.mesh.vertices));
  std::vector<Index> holders(shells.size(), kNoIndex);
  for (Index cavity = 0; cavity < shells.size(); ++cavity) {
    if (!(shells[cavity].volume < 0.0)) continue;
    const Vec3 inside = deepestOf(work, shells[cavity].piece);
    Index& holder = holders[cavity];
    for (Index s = 0; s < shells.size(); ++s) {
      const Shell& solid = shells[s];
      if (!(solid.volume > 0.0) || solid.piece.side != shells[cavity].piece.side || !boxes[s].contains(inside))
        continue;
      if (holder != kNoIndex && !(solid.volume < shells[holder].volume)) continue;
      if (solidAngle(solid.piece.mesh, inside) > 2.0 * M_PI) holder = s;
    }
  }
  for (Index s = 0; s < shells.size(); ++s) {
    if (holders[s] == kNoIndex) continue;
    append(shells[s].piece, shells[holders[s]].piece);
    shells[holders[s]].volume += shells[s].volume;
  }
  std::vector<Index> order;
  for (Index s = 0; s < shells.size(); ++s)
    if (holders[s] == kNoIndex) order.push_back(s);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return shells[a].volume > shells[b].volume; });
  std::vector<CutPiece> pieces;
  for (const Index s : order) pieces.push_back(std::move(shells[s].piece));
  return pieces;
}

}  // namespace cutting
}  // namespace meshless
