#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <unordered_map>

#include "cut_pieces.h"
#include "meshless_surgery/geometry/measures.h"

namespace meshless {
namespace cutting {
namespace {

constexpr double kSameAngle = 1e-9;  // [rad] faces at an edge that differ by less lie on each other

/// Corners of the triangles near the plane, three a triangle; corner c is also the edge from its vertex to that of
/// nextCorner(c).
using Corner = Index;
Corner nextCorner(Corner c) { return c % 3 == 2 ? c - 2 : c + 1; }
Corner previousCorner(Corner c) { return c % 3 == 0 ? c + 2 : c - 1; }

/// Finds for every edge at the plane, of every triangle there, the edge of the triangle next to it. (All triangles at an
/// edge with an end on the plane have a corner on the plane.)
class Pairing {
 public:
  Pairing(const Workpiece& work, const std::vector<Index>& merged, const SideSurface& surface)
      : work_(work), merged_(merged), surface_(surface), partners(3 * surface.near.size(), kNoIndex) {
    collapsed_.resize(surface.near.size());
    for (Index n = 0; n < collapsed_.size(); ++n) {
      const Index a = vertexOf(3 * n), b = vertexOf(3 * n + 1), c = vertexOf(3 * n + 2);
      collapsed_[n] = a == b || b == c || c == a;
    }
  }

  /// False where the surface is open.
  bool run() {
    struct Edge {
      std::uint64_t ends;
      Corner corner;
    };
    std::vector<Edge> edges;
    edges.reserve(partners.size());
    for (Corner c = 0; c < partners.size(); ++c) {
      if (collapsed(c / 3)) continue;
      const std::uint64_t a = vertexOf(c), b = vertexOf(nextCorner(c));
      if (work_.onPlane(vertexOf(c)) || work_.onPlane(vertexOf(nextCorner(c))))
        edges.push_back({(std::min(a, b) << 32) | std::max(a, b), c});
    }
    std::sort(edges.begin(), edges.end(), [](const Edge& p, const Edge& q) {
      return p.ends != q.ends ? p.ends < q.ends : p.corner < q.corner;
    });
    std::vector<Corner> around;
    for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
      around.clear();
      for (; end < edges.size() && edges[end].ends == edges[begin].ends; ++end) around.push_back(edges[end].corner);
      if (around.size() == 2) {
        if (vertexOf(around[0]) == vertexOf(around[1])) return false;
        join(around[0], around[1]);
      } else if (!pairSideBySide(around)) {
        return false;
      }
    }
    dropFlaps();
    return true;
  }

  /// The vertex itself, and the one that it counts as.
  Index ownVertex(Corner c) const { return surface_.triangles[surface_.near[c / 3]][c % 3]; }
  Index vertexOf(Corner c) const { return merged_[ownVertex(c)]; }

  /// Merging vertices took its area: it drops out, and its neighbours meet. So do two that cancel each other.
  bool collapsed(Index near) const { return collapsed_[near]; }

 private:
  void join(Corner c, Corner d) {
    partners[c] = d;
    partners[d] = c;
  }

