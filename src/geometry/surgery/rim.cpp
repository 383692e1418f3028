// The rim of a wound, and its repair where it meets itself.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <tuple>

#include "cap_outline.h"
#include "mesh/exact.h"
#include "surgery_parts.h"

namespace meshless {
namespace surgery {

VertexOrigin SplitSurface::originOf(Index vertex) const {
  return vertex < mesh_vertices ? VertexOrigin::of(vertex) : new_origins[vertex - mesh_vertices];
}

Index SplitSurface::addBetween(Index a, Index b, double s) {
  VertexOrigin origin;
  // All ends lie in one triangle of the mesh: three parents at the most.
  const bool fits = mixOrigins(originOf(a), originOf(b), s, origin);
  assert(fits);
  (void)fits;
  const Vec3 position = positions[a] + s * (positions[b] - positions[a]);
  positions.push_back(position);
  places.emplace_back(Vec2::Zero());
  sides.push_back(0);
  within.push_back(0);
  new_origins.push_back(origin);
  return static_cast<Index>(positions.size() - 1);
}

bool SplitSurface::isUpper(const Triangle& t) const {
  for (const Index v : t)
    if (sides[v] != 0) return sides[v] > 0;
  // One that lies in the plane bounds the solid below it where it faces up. Exact on its places, as the wound faces'
  // triangulation is.
  return !(exact::turn(places[t[0]], places[t[1]], places[t[2]]) > 0);
}

std::vector<RimEdge> rimOf(const SplitSurface& surface) {
  struct HalfEdge {
    Index from, to;
    int direction;  // +1: from the lower to the higher
    bool upper, coplanar;
  };
  std::vector<HalfEdge> found;
  for (const Triangle& t : surface.triangles) {
    const std::array<bool, 3> on{surface.within[t[0]] != 0, surface.within[t[1]] != 0, surface.within[t[2]] != 0};
    if (on[0] + on[1] + on[2] < 2) continue;
    const bool upper = surface.isUpper(t);
    const bool coplanar = surface.sides[t[0]] == 0 && surface.sides[t[1]] == 0 && surface.sides[t[2]] == 0;
    for (int k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      if (on[k] && on[(k + 1) % 3]) found.push_back({std::min(a, b), std::max(a, b), a < b ? 1 : -1, upper, coplanar});
    }
  }
  std::sort(found.begin(), found.end(),
            [](const HalfEdge& p, const HalfEdge& q) { return std::tie(p.from, p.to) < std::tie(q.from, q.to); });
  std::vector<RimEdge> rim;
  for (std::size_t begin = 0, end = 0; begin < found.size(); begin = end) {
    int weight = 0;
    bool all_coplanar = true;
    for (; end < found.size() && found[end].from == found[begin].from && found[end].to == found[begin].to; ++end) {
      if (found[end].upper) weight += found[end].direction;
      all_coplanar &= found[end].coplanar;
    }
    // Without a weight of its own an edge still parts what only touches along it.
    if (weight != 0 || !all_coplanar) rim.push_back({found[begin].from, found[begin].to, weight});
  }
  return rim;
}

Nodes nodesOf(const SplitSurface& surface, const std::vector<RimEdge>& rim) {
  std::vector<Index> vertices;
  for (const RimEdge& e : rim) {
    vertices.push_back(e.from);
    vertices.push_back(e.to);
  }
  std::sort(vertices.begin(), vertices.end(), [&](Index a, Index b) {
    const Vec2 &p = surface.places[a], &q = surface.places[b];
    return std::make_tuple(p.x(), p.y(), a) < std::make_tuple(q.x(), q.y(), b);
  });
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  Nodes nodes;
  nodes.of_vertex.reserve(vertices.size());
  for (const Index v : vertices) {
    if (nodes.places.empty() || surface.places[v] != nodes.places.back()) nodes.places.push_back(surface.places[v]);
    nodes.of_vertex.emplace(v, static_cast<Index>(nodes.places.size() - 1));
  }
  return nodes;
}

namespace {

/// Makes one vertex of the ends of edges between vertices of one node, and drops the triangles that lose their area.
bool weld(SplitSurface& surface, const std::vector<RimEdge>& rim, const Nodes& nodes) {
  std::unordered_map<Index, Index> onto;
  const auto rootOf = [&](Index v) {
    for (auto at = onto.find(v); at != onto.end(); at = onto.find(v)) v = at->second;
    return v;
  };
  for (const RimEdge& e : rim) {
    if (nodes.of_vertex.at(e.from) != nodes.of_vertex.at(e.to)) continue;
    const Index a = rootOf(e.from), b = rootOf(e.to);
    if (a != b) onto[std::max(a, b)] = std::min(a, b);
  }
  if (onto.empty()) return false;
  std::size_t kept = 0;
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    Triangle v = surface.triangles[t];
    for (Index& k : v) k = rootOf(k);
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    surface.triangles[kept] = v;
    surface.patches[kept++] = surface.patches[t];
  }
  surface.triangles.resize(kept);
  surface.patches.resize(kept);
  return true;
}

}  // namespace

bool splitRim(SplitSurface& surface, std::vector<RimEdge>& rim, Nodes& nodes) {
  std::vector<OutlineSegment> segments;
  for (const RimEdge& e : rim) segments.push_back({nodes.of_vertex.at(e.from), nodes.of_vertex.at(e.to), e.weight});
  SplitOutline split = splitOutline(nodes.places, segments);
  if (!split.ok) return false;
  InnerVertices inner;
  for (std::size_t i = 0; i < rim.size(); ++i) {
    const std::vector<Index>& chain = split.chains[i];
    if (chain.size() < 3) continue;
    const Vec2 start = split.nodes[chain.front()], edge = split.nodes[chain.back()] - start;
    std::vector<Index>& vertices = inner[edgeKey(rim[i].from, rim[i].to)];
    for (std::size_t k = 1; k + 1 < chain.size(); ++k) {
      const double s = edge.dot(split.nodes[chain[k]] - start) / edge.squaredNorm();
      const Index made = surface.addBetween(rim[i].from, rim[i].to, std::min(std::max(s, 0.0), 1.0));
      surface.within[made] = 1;
      nodes.of_vertex.emplace(made, chain[k]);
      vertices.push_back(made);
    }
  }
  splitAtEdges(surface.triangles, surface.patches, inner);
  nodes.places = std::move(split.nodes);
  for (auto& [vertex, node] : nodes.of_vertex) {
    node = split.merged[node];
    surface.places[vertex] = nodes.places[node];
  }
  do {
    rim.clear();
    for (const RimEdge& e : rimOf(surface))
      if (nodes.of_vertex.count(e.from) > 0 && nodes.of_vertex.count(e.to) > 0) rim.push_back(e);
  } while (weld(surface, rim, nodes));
  return true;
}

}  // namespace surgery
}  // namespace meshless
