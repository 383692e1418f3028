#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "cut_pieces.h"
#include "mesh/edge_table.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/refine.h"

namespace meshless {
namespace cutting {
namespace {

constexpr double kSameAngle = 1e-9;  // [rad] faces at an edge that differ by less lie on each other

/// Corners of the triangles near the plane, three a triangle; corner c is also the edge from its vertex to that of
/// nextCorner(c).
using Corner = Index;
Corner nextCorner(Corner c) { return c % 3 == 2 ? c - 2 : c + 1; }
Corner previousCorner(Corner c) { return c % 3 == 0 ? c + 2 : c - 1; }

/// Finds for every edge at the plane, of every triangle there, the edge of the triangle next to it. (All triangles at
/// an edge with an end on the plane have a corner on the plane.)
class Pairing {
 public:
  Pairing(const Workpiece& work, const std::vector<Index>& merged, const SideSurface& surface)
      : work_(work), surface_(surface), partners(3 * surface.triangles.size(), kNoIndex) {
    vertices_.resize(partners.size());
    for (Corner c = 0; c < vertices_.size(); ++c) {
      const Index own = ownVertex(c);
      vertices_[c] = work.onRim(own) ? merged[own - work.mesh_vertices] : own;
    }
    collapsed_.resize(surface.triangles.size());
    for (Index n = 0; n < collapsed_.size(); ++n) {
      const Index a = vertexOf(3 * n), b = vertexOf(3 * n + 1), c = vertexOf(3 * n + 2);
      collapsed_[n] = a == b || b == c || c == a;
    }
  }

  /// False where the surface is open.
  bool run() {
    if (pairOneToOne()) {
      dropFlaps();
      return true;
    }
    partners.assign(partners.size(), kNoIndex);
    // Chains of corners at the same edge, ascending.
    EdgeTable<Corner> first(partners.size(), kNoIndex);
    std::vector<Corner> next(partners.size(), kNoIndex);
    std::vector<Corner*> head(partners.size(), nullptr);
    for (Corner c = static_cast<Corner>(partners.size()); c-- > 0;) {
      if (collapsed(c / 3)) continue;
      const Index a = vertexOf(c), b = vertexOf(nextCorner(c));
      if (!(work_.onRim(a) | work_.onRim(b))) continue;
      head[c] = &first.at(a, b);
      next[c] = *head[c];
      *head[c] = c;
    }
    std::vector<Corner> around;
    for (Corner c = 0; c < partners.size(); ++c) {
      if (head[c] == nullptr || *head[c] != c) continue;
      around.clear();
      for (Corner k = c; k != kNoIndex; k = next[k]) around.push_back(k);
      if (around.size() == 2) {
        if (vertexOf(around[0]) == vertexOf(around[1])) return false;
        join(around[0], around[1]);
      } else {
        crowded_ = true;
        if (!pairSideBySide(around)) return false;
      }
    }
    dropFlaps();
    return true;
  }

  /// The vertex itself, and the one that it counts as.
  Index ownVertex(Corner c) const { return surface_.triangles[c / 3][c % 3]; }
  Index vertexOf(Corner c) const { return vertices_[c]; }

  /// Merging vertices took its area: it drops out, and its neighbours meet. So do two that cancel each other.
  bool collapsed(Index near) const { return collapsed_[near]; }

  /// Some edge has more than two triangles.
  bool crowded() const { return crowded_; }