  /// More than two triangles at an edge: those that bound one wedge of solid belong together. Around the axis a -> b, a
  /// triangle that runs b -> a has the solid at larger angles and opens a wedge, one that runs a -> b closes it. Wedges
  /// inside wedges (layers of a surface that crosses itself) are matched like parentheses.
  bool pairSideBySide(const std::vector<Corner>& around) {
    if (around.size() % 2 != 0) return false;
    struct Leaf {
      double angle;
      bool opens;
      std::int32_t layer;
      Corner corner;
    };
    const Index a = std::min(vertexOf(around[0]), vertexOf(nextCorner(around[0])));
    const Index b = std::max(vertexOf(around[0]), vertexOf(nextCorner(around[0])));
    const Vec3 axis = (work_.positions[b] - work_.positions[a]).normalized();
    // Edges on the plane measure from the plane, so that caps lie at exactly 0 and 180 degrees.
    const Vec3 up = work_.onPlane(a) && work_.onPlane(b) ? work_.normal : axis.unitOrthogonal();
    const Vec3 along = up.cross(axis).normalized();
    std::vector<Leaf> leaves;
    int sum = 0;
    for (const Corner c : around) {
      const Vec3 arm = work_.positions[vertexOf(previousCorner(c))] - work_.positions[a];
      const std::int32_t layer = surface_.layerOf(surface_.near[c / 3]);
      double angle = std::atan2(layer != 0 ? 0.0 : up.dot(arm), along.dot(arm));
      if (angle < -kSameAngle) angle += 2.0 * M_PI;
      const bool opens = vertexOf(c) == b;
      leaves.push_back({angle, opens, layer, c});
      sum += opens ? 1 : -1;
    }
    if (sum != 0) return false;
    std::sort(leaves.begin(), leaves.end(), [](const Leaf& p, const Leaf& q) { return p.angle < q.angle; });
    for (std::size_t i = 1; i < leaves.size(); ++i)
      if (leaves[i].angle - leaves[i - 1].angle < kSameAngle) leaves[i].angle = leaves[i - 1].angle;
    // Where faces lie on each other the wedge that ends goes first: solids that touch stay two solids. Layers of the
    // cap nest, the outermost first.
    std::sort(leaves.begin(), leaves.end(), [](const Leaf& p, const Leaf& q) {
      if (p.angle != q.angle) return p.angle < q.angle;
      if (p.opens != q.opens) return !p.opens;
      if (p.layer != q.layer) return (p.layer < q.layer) == p.opens;
      return p.corner < q.corner;
    });
    std::size_t start = 0;
    int level = 0, lowest = 0;
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      level += leaves[i].opens ? 1 : -1;
      if (level < lowest) {
        lowest = level;
        start = i + 1;
      }
    }
    std::vector<Corner> open;
    for (std::size_t i = 0; i < leaves.size(); ++i) {
      const Leaf& leaf = leaves[(start + i) % leaves.size()];
      if (leaf.opens) {
        open.push_back(leaf.corner);
      } else {
        join(open.back(), leaf.corner);
        open.pop_back();
      }
    }
    return true;
  }

  /// Two triangles that lie on each other, with nothing but each other at all three edges.
  void dropFlaps() {
    for (Index n = 0; n < collapsed_.size(); ++n) {
      const Corner d = partners[3 * n];
      if (d == kNoIndex || d / 3 == n) continue;
      const Index other = d / 3;
      if (partners[3 * n + 1] / 3 != other || partners[3 * n + 2] / 3 != other) continue;
      for (Corner k = 0; k < 3; ++k) partners[3 * n + k] = partners[3 * other + k] = kNoIndex;
      collapsed_[n] = collapsed_[other] = true;
    }
  }

  const Workpiece& work_;
  const std::vector<Index>& merged_;
  const SideSurface& surface_;
  std::vector<bool> collapsed_;

 public:
  std::vector<Corner> partners;  // kNoIndex for edges off the plane and collapsed triangles
};

/// Union-find over numbers, the lowest of a set its root.
class Sets {
 public:
  explicit Sets(std::size_t count) : parents_(count) { std::iota(parents_.begin(), parents_.end(), Index{0}); }

  Index rootOf(Index i) {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }
  void unite(Index i, Index j) {
    i = rootOf(i);
    j = rootOf(j);
    parents_[std::max(i, j)] = std::min(i, j);
  }

