// Takes an opened surface apart into connected solids.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "incise_parts.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace incising {
namespace {

/// Solid angle [sr] under which p sees the triangles: 4 pi inside, 0 outside. van Oosterom and Strackee 1983.
double solidAngle(const TriangleMesh& mesh, const std::vector<Index>& triangles, const Vec3& p) {
  double half = 0.0;
  for (const Index i : triangles) {
    const Triangle& t = mesh.triangles[i];
    const Vec3 a = mesh.vertices[t[0]] - p, b = mesh.vertices[t[1]] - p, c = mesh.vertices[t[2]] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    half += std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return 2.0 * half;
}

struct Shell {
  std::vector<Index> triangles;
  double volume = 0.0;  // [m^3] signed
  Index holder = kNoIndex;
};

std::vector<Shell> shellsOf(const TriangleMesh& mesh) {
  std::vector<Index> parents(mesh.vertices.size());
  std::iota(parents.begin(), parents.end(), Index{0});
  const auto rootOf = [&](Index i) {
    while (parents[i] != i) i = parents[i] = parents[parents[i]];
    return i;
  };
  for (const Triangle& t : mesh.triangles) {
    const Index a = rootOf(t[0]);
    for (const Index v : {t[1], t[2]}) {
      const Index b = rootOf(v), root = rootOf(a);
      parents[std::max(root, b)] = std::min(root, b);
    }
  }
  std::vector<Index> shell_of_root(mesh.vertices.size(), kNoIndex);
  std::vector<Shell> shells;
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    Index& shell = shell_of_root[rootOf(mesh.triangles[t][0])];
    if (shell == kNoIndex) {
      shell = static_cast<Index>(shells.size());
      shells.emplace_back();
    }
    shells[shell].triangles.push_back(t);
  }
  return shells;
}

IncisedPiece pieceOf(const OpenedSurface& opened, const std::vector<Index>& triangles) {
  IncisedPiece piece;
  std::vector<Index> local(opened.mesh.vertices.size(), kNoIndex);
  for (const Index t : triangles)
    for (const Index v : opened.mesh.triangles[t]) local[v] = 0;
  const std::size_t count = static_cast<std::size_t>(std::count(local.begin(), local.end(), 0u));
  piece.mesh.vertices.reserve(count);
  piece.origins.reserve(count);
  for (Index v = 0; v < local.size(); ++v) {
    if (local[v] == kNoIndex) continue;
    local[v] = static_cast<Index>(piece.mesh.vertices.size());
    piece.mesh.vertices.push_back(opened.mesh.vertices[v]);
    const Index same = opened.origins.same(v);
    same == kNoIndex ? piece.origins.push_back(opened.origins[v]) : piece.origins.addKept(same, same + 1);
  }
  piece.mesh.triangles.reserve(triangles.size());
  piece.mesh.patches.reserve(triangles.size());
  piece.facing.reserve(triangles.size());
  for (const Index t : triangles) {
    const Triangle& v = opened.mesh.triangles[t];
    piece.mesh.triangles.push_back({local[v[0]], local[v[1]], local[v[2]]});
    piece.mesh.patches.push_back(opened.mesh.patches[t]);
    piece.facing.push_back(opened.facing[t]);
  }
  return piece;
}

}  // namespace

Result<std::vector<IncisedPiece>> separate(const OpenedSurface& opened) {
  std::vector<Shell> shells = shellsOf(opened.mesh);
  if (shells.size() > 1) {
    for (Shell& shell : shells) {
      std::vector<Triangle> triangles;
      for (const Index t : shell.triangles) triangles.push_back(opened.mesh.triangles[t]);
      shell.volume = signedVolume(opened.mesh.vertices, triangles);
    }
    for (Shell& cavity : shells) {
      if (cavity.volume > 0.0) continue;
      const Vec3& inside = opened.mesh.vertices[opened.mesh.triangles[cavity.triangles[0]][0]];
      for (Index s = 0; s < shells.size(); ++s) {
        if (!(shells[s].volume > 0.0)) continue;
        if (cavity.holder != kNoIndex && !(shells[s].volume < shells[cavity.holder].volume)) continue;
        if (solidAngle(opened.mesh, shells[s].triangles, inside) > 2.0 * M_PI) cavity.holder = s;
      }
      if (cavity.holder == kNoIndex)
        return Error{ErrorCode::kUnsuitableShape, "the incision would leave a surface that bounds no solid"};
    }
    for (const Shell& cavity : shells) {
      if (cavity.holder == kNoIndex) continue;
      std::vector<Index>& all = shells[cavity.holder].triangles;
      all.insert(all.end(), cavity.triangles.begin(), cavity.triangles.end());
    }
  }
  std::vector<Index> order;
  for (Index s = 0; s < shells.size(); ++s)
    if (shells[s].holder == kNoIndex) order.push_back(s);
  // A solid's hollows do not count here.
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return shells[a].volume > shells[b].volume; });
  std::vector<IncisedPiece> pieces;
  for (const Index s : order) pieces.push_back(pieceOf(opened, shells[s].triangles));
  return pieces;
}

}  // namespace incising
}  // namespace meshless
