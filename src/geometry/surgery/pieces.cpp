// Takes an opened surface apart into connected solids.
#include <algorithm>
#include <cmath>

#include "meshless_surgery/geometry/query/union_find.h"
#include "surgery_parts.h"

namespace meshless {
namespace surgery {
namespace {

struct Shell {
  double volume = 0.0;  // [m^3] signed
  Vec3 origin = Vec3::Zero();
  Vec3 deepest = Vec3::Zero();  // the vertex farthest from the plane: on it a cavity may touch the solid that holds it
  double depth = -1.0;
  bool above = false;
  std::size_t vertices = 0, triangles = 0;
  Index holder = kNoIndex;
};

/// Solid angle [sr] under which p sees the triangles of a shell: 4 pi inside, 0 outside. van Oosterom and Strackee
/// 1983.
double solidAngle(const TriangleMesh& mesh, const std::vector<Index>& shell_of, Index shell, const Vec3& p) {
  double half = 0.0;
  for (const Triangle& t : mesh.triangles) {
    if (shell_of[t[0]] != shell) continue;
    const Vec3 a = mesh.vertices[t[0]] - p, b = mesh.vertices[t[1]] - p, c = mesh.vertices[t[2]] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    half += std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return 2.0 * half;
}

/// The shell of each vertex; kNoIndex for one without a triangle.
std::vector<Index> shellsOf(const TriangleMesh& mesh, std::vector<Shell>& shells) {
  UnionFind sets(mesh.vertices.size());
  for (const Triangle& t : mesh.triangles) sets.join(t);
  const std::vector<Index>& roots = sets.flatten();
  std::vector<Index> shell_of(mesh.vertices.size(), kNoIndex);
  for (const Triangle& t : mesh.triangles) {
    Index& shell = shell_of[roots[t[0]]];
    if (shell == kNoIndex) {
      shell = static_cast<Index>(shells.size());
      shells.emplace_back();
      shells.back().origin = mesh.vertices[t[0]];
    }
    Shell& s = shells[shell];
    s.volume +=
        (mesh.vertices[t[0]] - s.origin).dot((mesh.vertices[t[1]] - s.origin).cross(mesh.vertices[t[2]] - s.origin)) /
        6.0;
    ++s.triangles;
  }
  // A root is the lowest of its set: it has its shell before the others ask. (One that no triangle uses is alone.)
  for (Index v = 0; v < shell_of.size(); ++v) {
    shell_of[v] = shell_of[roots[v]];
    if (shell_of[v] != kNoIndex) ++shells[shell_of[v]].vertices;
  }
  return shell_of;
}

/// A hollow belongs to the solid around it. What else has no volume is of the largest solid, on its side of a plane.
void findHolders(const OpenedSurface& opened, const Frame& frame, const std::vector<Index>& shell_of, double least,
                 std::vector<Shell>& shells) {
  const auto isSolid = [&](const Shell& s) { return s.volume > least; };
  if (std::all_of(shells.begin(), shells.end(), isSolid)) return;
  for (Index v = 0; v < shell_of.size(); ++v) {
    if (shell_of[v] == kNoIndex) continue;
    Shell& shell = shells[shell_of[v]];
    const double depth = std::abs(frame.height(opened.mesh.vertices[v]));
    if (!(depth > shell.depth)) continue;
    shell.depth = depth;
    shell.deepest = opened.mesh.vertices[v];
    shell.above = frame.height(shell.deepest) > 0.0;
  }
  for (Shell& cavity : shells) {
    if (isSolid(cavity)) continue;
    Index largest = kNoIndex;
    for (Index s = 0; s < shells.size(); ++s) {
      if (!isSolid(shells[s]) || (!frame.bounded && shells[s].above != cavity.above)) continue;
      if (largest == kNoIndex || shells[s].volume > shells[largest].volume) largest = s;
      if (cavity.holder != kNoIndex && !(shells[s].volume < shells[cavity.holder].volume)) continue;
      if (solidAngle(opened.mesh, shell_of, s, cavity.deepest) > 2.0 * M_PI) cavity.holder = s;
    }
    if (cavity.holder == kNoIndex) cavity.holder = largest;
  }
}

}  // namespace

std::vector<IncisedPiece> separate(const OpenedSurface& opened, const Frame& frame, std::array<double, 2>& volumes) {
  std::vector<Shell> shells;
  const std::vector<Index> shell_of = shellsOf(opened.mesh, shells);
  volumes = {0.0, 0.0};
  for (const Shell& shell : shells) {
    volumes[0] += shell.volume;
    volumes[1] += std::abs(shell.volume);
  }
  findHolders(opened, frame, shell_of, kSheet * volumes[1], shells);
  std::vector<double> whole;  // with hollows
  for (const Shell& shell : shells) whole.push_back(shell.volume);
  std::vector<Index> order;
  for (Index s = 0; s < shells.size(); ++s) {
    const Index holder = shells[s].holder;
    if (holder == kNoIndex) {
      order.push_back(s);
      continue;
    }
    whole[holder] += shells[s].volume;
    shells[holder].vertices += shells[s].vertices;
    shells[holder].triangles += shells[s].triangles;
  }
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return whole[a] > whole[b]; });
  std::vector<Index> piece_of(shells.size());
  std::vector<IncisedPiece> pieces(order.size());
  for (Index p = 0; p < order.size(); ++p) {
    const Shell& shell = shells[order[p]];
    piece_of[order[p]] = p;
    pieces[p].mesh.vertices.reserve(shell.vertices);
    pieces[p].origins.reserve(shell.vertices);
    pieces[p].mesh.triangles.reserve(shell.triangles);
    pieces[p].mesh.patches.reserve(shell.triangles);
    pieces[p].facing.reserve(shell.triangles);
  }
  for (Index s = 0; s < shells.size(); ++s)
    if (shells[s].holder != kNoIndex) piece_of[s] = piece_of[shells[s].holder];
  std::vector<Index> local(shell_of.size(), kNoIndex);
  for (Index v = 0; v < shell_of.size(); ++v) {
    if (shell_of[v] == kNoIndex) continue;
    IncisedPiece& piece = pieces[piece_of[shell_of[v]]];
    local[v] = static_cast<Index>(piece.mesh.vertices.size());
    piece.mesh.vertices.push_back(opened.mesh.vertices[v]);
    const Index same = opened.origins.same(v);
    same == kNoIndex ? piece.origins.push_back(opened.origins[v]) : piece.origins.addKept(same, same + 1);
  }
  for (std::size_t t = 0; t < opened.mesh.triangles.size(); ++t) {
    const Triangle& v = opened.mesh.triangles[t];
    IncisedPiece& piece = pieces[piece_of[shell_of[v[0]]]];
    piece.mesh.triangles.push_back({local[v[0]], local[v[1]], local[v[2]]});
    piece.mesh.patches.push_back(opened.mesh.patches[t]);
    piece.facing.push_back(opened.facing[t]);
  }
  return pieces;
}

}  // namespace surgery
}  // namespace meshless