 private:
  std::vector<Index> parents_;
};

/// Corners on the plane, numbered by umbrella.
struct Umbrellas {
  std::vector<Index> of_corner;  // kNoIndex for corners off the plane
  std::vector<Index> vertices;   // of each umbrella: its lowest vertex
};

Umbrellas umbrellasOf(const Workpiece& work, const Pairing& pairing) {
  const std::size_t corners = pairing.partners.size();
  Sets sets(corners);
  for (Corner c = 0; c < corners; ++c) {
    const Corner d = pairing.partners[c];
    if (d == kNoIndex || d < c) continue;
    if (work.onPlane(pairing.vertexOf(c))) sets.unite(c, nextCorner(d));
    if (work.onPlane(pairing.vertexOf(d))) sets.unite(d, nextCorner(c));
  }
  Umbrellas umbrellas;
  umbrellas.of_corner.assign(corners, kNoIndex);
  for (Corner c = 0; c < corners; ++c) {
    if (!work.onPlane(pairing.ownVertex(c)) || pairing.collapsed(c / 3)) continue;
    Index& number = umbrellas.of_corner[sets.rootOf(c)];  // the root is the lowest corner and so comes first
    if (number == kNoIndex) {
      number = static_cast<Index>(umbrellas.vertices.size());
      umbrellas.vertices.push_back(pairing.ownVertex(c));
    }
    umbrellas.of_corner[c] = number;
    umbrellas.vertices[number] = std::min(umbrellas.vertices[number], pairing.ownVertex(c));
  }
  return umbrellas;
}

/// Replaces a triangle with vertices inside of its edges (kNoIndex: none; k is on the edge from corner k) by smaller ones.
void subdivide(const Triangle& t, const std::array<Index, 3>& middles, std::vector<Triangle>& parts) {
  std::vector<Index> outline;
  std::size_t first = 0;
  for (int k = 0; k < 3; ++k) {
    outline.push_back(t[k]);
    if (middles[k] == kNoIndex) continue;
    first = outline.size();
    outline.push_back(middles[k]);
  }
  // A fan from a vertex inside of an edge; with three of them it would leave a flat part, so the corners go first.
  std::rotate(outline.begin(), outline.begin() + static_cast<std::ptrdiff_t>(first), outline.end());
  if (outline.size() == 6) {
    for (const std::size_t k : {1u, 3u, 5u}) parts.push_back({outline[k - 1], outline[k], outline[(k + 1) % 6]});
    parts.push_back({outline[0], outline[2], outline[4]});
    return;
  }
  for (std::size_t k = 1; k + 1 < outline.size(); ++k) parts.push_back({outline[0], outline[k], outline[k + 1]});
}

/// Two pairs of triangles may run between the same two vertices, where a surface touches itself along an edge
/// at the plane and hangs together at both ends. All but the first get a vertex inside of the edge. `shell_of`, `place_of`:
/// for each triangle near the plane its shell (kNoIndex: none) and its number there. False where it cannot be done.
bool splitDoubleEdges(const Pairing& pairing, const std::vector<Index>& shell_of, const std::vector<Index>& place_of,
                      std::vector<Shell>& shells) {
  struct Pair {
    Index shell, low, high;
    Corner corner;
  };
  std::vector<Pair> pairs;
  for (Corner c = 0; c < pairing.partners.size(); ++c) {
    if (pairing.partners[c] == kNoIndex || pairing.partners[c] < c) continue;
    const Triangle& t = shells[shell_of[c / 3]].piece.mesh.triangles[place_of[c / 3]];
    const Index a = t[c % 3], b = t[(c + 1) % 3];
    pairs.push_back({shell_of[c / 3], std::min(a, b), std::max(a, b), c});
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& p, const Pair& q) {
    return std::tie(p.shell, p.low, p.high, p.corner) < std::tie(q.shell, q.low, q.high, q.corner);
  });
  std::unordered_map<Corner, Index> middles;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    const Pair &p = pairs[i], &before = pairs[i - 1];
    if (before.shell != p.shell || before.low != p.low || before.high != p.high) continue;
    CutPiece& piece = shells[p.shell].piece;
    VertexOrigin origin;
    if (!mixOrigins(piece.origins[p.low], piece.origins[p.high], 0.5, origin)) return false;
    middles[p.corner] = middles[pairing.partners[p.corner]] = static_cast<Index>(piece.mesh.vertices.size());
    piece.mesh.vertices.push_back(0.5 * (piece.mesh.vertices[p.low] + piece.mesh.vertices[p.high]));
    piece.origins.push_back(origin);
  }
  if (middles.empty()) return true;
  std::vector<Triangle> parts;
  for (Index n = 0; n < shell_of.size(); ++n) {
    if (shell_of[n] == kNoIndex) continue;
    std::array<Index, 3> inside{kNoIndex, kNoIndex, kNoIndex};
    bool split = false;
    for (Index k = 0; k < 3; ++k) {
      const auto found = middles.find(3 * n + k);
      if (found == middles.end()) continue;
      inside[k] = found->second;
      split = true;
    }
    if (!split) continue;
    TriangleMesh& mesh = shells[shell_of[n]].piece.mesh;
    parts.clear();
    subdivide(mesh.triangles[place_of[n]], inside, parts);
    mesh.triangles[place_of[n]] = parts[0];
    for (std::size_t p = 1; p < parts.size(); ++p) {
      mesh.triangles.push_back(parts[p]);
      mesh.patches.push_back(mesh.patches[place_of[n]]);
    }
  }
  return true;
}

}  // namespace

