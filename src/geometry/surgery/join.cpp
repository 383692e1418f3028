// Joins the split surface and the wound faces into one closed surface again, opened along the wound rim.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "mesh/edge_table.h"
#include "meshless_surgery/geometry/query/union_find.h"
#include "surgery_parts.h"

namespace meshless {
namespace surgery {
namespace {

constexpr double kSameAngle = 1e-9;  // [rad] faces at an edge that differ by less lie on each other

/// Corners of the triangles at the rim, three a triangle. Corner c also stands for the edge from its vertex to that of
/// nextCorner(c).
using Corner = Index;
constexpr Corner kTaken = Corner{1} << 31;
Corner nextCorner(Corner c) { return c % 3 == 2 ? c - 2 : c + 1; }
Corner previousCorner(Corner c) { return c % 3 == 0 ? c + 2 : c - 1; }

Error branches() {
  return Error{ErrorCode::kUnsuitableShape, "the surface is open or not oriented where the blade meets it"};
}

/// One of the layers that a triangle of the section has where tissue lies in itself.
struct Layer {
  Index triangle;
  int number;  // 1, 2 ..; -1, -2 .. where it is turned inside out
};

/// An edge between two nodes, and what has it.
struct NodeEdge {
  Index left = kNoIndex, right = kNoIndex;  // three times a wound triangle and the number of its edge
  Index rim = kNoIndex;                     // the last of the rim's edges there; others follow in next_rim_
  bool done = false;
};

class Joiner {
 public:
  Joiner(SplitSurface surface, const Wound& wound, std::uint32_t patch)
      : surface_(std::move(surface)), wound_(wound), patch_(patch) {}

  Result<OpenedSurface> run() {
    gather();
    Status done = joinSurface();
    if (done) done = joinWound();
    if (!done) return done.error();
    findFlaps();
    for (Corner c = 0; c < partners_.size(); ++c) {
      const Corner d = partners_[c];
      if (d == kNoIndex || d < c) continue;
      corners_.join(c, nextCorner(d));
      corners_.join(nextCorner(c), d);
    }
    build();
    splitDoubleEdges();
    done = check();
    if (!done) return done.error();
    dropFlaps();
    return std::move(out_);
  }

 private:
  /// Triangles of the surface with a corner within the blade, then the layers of the lower wound face, then those of
  /// the upper one.
  void gather() {
    for (Index t = 0; t < surface_.triangles.size(); ++t) {
      const Triangle& v = surface_.triangles[t];
      if (!(surface_.within[v[0]] | surface_.within[v[1]] | surface_.within[v[2]])) continue;
      near_.push_back(t);
      near_triangles_.push_back(v);
    }
    for (Index t = 0; t < wound_.triangles.size(); ++t) {
      first_layer_.push_back(static_cast<Index>(layers_.size()));
      const int winding = wound_.triangles[t].winding, sign = winding > 0 ? 1 : -1;
      for (int k = sign; std::abs(k) <= std::abs(winding); k += sign) layers_.push_back({t, k});
    }
    const std::size_t corners = 3 * (near_.size() + 2 * layers_.size());
    partners_.assign(corners, kNoIndex);
    corners_.reset(corners);
  }

  // --- corners of the surface and of the wound faces

  bool isWound(Corner c) const { return c / 3 >= near_.size(); }
  bool isUpper(Corner c) const { return c / 3 >= near_.size() + layers_.size(); }
  const Layer& layerOf(Corner c) const { return layers_[(c / 3 - near_.size()) % layers_.size()]; }
  /// The lower wound face runs as its triangle does, the upper one the other way round: its corners are nodes 0, 2, 1.
  bool runsAlong(Corner c) const { return (layerOf(c).number > 0) != isUpper(c); }
  Index nodeOf(Corner c) const {
    const std::array<Index, 3>& n = wound_.triangles[layerOf(c).triangle].nodes;
    return runsAlong(c) ? n[c % 3] : n[(3 - c % 3) % 3];
  }
  Index vertexOf(Corner c) const { return near_triangles_[c / 3][c % 3]; }
  const Vec3& positionOf(Corner c) const { return surface_.positions[vertexOf(c)]; }
  Vec3 placeOf(Corner c) const { return isWound(c) ? wound_.position(surface_, nodeOf(c)) : positionOf(c); }

