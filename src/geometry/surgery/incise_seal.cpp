// Joins the split surface and the wound faces into one closed surface again, opened along the wound rim.
#include <algorithm>
#include <numeric>
#include <unordered_map>

#include "incise_parts.h"
#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {
namespace incising {
namespace {

/// Corners of the triangles at the rim, three a triangle. Corner c also stands for the edge from its vertex to that of
/// nextCorner(c).
using Corner = Index;
Corner nextCorner(Corner c) { return c % 3 == 2 ? c - 2 : c + 1; }

Error branches(Index a, Index b) {
  return Error{ErrorCode::kUnsuitableShape,
               "the surface is open, not oriented or branches at the edge between vertices " + std::to_string(a) +
                   " and " + std::to_string(b)};
}

class Sealer {
 public:
  Sealer(const SplitSurface& surface, const WoundFaces& wound, std::uint32_t patch)
      : surface_(surface), wound_(wound), patch_(patch) {}

  Result<OpenedSurface> run() {
    gather();
    const Status joined = joinMesh();
    if (!joined) return joined.error();
    // Two rim edges between the same vertices, or one that is no edge of the mesh: it is finer than rounding there.
    for (const WoundTriangle& face : wound_.triangles)
      for (const Index r : face.rim)
        if (r != kNoIndex && at_rim_.count(r) == 0) return branches(surface_.rim[r].from, surface_.rim[r].to);
    joinWoundFaces();
    for (Corner c = 0; c < partners_.size(); ++c) {
      const Corner d = partners_[c];
      if (d == kNoIndex || d < c) continue;
      corners_.join(c, nextCorner(d));
      corners_.join(nextCorner(c), d);
    }
    build();
    const Status split = splitDoubleEdges();
    if (!split) return split.error();
    const Status sound = check();
    if (!sound) return sound.error();
    return std::move(out_);
  }

 private:
  /// Triangles of the mesh with a corner on the rim, then those of the lower wound face, then those of the upper one.
  void gather() {
    on_rim_.assign(surface_.positions.size(), false);
    for (const WoundTriangle& face : wound_.triangles)
      for (const Index r : face.rim) {
        if (r == kNoIndex) continue;
        const RimEdge& e = surface_.rim[r];
        on_rim_[e.from] = on_rim_[e.to] = true;
        rim_of_edge_.emplace(edgeKey(e.from, e.to), r);
      }
    for (Index t = 0; t < surface_.triangles.size(); ++t) {
      const Triangle& v = surface_.triangles[t];
      if (on_rim_[v[0]] || on_rim_[v[1]] || on_rim_[v[2]]) near_.push_back(t);
    }
    const std::size_t corners = 3 * (near_.size() + 2 * wound_.triangles.size());
    partners_.assign(corners, kNoIndex);
    corners_.reset(corners);
  }

  Index vertexOf(Corner c) const { return surface_.triangles[near_[c / 3]][c % 3]; }
  Corner lower(Index face, int edge) const { return static_cast<Corner>(3 * (near_.size() + face)) + edge; }
  /// The upper wound face runs the other way round: its corners are nodes 0, 2, 1.
  Corner upper(Index face, int edge) const {
    return static_cast<Corner>(3 * (near_.size() + wound_.triangles.size() + face)) + (2 - edge);
  }
  Index faceOf(Corner c) const { return static_cast<Index>((c / 3 - near_.size()) % wound_.triangles.size()); }
  bool isWoundFace(Corner c) const { return c / 3 >= near_.size(); }
  bool isUpper(Corner c) const { return c / 3 >= near_.size() + wound_.triangles.size(); }
  Index nodeOf(Corner c) const {
    const std::array<Index, 3>& n = wound_.triangles[faceOf(c)].nodes;
    return isUpper(c) ? n[(3 - c % 3) % 3] : n[c % 3];
  }

  void join(Corner c, Corner d) {
    partners_[c] = d;
    partners_[d] = c;
  }