 private:
  /// As nearly always: every edge has two triangles that run it in opposite directions. False where one has not.
  bool pairOneToOne() {
    EdgeTable<Corner> first(partners.size(), kNoIndex);
    std::size_t open = 0;
    for (Index n = 0; n < collapsed_.size(); ++n) {
      if (collapsed(n)) continue;
      const std::array<Index, 3> v{vertexOf(3 * n), vertexOf(3 * n + 1), vertexOf(3 * n + 2)};
      for (Corner k = 0; k < 3; ++k) {
        const Index a = v[k], b = v[k == 2 ? 0 : k + 1];
        if (!(work_.onRim(a) | work_.onRim(b))) continue;
        Corner& other = first.at(a, b);
        if (other == kNoIndex) {
          other = 3 * n + k;
          ++open;
          continue;
        }
        if (partners[other] != kNoIndex || vertexOf(other) == a) return false;
        join(other, 3 * n + k);
        --open;
      }
    }
    return open == 0;
  }

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
    const Vec3 axis = (work_.position(b) - work_.position(a)).normalized();
    // Edges on the plane measure from the plane, so that caps lie at exactly 0 and 180 degrees.
    const Vec3 up = work_.onRim(a) && work_.onRim(b) ? work_.normal : axis.unitOrthogonal();
    const Vec3 along = up.cross(axis).normalized();
    std::vector<Leaf> leaves;
    int sum = 0;
    for (const Corner c : around) {
      const Vec3 arm = work_.position(vertexOf(previousCorner(c))) - work_.position(a);
      const std::int32_t layer = surface_.layerOf(c / 3);
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
  const SideSurface& surface_;
  std::vector<Index> vertices_;  // as they count, one a corner
  std::vector<char> collapsed_;
  bool crowded_ = false;

 public:
  std::vector<Corner> partners;  // kNoIndex for edges off the plane and collapsed triangles
};

/// Six times the volume [m^3] between a triangle and z = level, positive below one that faces up. Over a closed surface
/// it sums up to the same as a . (b x c), for half the work.
double sixVolumesBelow(const Vec3& a, const Vec3& b, const Vec3& c, double level) {
  const double twice_area = (b.x() - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (b.y() - a.y());
  return twice_area * ((a.z() - level) + (b.z() - level) + (c.z() - level));
}

/// Corners on the plane, numbered by umbrella.
struct Umbrellas {
  std::vector<Index> of_corner;  // kNoIndex for corners off the plane
  std::vector<Index> vertices;   // of each umbrella: its lowest vertex
};

Umbrellas umbrellasOf(const Workpiece& work, const Pairing& pairing) {
  const std::size_t corners = pairing.partners.size();
  UnionFind sets(corners);
  for (Corner c = 0; c < corners; ++c) {
    const Corner d = pairing.partners[c];
    if (d == kNoIndex || d < c) continue;
    if (work.onRim(pairing.vertexOf(c))) sets.join(c, nextCorner(d));
    if (work.onRim(pairing.vertexOf(d))) sets.join(d, nextCorner(c));
  }
  Umbrellas umbrellas;
  umbrellas.of_corner.assign(corners, kNoIndex);
  for (Corner c = 0; c < corners; ++c) {
    if (!work.onRim(pairing.ownVertex(c)) || pairing.collapsed(c / 3)) continue;
    Index& number = umbrellas.of_corner[sets.find(c)];  // the root is the lowest corner and so comes first
    if (number == kNoIndex) {
      number = static_cast<Index>(umbrellas.vertices.size());
      umbrellas.vertices.push_back(pairing.ownVertex(c));
    }
    umbrellas.of_corner[c] = number;
    umbrellas.vertices[number] = std::min(umbrellas.vertices[number], pairing.ownVertex(c));
  }
  return umbrellas;
}

/// Two pairs of triangles may run between the same two vertices, where a surface touches itself along an edge
/// at the plane and hangs together at both ends. All but the first get a vertex inside of the edge. `shell_of`,
/// `place_of`: for each triangle near the plane its shell (kNoIndex: none) and its number there. False where it cannot
/// be done.
bool splitDoubleEdges(const Pairing& pairing, const std::vector<Index>& shell_of, const std::vector<Index>& place_of,
                      std::vector<Shell>& shells, bool& changed) {
  if (!pairing.crowded()) return true;
  // Edges in shells: a shell's vertices count from where the last shell's end.
  std::vector<Index> first_vertex(shells.size() + 1, 0);
  for (std::size_t s = 0; s < shells.size(); ++s)
    first_vertex[s + 1] = first_vertex[s] + static_cast<Index>(shells[s].piece.mesh.vertices.size());
  EdgeTable<Index> seen(pairing.partners.size(), kNoIndex);
  std::unordered_map<Corner, Index> middles;
  for (Corner c = 0; c < pairing.partners.size(); ++c) {
    if (pairing.partners[c] == kNoIndex || pairing.partners[c] < c) continue;
    const Index shell = shell_of[c / 3];
    CutPiece& piece = shells[shell].piece;
    const Triangle& t = piece.mesh.triangles[place_of[c / 3]];
    const Index low = std::min(t[c % 3], t[(c + 1) % 3]), high = std::max(t[c % 3], t[(c + 1) % 3]);
    Index& count = seen.at(first_vertex[shell] + low, first_vertex[shell] + high);
    if (count == kNoIndex) {
      count = 1;
      continue;
    }
    VertexOrigin origin;
    if (!mixOrigins(piece.origins[low], piece.origins[high], 0.5, origin)) return false;
    middles[c] = middles[pairing.partners[c]] = static_cast<Index>(piece.mesh.vertices.size());
    piece.mesh.vertices.push_back(0.5 * (piece.mesh.vertices[low] + piece.mesh.vertices[high]));
    piece.origins.push_back(origin);
  }
  if (middles.empty()) return true;
  changed = true;
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

/// What hangs together: untouched parts, then the umbrellas and the core parts of each side.
class Pieces {
 public:
  Pieces(Workpiece& work, const CapCore& core, const std::array<Pairing, 2>& pairings, std::uint32_t cap_patch)
      : work_(work), core_(core), pairings_(pairings), cap_patch_(cap_patch) {
    for (int side = 0; side < 2; ++side) umbrellas_[side] = umbrellasOf(work, pairings[side]);
  }

  Result<std::vector<Shell>> run() {
    addPartsOfTouchedAlone();
    numberElements();
    unite();
    makeShells();
    addVertices();
    addUntouched();
    for (int side = 0; side < 2; ++side) {
      addTouched(side);
      addCore(side);
    }
    bool changed = false;
    for (int side = 0; side < 2; ++side)
      if (!splitDoubleEdges(pairings_[side], near_shell_[side], near_place_[side], shells_, changed))
        return Error{ErrorCode::kUnsuitableShape,
                     "the surface crosses itself where it is cut, at more places than the new vertices there can be "
                     "made from"};
    for (std::size_t s = 0; s < shells_.size(); ++s)
      shells_[s].volume = changed ? signedVolume(shells_[s].piece.mesh) : six_volumes_[s] / 6.0;
    return std::move(shells_);
  }

 private:
  /// Vertices off the plane whose triangles all have a corner on it.
  void addPartsOfTouchedAlone() {
    Untouched& parts = work_.untouched;
    for (int side = 0; side < 2; ++side) {
      const std::vector<Triangle>& triangles = work_.sides[side].triangles;
      for (Index t = 0; t < triangles.size(); ++t) {
        if (pairings_[side].collapsed(t)) continue;
        for (const Index v : triangles[t]) {
          if (v >= work_.mesh_vertices || parts.part_of_vertex[v] != kNoIndex) continue;
          parts.part_of_vertex[v] = static_cast<Index>(parts.sides.size());
          parts.sides.push_back(static_cast<Side>(side));
          parts.triangles.push_back(0);
        }
      }
    }
  }

  void numberElements() {
    elements_ = work_.untouched.sides.size();
    for (int side = 0; side < 2; ++side) {
      first_umbrella_[side] = static_cast<Index>(elements_);
      elements_ += umbrellas_[side].vertices.size();
      first_core_[side] = static_cast<Index>(elements_);
      elements_ += core_.parts;
    }
  }

  Index elementOf(int side, Index vertex, Corner corner) const {
    if (vertex < work_.mesh_vertices) return work_.untouched.part_of_vertex[vertex];
    if (vertex >= work_.first_inner) return first_core_[side] + core_.part_of_point[vertex - work_.first_inner];
    return first_umbrella_[side] + umbrellas_[side].of_corner[corner];
  }

  void unite() {
    UnionFind sets(elements_);
    near_counts_.assign(elements_, 0);
    for (int side = 0; side < 2; ++side) {
      const std::vector<Triangle>& triangles = work_.sides[side].triangles;
      for (Index t = 0; t < triangles.size(); ++t) {
        if (pairings_[side].collapsed(t)) continue;
        Triangle numbers;
        for (Index k = 0; k < 3; ++k) numbers[k] = elementOf(side, triangles[t][k], 3 * t + k);
        sets.join(numbers);
        ++near_counts_[numbers[0]];
      }
      for (const Triangle& t : core_.triangles) ++near_counts_[first_core_[side] + core_.part_of_point[t[0]]];
    }
    shell_of_.assign(elements_, kNoIndex);
    shell_count_ = 0;
    for (Index e = 0; e < elements_; ++e) {
      const Index root = sets.find(e);
      if (root == e) shell_of_[e] = shell_count_++;
      shell_of_[e] = shell_of_[root];
    }
  }

  void makeShells() {
    const Untouched& parts = work_.untouched;
    shells_.resize(shell_count_);
    std::vector<std::size_t> counts(shell_count_, 0);
    untouched_.assign(shell_count_, 0);
    for (Shell& shell : shells_) shell.flat = true;
    for (Index e = 0; e < elements_; ++e) {
      Shell& shell = shells_[shell_of_[e]];
      counts[shell_of_[e]] += near_counts_[e];
      if (e < parts.sides.size()) {
        shell.flat = false;
        untouched_[shell_of_[e]] += parts.triangles[e];
        shell.piece.side = parts.sides[e] == kUpper ? 1 : -1;
      } else {
        shell.piece.side = e < first_umbrella_[kLower] ? 1 : -1;
      }
    }
    for (std::size_t s = 0; s < shells_.size(); ++s) {
      CutPiece& piece = shells_[s].piece;
      const std::size_t triangles = counts[s] + untouched_[s];
      piece.mesh.triangles.reserve(triangles);
      piece.mesh.patches.reserve(triangles);
      piece.mesh.vertices.reserve(triangles / 2 + 2);  // Euler, for a ball
      piece.origins.reserve(triangles / 2 + 2);
      shells_[s].untouched = untouched_[s];
    }
    six_volumes_.assign(shell_count_, 0.0);
    levels_.assign(shell_count_, 0.0);
    // A shell a side: which one follows from the side of a vertex.
    simple_ = shell_count_ == 2 && shells_[0].piece.side != shells_[1].piece.side;
  }

  Index shellOfMeshVertex(Index v) const {
    if (simple_) return (work_.states[v] > 0) == (shells_[0].piece.side > 0) ? 0 : 1;
    return shell_of_[work_.untouched.part_of_vertex[v]];
  }

  Index addVertex(Index shell, Index vertex, const VertexOrigin& origin) {
    CutPiece& piece = shells_[shell].piece;
    piece.mesh.vertices.push_back(work_.position(vertex));
    piece.origins.push_back(origin);
    return static_cast<Index>(piece.mesh.vertices.size() - 1);
  }

  void addVertices() {
    local_.resize(work_.mesh_vertices);
    const std::vector<Index>& part_of_vertex = work_.untouched.part_of_vertex;
    const Points& points = work_.mesh->vertices;
    for (Index v = 0; v < work_.mesh_vertices;) {
      const Index part = part_of_vertex[v];
      Index end = v + 1;
      while (end < work_.mesh_vertices && part_of_vertex[end] == part) ++end;
      if (part != kNoIndex) {
        CutPiece& piece = shells_[shell_of_[part]].piece;
        const Index first = static_cast<Index>(piece.mesh.vertices.size());
        piece.mesh.vertices.insert(piece.mesh.vertices.end(), points.begin() + v, points.begin() + end);
        piece.origins.addKept(v, end);
        for (Index k = 0; k < end - v; ++k) local_[v + k] = first + k;
      }
      v = end;
    }
    for (int side = 0; side < 2; ++side) {
      for (Index u = 0; u < umbrellas_[side].vertices.size(); ++u) {
        const Index vertex = umbrellas_[side].vertices[u];
        local_umbrella_[side].push_back(
            addVertex(shell_of_[first_umbrella_[side] + u], vertex, work_.originOf(vertex)));
      }
      for (Index point = 0; point < core_.part_of_point.size(); ++point) {
        const Index shell = shell_of_[first_core_[side] + core_.part_of_point[point]];
        const Index vertex = work_.first_inner + point;
        local_inner_[side].push_back(addVertex(shell, vertex, work_.originOf(vertex)));
        shells_[shell].piece.cap_interior.push_back(local_inner_[side].back());
      }
    }
  }

  void addTriangle(Index shell, const Triangle& local, std::uint32_t patch, const Vec3& a, const Vec3& b,
                   const Vec3& c) {
    TriangleMesh& mesh = shells_[shell].piece.mesh;
    if (mesh.triangles.empty()) levels_[shell] = a.z();
    six_volumes_[shell] += sixVolumesBelow(a, b, c, levels_[shell]);
    mesh.triangles.push_back(local);
    mesh.patches.push_back(patch);
  }

  void addUntouched() {
    const TriangleMesh& mesh = *work_.mesh;
    std::size_t next_touched = 0;
    for (std::size_t begin = 0; begin < mesh.triangles.size();) {
      const std::size_t end =
          next_touched < work_.touched.size() ? work_.touched[next_touched++] : mesh.triangles.size();
      for (std::size_t t = begin; t < end;) {
        const Index shell = shellOfMeshVertex(mesh.triangles[t][0]);
        std::size_t stop = t + 1;
        while (stop < end && shellOfMeshVertex(mesh.triangles[stop][0]) == shell) ++stop;
        addUntouched(shell, t, stop);
        t = stop;
      }
      begin = end + 1;
    }
  }

  /// A run of triangles of one shell.
  void addUntouched(Index shell, std::size_t begin, std::size_t end) {
    const std::vector<Triangle>& triangles = work_.mesh->triangles;
    const Points& p = work_.mesh->vertices;
    TriangleMesh& mesh = shells_[shell].piece.mesh;
    if (mesh.triangles.empty()) levels_[shell] = p[triangles[begin][0]].z();
    const double level = levels_[shell];
    const std::size_t first = mesh.triangles.size();
    mesh.triangles.insert(mesh.triangles.end(), triangles.begin() + static_cast<std::ptrdiff_t>(begin),
                          triangles.begin() + static_cast<std::ptrdiff_t>(end));
    // Two sums: neither waits for the other.
    std::array<double, 2> sums{six_volumes_[shell], 0.0};
    for (std::size_t t = first; t < mesh.triangles.size(); ++t) {
      Triangle& corners = mesh.triangles[t];
      sums[t & 1] += sixVolumesBelow(p[corners[0]], p[corners[1]], p[corners[2]], level);
      corners = {local_[corners[0]], local_[corners[1]], local_[corners[2]]};
    }
    six_volumes_[shell] = sums[0] + sums[1];
    const std::vector<std::uint32_t>& patches = work_.mesh->patches;
    if (patches.empty()) {
      mesh.patches.resize(mesh.triangles.size(), kOuterPatch);
    } else {
      mesh.patches.insert(mesh.patches.end(), patches.begin() + static_cast<std::ptrdiff_t>(begin),
                          patches.begin() + static_cast<std::ptrdiff_t>(end));
    }
  }

  void addTouched(int side) {
    const SideSurface& surface = work_.sides[side];
    near_shell_[side].assign(surface.triangles.size(), kNoIndex);
    near_place_[side].assign(surface.triangles.size(), kNoIndex);
    for (Index t = 0; t < surface.triangles.size(); ++t) {
      if (pairings_[side].collapsed(t)) continue;
      const Triangle& corners = surface.triangles[t];
      const Index shell = shell_of_[elementOf(side, corners[0], 3 * t)];
      near_shell_[side][t] = shell;
      near_place_[side][t] = static_cast<Index>(shells_[shell].piece.mesh.triangles.size());
      Triangle local;
      for (Index k = 0; k < 3; ++k) {
        const Index v = corners[k];
        local[k] = v < work_.mesh_vertices  ? local_[v]
                   : v >= work_.first_inner ? local_inner_[side][v - work_.first_inner]
                                            : local_umbrella_[side][umbrellas_[side].of_corner[3 * t + k]];
      }
      const Points& p = shells_[shell].piece.mesh.vertices;
      addTriangle(shell, local, surface.patches[t], p[local[0]], p[local[1]], p[local[2]]);
    }
  }

  void addCore(int side) {
    for (const Triangle& t : core_.triangles) {
      const Index shell = shell_of_[first_core_[side] + core_.part_of_point[t[0]]];
      const std::vector<Index>& local = local_inner_[side];
      Triangle triangle = {local[t[0]], local[t[1]], local[t[2]]};
      if (side == kUpper) std::swap(triangle[1], triangle[2]);
      const Points& p = shells_[shell].piece.mesh.vertices;
      addTriangle(shell, triangle, cap_patch_, p[triangle[0]], p[triangle[1]], p[triangle[2]]);
    }
  }

  Workpiece& work_;
  const CapCore& core_;
  const std::array<Pairing, 2>& pairings_;
  std::uint32_t cap_patch_;
  std::array<Umbrellas, 2> umbrellas_;
  std::size_t elements_ = 0;
  std::array<Index, 2> first_umbrella_{}, first_core_{};
  std::vector<Index> near_counts_, shell_of_;
  Index shell_count_ = 0;
  bool simple_ = false;
  std::vector<std::size_t> untouched_;
  std::vector<Shell> shells_;
  std::vector<double> six_volumes_, levels_;  // [m^3], above z = [m]
  std::vector<Index> local_;                  // numbers in the pieces
  std::array<std::vector<Index>, 2> local_umbrella_, local_inner_, near_shell_, near_place_;
};

}  // namespace

Result<std::vector<Shell>> shellsOf(Workpiece& work, const CapCore& core, const std::vector<Index>& merged,
                                    std::uint32_t cap_patch) {
  std::array<Pairing, 2> pairings{{{work, merged, work.sides[kUpper]}, {work, merged, work.sides[kLower]}}};
  for (Pairing& pairing : pairings)
    if (!pairing.run())
      return Error{ErrorCode::kUnsuitableShape, "the surface is open or not oriented where the plane meets it"};
  return Pieces(work, core, pairings, cap_patch).run();
}

}  // namespace cutting
}  // namespace meshless