  /// The corner for edge `edge` of a layer of the wound faces. `number`: from 1 on, the outermost is the highest.
  Corner wound(Index triangle_edge, int number, bool upper) const {
    const Index triangle = triangle_edge / 3, edge = triangle_edge % 3;
    const bool along = (wound_.triangles[triangle].winding > 0) != upper;
    const std::size_t layer = first_layer_[triangle] + static_cast<Index>(number - 1);
    return static_cast<Corner>(3 * (near_.size() + layer + (upper ? layers_.size() : 0)) + (along ? edge : 2 - edge));
  }

  void join(Corner c, Corner d) {
    partners_[c] = d;
    partners_[d] = c;
  }

  // --- edges of the surface

  /// Pairs the triangles at edges with an end within the blade. Those at the rim wait for the wound faces.
  Status joinSurface() {
    struct Edge {
      Index low, high;
      Corner corner;
    };
    std::vector<Edge> edges;
    for (Corner c = 0; c < 3 * near_.size(); ++c) {
      const Index a = vertexOf(c), b = vertexOf(nextCorner(c));
      if (surface_.within[a] | surface_.within[b]) edges.push_back({std::min(a, b), std::max(a, b), c});
    }
    std::sort(edges.begin(), edges.end(), [](const Edge& p, const Edge& q) {
      return std::tie(p.low, p.high, p.corner) < std::tie(q.low, q.high, q.corner);
    });
    at_rim_.resize(wound_.rim.size());
    std::size_t next_rim = 0;  // the rim is in the same order
    std::vector<Corner> around;
    for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
      around.clear();
      for (; end < edges.size() && edges[end].low == edges[begin].low && edges[end].high == edges[begin].high; ++end)
        around.push_back(edges[end].corner);
      const auto key = std::make_pair(edges[begin].low, edges[begin].high);
      while (next_rim < wound_.rim.size() && std::make_pair(wound_.rim[next_rim].from, wound_.rim[next_rim].to) < key)
        ++next_rim;
      if (next_rim < wound_.rim.size() && std::make_pair(wound_.rim[next_rim].from, wound_.rim[next_rim].to) == key) {
        at_rim_[next_rim] = around;
      } else if (!pair(around)) {
        return branches();
      }
    }
    return Done{};
  }

  bool upperOf(Corner c) const { return isWound(c) ? isUpper(c) : surface_.isUpper(near_triangles_[c / 3]); }

  /// False where there is no partner for each.
  bool pair(const std::vector<Corner>& around) {
    if (around.size() == 2 && !isWound(around[0]) && !isWound(around[1])) {
      if (vertexOf(around[0]) == vertexOf(around[1])) return false;
      join(around[0], around[1]);
      return true;
    }
    return around.empty() || pairSideBySide(around);
  }

  // The vertices or, of the wound faces, the lowest vertices of the nodes that an edge starts at. Edges between two
  // nodes without vertices are no rim, and are not asked for.
  Index startOf(Corner c) const { return isWound(c) ? nodeOf(c) : nodeOfVertex(vertexOf(c)); }
  Index nodeOfVertex(Index v) const {
    const auto at = wound_.node_of_vertex.find(v);
    return at == wound_.node_of_vertex.end() ? kNoIndex : at->second;
  }