  Status joinMesh() {
    struct Edge {
      std::uint64_t ends;
      Corner corner;
    };
    std::vector<Edge> edges;
    for (Corner c = 0; c < 3 * near_.size(); ++c) {
      const Index a = vertexOf(c), b = vertexOf(nextCorner(c));
      if (on_rim_[a] || on_rim_[b]) edges.push_back({edgeKey(a, b), c});
    }
    std::sort(edges.begin(), edges.end(),
              [](const Edge& p, const Edge& q) { return p.ends != q.ends ? p.ends < q.ends : p.corner < q.corner; });
    for (std::size_t i = 0; i < edges.size(); i += 2) {
      const Corner c = edges[i].corner;
      const Index a = vertexOf(c), b = vertexOf(nextCorner(c));
      if (i + 1 == edges.size() || edges[i + 1].ends != edges[i].ends ||
          (i + 2 < edges.size() && edges[i + 2].ends == edges[i].ends))
        return branches(a, b);
      const Corner d = edges[i + 1].corner;
      if (vertexOf(d) != b) return branches(a, b);
      const auto rim = rim_of_edge_.find(edges[i].ends);
      if (rim == rim_of_edge_.end()) {
        join(c, d);
      } else {
        // The triangle above runs as the rim does.
        const RimEdge& e = surface_.rim[rim->second];
        at_rim_[rim->second] = vertexOf(c) == e.from ? std::array<Corner, 2>{c, d} : std::array<Corner, 2>{d, c};
      }
    }
    return Done{};
  }

  void joinWoundFaces() {
    for (Index f = 0; f < wound_.triangles.size(); ++f) {
      const WoundTriangle& face = wound_.triangles[f];
      for (int k = 0; k < 3; ++k) {
        if (face.rim[k] != kNoIndex) {
          joinAtRim(f, k);
        } else if (face.neighbors[k] == kNoIndex) {
          join(lower(f, k), upper(f, k));
        } else if (face.neighbors[k] > f) {
          const Index other = face.neighbors[k];
          int edge = 0;
          while (wound_.triangles[other].nodes[edge] != face.nodes[(k + 1) % 3]) ++edge;
          join(lower(f, k), lower(other, edge));
          join(upper(f, k), upper(other, edge));
        }
      }
    }
  }

  void joinAtRim(Index f, int k) {
    const WoundTriangle& face = wound_.triangles[f];
    auto [along, back] = at_rim_.at(face.rim[k]);
    if (face.against[k]) std::swap(along, back);
    const RimEdge::Kind kind = surface_.rim[face.rim[k]].kind;
    const auto [entry, fresh] = touched_.try_emplace(face.rim[k], std::array<Index, 2>{f, static_cast<Index>(k)});
    join(upper(f, k), along);
    join(lower(f, k), back);
    if (kind == RimEdge::kCrossed || fresh) return;
    // The wound faces pass below or above the touching edge. On that side they go on; on the other, each half has its
    // own.
    const auto [other, edge] = entry->second;
    if (kind == RimEdge::kTouchedAbove) {
      join(upper(other, static_cast<int>(edge)), back);
      join(lower(f, k), lower(other, static_cast<int>(edge)));
    } else {
      join(lower(other, static_cast<int>(edge)), along);
      join(upper(f, k), upper(other, static_cast<int>(edge)));
    }
  }

  Index addVertex(const Vec3& position, const VertexOrigin& origin) {
    out_.mesh.vertices.push_back(position);
    out_.origins.push_back(origin);
    return static_cast<Index>(out_.mesh.vertices.size() - 1);
  }