Result<std::vector<Shell>> shellsOf(const Workpiece& work, const std::vector<Index>& merged, Side side) {
  const SideSurface& surface = work.sides[side];
  Pairing pairing(work, merged, surface);
  if (!pairing.run())
    return Error{ErrorCode::kUnsuitableShape, "the surface is open or not oriented where the plane meets it"};
  const Umbrellas umbrellas = umbrellasOf(work, pairing);

  // Vertices off the plane keep their numbers, umbrellas follow.
  const Index vertices = static_cast<Index>(work.positions.size());
  std::vector<Triangle> corners;  // of every triangle, in those numbers
  corners.reserve(surface.triangles.size());
  Sets sets(vertices + umbrellas.vertices.size());
  std::size_t next_near = 0;
  for (Index t = 0; t < surface.triangles.size(); ++t) {
    Triangle numbers = surface.triangles[t];
    if (next_near < surface.near.size() && surface.near[next_near] == t) {
      for (Index k = 0; k < 3; ++k) {
        const Index umbrella = umbrellas.of_corner[3 * next_near + k];
        if (umbrella != kNoIndex) numbers[k] = vertices + umbrella;
      }
      if (pairing.collapsed(static_cast<Index>(next_near++))) numbers[0] = kNoIndex;
    }
    corners.push_back(numbers);
    if (numbers[0] == kNoIndex) continue;
    sets.unite(numbers[0], numbers[1]);
    sets.unite(numbers[0], numbers[2]);
  }

  // Shells in the order of their first triangles.
  std::vector<Index> shell_of_root(vertices + umbrellas.vertices.size(), kNoIndex), shell_of(corners.size(), kNoIndex);
  std::vector<Index> counts;
  for (Index t = 0; t < corners.size(); ++t) {
    if (corners[t][0] == kNoIndex) continue;
    Index& shell = shell_of_root[sets.rootOf(corners[t][0])];
    if (shell == kNoIndex) {
      shell = static_cast<Index>(counts.size());
      counts.push_back(0);
    }
    shell_of[t] = shell;
    ++counts[shell];
  }
  std::vector<Shell> shells(counts.size());
  for (Index s = 0; s < shells.size(); ++s) {
    shells[s].flat = true;
    shells[s].piece.side = side == kUpper ? 1 : -1;
    shells[s].piece.mesh.triangles.reserve(counts[s]);
    shells[s].piece.mesh.patches.reserve(counts[s]);
    shells[s].piece.mesh.vertices.reserve(counts[s] / 2 + 2);  // Euler, for a ball
    shells[s].piece.origins.reserve(counts[s] / 2 + 2);
  }
  std::vector<double> depths(shells.size(), 0.0);
  std::vector<Index>& local = shell_of_root;  // has served
  local.assign(local.size(), kNoIndex);
  std::vector<Index> near_shell, near_place;
  next_near = 0;
  for (Index t = 0; t < corners.size(); ++t) {
    const bool near = next_near < surface.near.size() && surface.near[next_near] == t;
    next_near += near;
    if (near) {
      near_shell.push_back(shell_of[t]);
      near_place.push_back(shell_of[t] == kNoIndex ? kNoIndex
                                                   : static_cast<Index>(shells[shell_of[t]].piece.mesh.triangles.size()));
    }
    if (shell_of[t] == kNoIndex) continue;
    Shell& shell = shells[shell_of[t]];
    CutPiece& piece = shell.piece;
    Triangle triangle;
    for (int k = 0; k < 3; ++k) {
      const Index number = corners[t][k];
      if (local[number] == kNoIndex) {
        local[number] = static_cast<Index>(piece.mesh.vertices.size());
        const Index vertex = number < vertices ? number : umbrellas.vertices[number - vertices];
        piece.mesh.vertices.push_back(work.positions[vertex]);
        piece.origins.push_back(work.originOf(vertex));
        const double depth = std::abs(work.normal.dot(work.positions[vertex] - work.center));
        if (number < vertices && depth > depths[shell_of[t]]) {
          depths[shell_of[t]] = depth;
          shell.deepest = work.positions[vertex];
          shell.flat = false;
        }
      }
      triangle[k] = local[number];
    }
    piece.mesh.triangles.push_back(triangle);
    piece.mesh.patches.push_back(surface.patches[t]);
  }
  if (!splitDoubleEdges(pairing, near_shell, near_place, shells))
    return Error{ErrorCode::kUnsuitableShape, "the surface crosses itself where it is cut, at more places than the new "
                                              "vertices there can be made from"};
  for (Shell& shell : shells) shell.volume = signedVolume(shell.piece.mesh);
  return shells;
}

}  // namespace cutting
}  // namespace meshless