  /// More than two triangles at an edge: those that bound one wedge of solid belong together. Around the axis a -> b, a
  /// triangle that runs b -> a has the solid at larger angles and opens a wedge, one that runs a -> b closes it. Wedges
  /// inside wedges (layers of a surface that crosses itself) are matched like parentheses.
  bool pairSideBySide(const std::vector<Corner>& around, bool both_sides = false) {
    if (around.size() % 2 != 0) return false;
    struct Leaf {
      double angle;
      bool opens;
      int layer;
      Corner corner;
    };
    const bool any_wound = std::any_of(around.begin(), around.end(), [&](Corner c) { return isWound(c); });
    const auto idOf = [&](Corner c) { return any_wound ? startOf(c) : vertexOf(c); };
    const Index first = idOf(around[0]), second = idOf(nextCorner(around[0])), b = std::max(first, second);
    const Corner from = first < second ? around[0] : nextCorner(around[0]),
                 to = first < second ? nextCorner(around[0]) : around[0];
    const Vec3 origin = placeOf(from);
    const Vec3 axis = (placeOf(to) - origin).normalized();
    // Edges on the plane measure from the plane, so that wound faces lie at exactly 0 and 180 degrees.
    const bool in_plane = any_wound || (surface_.sides[vertexOf(from)] == 0 && surface_.sides[vertexOf(to)] == 0);
    const Vec3 up = in_plane ? surface_.frame.normal : axis.unitOrthogonal();
    const Vec3 along = up.cross(axis).normalized();
    std::vector<Leaf> leaves;
    int sum = 0;
    for (const Corner c : around) {
      const Vec3 arm = placeOf(previousCorner(c)) - origin;
      const int layer = isWound(c) ? layerOf(c).number : 0;
      // With both sides of the blade, the lower wound faces lie a hair below the upper ones.
      const double height = layer == 0                  ? up.dot(arm)
                            : both_sides && !isUpper(c) ? -10.0 * kSameAngle * std::abs(along.dot(arm))
                                                        : 0.0;
      double angle = std::atan2(height, along.dot(arm));
      if (angle < -kSameAngle) angle += 2.0 * M_PI;
      const bool opens = idOf(c) == b;
      leaves.push_back({angle, opens, layer, c});
      sum += opens ? 1 : -1;
    }
    if (sum != 0) return false;
    std::sort(leaves.begin(), leaves.end(), [](const Leaf& p, const Leaf& q) { return p.angle < q.angle; });
    for (std::size_t i = 1; i < leaves.size(); ++i)
      if (leaves[i].angle - leaves[i - 1].angle < kSameAngle) leaves[i].angle = leaves[i - 1].angle;
    // Where faces lie on each other the wedge that ends goes first: solids that touch stay two solids. Layers of the
    // wound faces nest, the outermost first.
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

  // --- edges of the wound faces

  Status joinWound() {
    EdgeTable<NodeEdge> edges(3 * wound_.triangles.size() + wound_.rim.size() + 16, NodeEdge());
    for (Index t = 0; t < wound_.triangles.size(); ++t) {
      const std::array<Index, 3>& n = wound_.triangles[t].nodes;
      for (Index k = 0; k < 3; ++k) {
        NodeEdge& edge = edges.at(n[k], n[(k + 1) % 3]);
        (n[k] < n[(k + 1) % 3] ? edge.left : edge.right) = 3 * t + k;
      }
    }
    next_rim_.assign(wound_.rim.size(), kNoIndex);
    std::vector<NodeEdge*> edge_of_rim(wound_.rim.size(), nullptr);
    for (Index r = static_cast<Index>(wound_.rim.size()); r-- > 0;) {
      const Index a = nodeOfVertex(wound_.rim[r].from), b = nodeOfVertex(wound_.rim[r].to);
      // What is not of the part that is filled stays as it is.
      if (a == kNoIndex || b == kNoIndex) {
        if (!pair(at_rim_[r])) return branches();
        continue;
      }
      if (a == b) return branches();
      NodeEdge& edge = edges.at(a, b);
      next_rim_[r] = edge.rim;
      edge.rim = r;
      edge_of_rim[r] = &edge;
    }
    for (Index t = 0; t < wound_.triangles.size(); ++t) {
      const std::array<Index, 3>& n = wound_.triangles[t].nodes;
      for (Index k = 0; k < 3; ++k) {
        NodeEdge& edge = edges.at(n[k], n[(k + 1) % 3]);
        if (!edge.done && !joinAt(edge)) return branches();
        edge.done = true;
      }
    }
    for (NodeEdge* edge : edge_of_rim) {
      if (!edge || edge->done) continue;
      if (!joinAt(*edge)) return branches();
      edge->done = true;
    }
    return Done{};
  }

  int windingOf(Index triangle_edge) const {
    return triangle_edge == kNoIndex ? 0 : wound_.triangles[triangle_edge / 3].winding;
  }

  bool joinAt(const NodeEdge& edge) {
    int left = windingOf(edge.left), right = windingOf(edge.right);  // layers that are not joined yet
    if (edge.rim != kNoIndex) {
      joinRims(edge, left, right);
      std::vector<Index> others;
      for (Index r = edge.rim; r != kNoIndex; r = next_rim_[r])
        if (!isSimple(r)) others.push_back(r);
      if (!others.empty()) {
        if (left != 0 || right != 0) return joinAround(others, edge, left, right);
        for (const Index r : others)
          if (!pair(at_rim_[r])) return false;
      }
    }
    // Layers go on below and above; at the buried front the lower one meets the upper one.
    const bool alike = (left > 0) == (right > 0);
    const int common = alike ? std::min(std::abs(left), std::abs(right)) : 0;
    for (int k = 1; k <= common; ++k)
      for (const bool upper : {false, true}) join(wound(edge.left, k, upper), wound(edge.right, k, upper));
    for (int k = common + 1; k <= std::abs(left); ++k) join(wound(edge.left, k, false), wound(edge.left, k, true));
    for (int k = common + 1; k <= std::abs(right); ++k) join(wound(edge.right, k, false), wound(edge.right, k, true));
    return true;
  }

  /// One triangle above and one below.
  bool isSimple(Index rim) const {
    return at_rim_[rim].size() == 2 && upperOf(at_rim_[rim][0]) != upperOf(at_rim_[rim][1]);
  }

  /// Which tissue a wound face closes follows from what hangs together there, and not from where it lies: lips of a
  /// wound may press into each other.
  void joinRims(const NodeEdge& edge, int& left, int& right) {
    struct Rim {
      Corner above, below;
      bool along;  // as the edge runs, from the lower node to the higher: the solid is to the left
      bool open = true;
    };
    std::vector<Rim> rims;
    for (Index r = edge.rim; r != kNoIndex; r = next_rim_[r]) {
      if (!isSimple(r)) continue;
      Rim rim{at_rim_[r][0], at_rim_[r][1], false};
      if (!upperOf(rim.above)) std::swap(rim.above, rim.below);
      rim.along = nodeOfVertex(vertexOf(rim.above)) < nodeOfVertex(vertexOf(nextCorner(rim.above)));
      rims.push_back(rim);
    }
    const auto meet = [&](Rim& rim, Index triangle_edge, int& layers) {
      const int number = std::abs(layers);
      join(rim.above, wound(triangle_edge, number, true));
      join(rim.below, wound(triangle_edge, number, false));
      layers += layers > 0 ? -1 : 1;
      rim.open = false;
    };
    for (Rim& rim : rims) {
      if (rim.along ? left > 0 : left < 0) {
        meet(rim, edge.left, left);
      } else if (rim.along ? right < 0 : right > 0) {
        meet(rim, edge.right, right);
      }
    }
    // A sheet without thickness comes apart; what else is left over is at the rectangle's border, and stays as it was.
    for (std::size_t i = 0; i < rims.size(); ++i) {
      if (!rims[i].open) continue;
      std::size_t other = i + 1;
      while (other < rims.size() && (!rims[other].open || rims[other].along == rims[i].along)) ++other;
      if (other < rims.size()) {
        join(rims[i].above, rims[other].above);
        join(rims[i].below, rims[other].below);
        rims[other].open = false;
      } else {
        join(rims[i].above, rims[i].below);
      }
      rims[i].open = false;
    }
  }

  /// Where the surface only touches the plane, or has more than two triangles at an edge: by the angles around it.
  bool joinAround(const std::vector<Index>& rims, const NodeEdge& edge, int left, int right) {
    std::vector<Corner> above, below;
    for (const Index r : rims)
      for (const Corner c : at_rim_[r]) (upperOf(c) ? above : below).push_back(c);
    const auto addLayers = [&](Index triangle_edge, int layers) {
      for (int k = 1; k <= std::abs(layers); ++k) {
        above.push_back(wound(triangle_edge, k, true));
        below.push_back(wound(triangle_edge, k, false));
      }
    };
    addLayers(edge.left, left);
    addLayers(edge.right, right);
    const auto balanced = [&](const std::vector<Corner>& all) {
      int sum = 0;
      for (const Corner c : all) sum += startOf(c) < startOf(nextCorner(c)) ? 1 : -1;
      return sum == 0;
    };
    if (balanced(above) && balanced(below))
      return (above.empty() || pairSideBySide(above)) && (below.empty() || pairSideBySide(below));
    above.insert(above.end(), below.begin(), below.end());
    return pairSideBySide(above, true);
  }

  // --- the surface that comes of it

  /// Two triangles that lie on each other, with nothing but each other at all three edges, drop out.
  void findFlaps() {
    dropped_.assign(partners_.size() / 3, 0);
    for (Corner c = 0; c < partners_.size(); c += 3) {
      if (partners_[c] == kNoIndex || partners_[c + 1] == kNoIndex || partners_[c + 2] == kNoIndex) continue;
      const Index other = partners_[c] / 3;
      if (other == c / 3 || partners_[c + 1] / 3 != other || partners_[c + 2] / 3 != other) continue;
      for (Corner k = 0; k < 3; ++k) partners_[c + k] = partners_[3 * other + k] = kNoIndex;
      dropped_[c / 3] = dropped_[other] = 1;
    }
  }

  void dropFlaps() {
    std::vector<char> drop(out_.mesh.triangles.size(), 0);
    bool any = false;
    for (std::size_t n = 0; n < dropped_.size(); ++n)
      if (dropped_[n]) drop[slots_[n]] = any = true;
    if (!any) return;
    std::size_t kept = 0;
    for (std::size_t t = 0; t < drop.size(); ++t) {
      if (drop[t]) continue;
      out_.mesh.triangles[kept] = out_.mesh.triangles[t];
      out_.mesh.patches[kept] = out_.mesh.patches[t];
      out_.facing[kept++] = out_.facing[t];
    }
    out_.mesh.triangles.resize(kept);
    out_.mesh.patches.resize(kept);
    out_.facing.resize(kept);
  }

  Index addVertex(const Vec3& position, const VertexOrigin& origin) {
    out_.mesh.vertices.push_back(position);
    out_.origins.push_back(origin);
    return static_cast<Index>(out_.mesh.vertices.size() - 1);
  }

  /// The first umbrella of a vertex keeps it, the others get one of their own.
  void build() {
    const std::size_t vertices = surface_.positions.size();
    out_.origins.reserve(vertices + 2 * wound_.nodes.size());
    out_.origins.addKept(0, surface_.mesh_vertices);
    for (Index v = surface_.mesh_vertices; v < vertices; ++v) out_.origins.push_back(surface_.originOf(v));
    const std::size_t more = 2 * layers_.size();
    out_.facing.reserve(surface_.triangles.size() + more);
    out_.facing.assign(surface_.triangles.size(), 0);
    out_.mesh.vertices = surface_.positions;
    out_.mesh.triangles = std::move(surface_.triangles);
    out_.mesh.patches = std::move(surface_.patches);
    out_.mesh.triangles.reserve(out_.mesh.triangles.size() + more);
    out_.mesh.patches.reserve(out_.mesh.patches.size() + more);
    slots_.assign(near_.begin(), near_.end());
    for (std::size_t l = 0; l < 2 * layers_.size(); ++l) {
      slots_.push_back(static_cast<Index>(out_.mesh.triangles.size()));
      out_.mesh.triangles.push_back({kNoIndex, kNoIndex, kNoIndex});
      out_.mesh.patches.push_back(patch_);
      const bool upper = l >= layers_.size();
      out_.facing.push_back((layers_[upper ? l - layers_.size() : l].number > 0) != upper ? 1 : -1);
    }
    // Where vertices at the same place come together, the lowest stands for them.
    std::vector<Index> lowest(partners_.size(), kNoIndex);
    for (Corner c = 0; c < 3 * near_.size(); ++c)
      if (surface_.within[vertexOf(c)]) lowest[corners_.find(c)] = std::min(lowest[corners_.find(c)], vertexOf(c));
    std::vector<Index> of_root(partners_.size(), kNoIndex);
    std::vector<char> kept(vertices, 0);
    for (Corner c = 0; c < partners_.size(); ++c) {
      if (dropped_[c / 3] || (!isWound(c) && !surface_.within[vertexOf(c)])) continue;
      Index& number = of_root[corners_.find(c)];  // the root is the lowest corner and so comes first
      if (number == kNoIndex) {
        const Index v = isWound(c) ? wound_.nodes[nodeOf(c)].vertex : lowest[corners_.find(c)];
        if (v == kNoIndex) {
          number = addVertex(wound_.position(surface_, nodeOf(c)), VertexOrigin());
        } else if (isWound(c) || kept[v]) {
          number = addVertex(surface_.positions[v], surface_.originOf(v));
        } else {
          kept[v] = 1;
          number = v;
        }
      }
      out_.mesh.triangles[slots_[c / 3]][c % 3] = number;
    }
  }

  Index finalVertex(Corner c) const { return out_.mesh.triangles[slots_[c / 3]][c % 3]; }

  /// Where two pairs of triangles have an edge between the same two vertices, each pair gets a vertex of its own in its
  /// middle. Both wound faces have such edges between two points of the front.
  void splitDoubleEdges() {
    EdgeTable<Corner> first(partners_.size() / 2, kNoIndex);
    std::vector<Corner> doubled;
    for (Corner c = 0; c < partners_.size(); ++c) {
      if (partners_[c] == kNoIndex || partners_[c] < c) continue;
      Corner& other = first.at(finalVertex(c), finalVertex(nextCorner(c)));
      if (other == kNoIndex) {
        other = c;
        continue;
      }
      if (!(other & kTaken)) doubled.push_back(other);
      other |= kTaken;
      doubled.push_back(c);
    }
    if (doubled.empty()) return;
    std::vector<Index> middles(partners_.size(), kNoIndex);
    std::vector<bool> split(partners_.size() / 3, false);
    for (const Corner c : doubled) {
      const Corner d = partners_[c];
      const Index a = finalVertex(c), b = finalVertex(nextCorner(c));
      VertexOrigin origin;
      Vec3 at = 0.5 * (out_.mesh.vertices[a] + out_.mesh.vertices[b]);
      if (const Corner own = isWound(c) ? d : c; !isWound(own)) {
        mixOrigins(surface_.originOf(vertexOf(own)), surface_.originOf(vertexOf(nextCorner(own))), 0.5, origin);
        at = 0.5 * (positionOf(own) + positionOf(nextCorner(own)));
      }
      middles[c] = middles[d] = addVertex(at, origin);
      split[c / 3] = split[d / 3] = true;
    }
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
    std::vector<char> touched(out_.mesh.vertices.size(), 1);
    for (std::size_t v = 0; v < surface_.positions.size(); ++v) touched[v] = surface_.within[v];
    EdgeTable<int> seen(3 * slots_.size(), 0);
    std::size_t open = 0;
    for (std::size_t n = 0; n < slots_.size(); ++n) {
      if (n < dropped_.size() && dropped_[n]) continue;
      const Triangle& t = out_.mesh.triangles[slots_[n]];
      if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0])
        return Error{ErrorCode::kUnsuitableShape, "the cut would leave a triangle without area"};
      for (int k = 0; k < 3; ++k) {
        const Index a = t[k], b = t[(k + 1) % 3];
        if (!(touched[a] | touched[b])) continue;
        int& uses = seen.at(a, b);
        const int use = a < b ? 1 : 2;
        if (uses & use) return branches();
        open += uses == 0 ? 1 : static_cast<std::size_t>(-1);
        uses |= use;
      }
    }
    if (open != 0) return branches();
    return Done{};
  }

  SplitSurface surface_;
  const Wound& wound_;
  const std::uint32_t patch_;
  std::vector<Index> near_;  // triangles
  std::vector<Triangle> near_triangles_;
  std::vector<Layer> layers_;
  std::vector<Index> first_layer_;           // of each of the wound's triangles
  std::vector<std::vector<Corner>> at_rim_;  // of each edge of the rim, the surface's triangles there
  std::vector<Index> next_rim_;              // at the same two nodes
  std::vector<Corner> partners_;
  UnionFind corners_;
  std::vector<char> dropped_;
  std::vector<Index> slots_;  // triangles of the result: near ones, lower face, upper face, then parts of those
  OpenedSurface out_;
};

}  // namespace

Result<OpenedSurface> join(SplitSurface surface, const Wound& wound, std::uint32_t patch) {
  return Joiner(std::move(surface), wound, patch).run();
}

}  // namespace surgery
}  // namespace meshless