  /// The first umbrella of a vertex keeps it, the others get one of their own.
  void build() {
    out_.mesh.vertices = surface_.positions;
    out_.mesh.triangles = surface_.triangles;
    out_.mesh.patches = surface_.patches;
    out_.origins.reserve(surface_.positions.size() + 2 * wound_.nodes.size());
    out_.origins.addKept(0, surface_.mesh_vertices);
    for (Index v = surface_.mesh_vertices; v < surface_.positions.size(); ++v)
      out_.origins.push_back(surface_.originOf(v));
    out_.first_new_triangle = surface_.triangles.size();
    out_.facing.assign(surface_.triangles.size(), 0);
    for (const Index t : near_) slots_.push_back(t);
    for (std::size_t l = 0; l < 2 * wound_.triangles.size(); ++l) {
      slots_.push_back(static_cast<Index>(out_.mesh.triangles.size()));
      out_.mesh.triangles.push_back({kNoIndex, kNoIndex, kNoIndex});
      out_.mesh.patches.push_back(patch_);
      out_.facing.push_back(l < wound_.triangles.size() ? 1 : -1);
    }
    // Where vertices at the same place come together, the lowest stands for them.
    std::vector<Index> lowest(partners_.size(), kNoIndex);
    for (Corner c = 0; c < 3 * near_.size(); ++c)
      if (on_rim_[vertexOf(c)]) lowest[corners_.find(c)] = std::min(lowest[corners_.find(c)], vertexOf(c));
    std::vector<Index> of_root(partners_.size(), kNoIndex);
    std::vector<bool> kept(surface_.positions.size(), false);
    for (Corner c = 0; c < partners_.size(); ++c) {
      const bool in_wound = isWoundFace(c);
      if (!in_wound && !on_rim_[vertexOf(c)]) continue;
      Index& number = of_root[corners_.find(c)];  // the root is the lowest corner and so comes first
      if (number == kNoIndex) {
        const Index v = in_wound ? wound_.nodes[nodeOf(c)].vertex : lowest[corners_.find(c)];
        if (v == kNoIndex) {
          number = addVertex(surface_.frame.lifted(wound_.nodes[nodeOf(c)].place), VertexOrigin());
        } else if (in_wound || kept[v]) {
          number = addVertex(surface_.positions[v], surface_.originOf(v));
        } else {
          kept[v] = true;
          number = v;
        }
      }
      out_.mesh.triangles[slots_[c / 3]][c % 3] = number;
    }
  }

  Index finalVertex(Corner c) const { return out_.mesh.triangles[slots_[c / 3]][c % 3]; }

  /// Where two pairs of triangles have an edge between the same two vertices, each pair gets a vertex of its own in its
  /// middle. Both wound faces have such edges between two points of the front.
  Status splitDoubleEdges() {
    struct Pair {
      std::uint64_t ends;
      Corner corner;
    };
    std::vector<Pair> pairs;
    for (Corner c = 0; c < partners_.size(); ++c)
      if (partners_[c] != kNoIndex && c < partners_[c])
        pairs.push_back({edgeKey(finalVertex(c), finalVertex(nextCorner(c))), c});
    std::sort(pairs.begin(), pairs.end(),
              [](const Pair& p, const Pair& q) { return p.ends != q.ends ? p.ends < q.ends : p.corner < q.corner; });
    std::vector<Index> middles(partners_.size(), kNoIndex);
    std::vector<bool> split(partners_.size() / 3, false);
    bool any = false;
    for (std::size_t begin = 0, end = 0; begin < pairs.size(); begin = end) {
      for (; end < pairs.size() && pairs[end].ends == pairs[begin].ends;) ++end;
      if (end - begin < 2) continue;
      any = true;
      for (std::size_t i = begin; i < end; ++i) {
        const Corner c = pairs[i].corner, d = partners_[c];
        const Index a = finalVertex(c), b = finalVertex(nextCorner(c));
        const bool inside = isWoundFace(c) && isWoundFace(d);
        VertexOrigin origin;
        if (!inside && !mixOrigins(out_.origins[a], out_.origins[b], 0.5, origin))
          return Error{ErrorCode::kUnsuitableShape,
                       "the surface crosses itself where the blade meets it, at more places "
                       "than new vertices can be made from"};
        const Index middle = addVertex(0.5 * (out_.mesh.vertices[a] + out_.mesh.vertices[b]), origin);
        middles[c] = middles[d] = middle;
        split[c / 3] = split[d / 3] = true;
      }
    }
    if (!any) return Done{};
    std::vector<Triangle> parts;
    const std::size_t count = slots_.size();
    for (std::size_t n = 0; n < count; ++n) {
      if (!split[n]) continue;
      const Index slot = slots_[n];
      parts.clear();
      subdivide(out_.mesh.triangles[slot], {middles[3 * n], middles[3 * n + 1], middles[3 * n + 2]}, parts);
      out_.mesh.triangles[slot] = parts[0];
      for (std::size_t p = 1; p < parts.size(); ++p) {
        slots_.push_back(static_cast<Index>(out_.mesh.triangles.size()));
        out_.mesh.triangles.push_back(parts[p]);
        out_.mesh.patches.push_back(out_.mesh.patches[slot]);
        out_.facing.push_back(out_.facing[slot]);
      }
    }
    return Done{};
  }

  /// Replaces a triangle with vertices inside of its edges (kNoIndex: none; k is on the edge from corner k) by smaller
  /// ones, the same for wound faces that lie on each other.
  void subdivide(const Triangle& t, const std::array<Index, 3>& middles, std::vector<Triangle>& parts) const {
    const int count = (middles[0] != kNoIndex) + (middles[1] != kNoIndex) + (middles[2] != kNoIndex);
    if (count == 3) {
      for (int k = 0; k < 3; ++k) parts.push_back({middles[(k + 2) % 3], t[k], middles[k]});
      parts.push_back({middles[0], middles[1], middles[2]});
      return;
    }
    if (count == 1) {
      int k = 0;
      while (middles[k] == kNoIndex) ++k;
      parts.push_back({t[k], middles[k], t[(k + 2) % 3]});
      parts.push_back({middles[k], t[(k + 1) % 3], t[(k + 2) % 3]});
      return;
    }
    int k = 0;  // the corner between the two
    while (middles[k] == kNoIndex || middles[(k + 2) % 3] == kNoIndex) ++k;
    const Index after = middles[k], next = t[(k + 1) % 3], previous = t[(k + 2) % 3], before = middles[(k + 2) % 3];
    parts.push_back({before, t[k], after});
    const Points& p = out_.mesh.vertices;
    const double diagonal_a = (p[previous] - p[after]).squaredNorm(), diagonal_b = (p[next] - p[before]).squaredNorm();
    if (diagonal_a < diagonal_b || (diagonal_a == diagonal_b && comesFirst(p[after], p[before]))) {
      parts.push_back({after, next, previous});
      parts.push_back({after, previous, before});
    } else {
      parts.push_back({after, next, before});
      parts.push_back({next, previous, before});
    }
  }

  /// Every edge with an end on the wound rim or on the wound faces has exactly two triangles.
  Status check() const {
    std::vector<bool> touched(out_.mesh.vertices.size(), false);
    for (std::size_t v = surface_.positions.size(); v < touched.size(); ++v) touched[v] = true;
    for (std::size_t v = 0; v < surface_.positions.size(); ++v) touched[v] = on_rim_[v];
    std::vector<std::uint64_t> edges;
    for (const Index slot : slots_) {
      const Triangle& t = out_.mesh.triangles[slot];
      if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0])
        return Error{ErrorCode::kUnsuitableShape, "the incision would leave a triangle without area"};
      for (int k = 0; k < 3; ++k) {
        const Index a = t[k], b = t[(k + 1) % 3];
        if (touched[a] || touched[b]) edges.push_back(edgeKey(a, b) << 1 | (a < b));
      }
    }
    // Vertex numbers stay far below 2^31: the shift loses nothing.
    std::sort(edges.begin(), edges.end());
    for (std::size_t i = 0; i < edges.size(); i += 2)
      if (i + 1 == edges.size() || edges[i + 1] != edges[i] + 1 || edges[i] % 2 != 0 ||
          (i + 2 < edges.size() && edges[i + 2] >> 1 == edges[i] >> 1))
        return branches(static_cast<Index>(edges[i] >> 33), static_cast<Index>(edges[i] >> 1));
    return Done{};
  }

  const SplitSurface& surface_;
  const WoundFaces& wound_;
  const std::uint32_t patch_;
  std::vector<bool> on_rim_;  // vertices that are to be doubled, or are an end
  std::unordered_map<std::uint64_t, Index> rim_of_edge_;
  std::unordered_map<Index, std::array<Corner, 2>> at_rim_;  // the edges of the triangles above and below
  std::unordered_map<Index, std::array<Index, 2>> touched_;  // the face and edge that came first to a rim edge
  std::vector<Index> near_;                                  // triangles
  std::vector<Corner> partners_;
  UnionFind corners_;
  std::vector<Index> slots_;  // triangles of the result: near ones, lower face, upper face, then parts of those
  OpenedSurface out_;
};

}  // namespace

Result<OpenedSurface> seal(const SplitSurface& surface, const WoundFaces& wound, std::uint32_t patch) {
  return Sealer(surface, wound, patch).run();
}

}  // namespace incising
}  // namespace meshless
