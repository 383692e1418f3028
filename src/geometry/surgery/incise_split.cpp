// New vertices in edges of the rim.
#include <algorithm>
#include <cassert>
#include <cmath>

#include "incise_parts.h"

namespace meshless {
namespace incising {

VertexOrigin SplitSurface::originOf(Index vertex) const {
  if (vertex >= mesh_vertices) return new_origins[vertex - mesh_vertices];
  return VertexOrigin::of(vertex);
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
  new_origins.push_back(origin);
  return static_cast<Index>(positions.size() - 1);
}

bool splitRimAtVertices(SplitSurface& surface) {
  const double snap = 1e-3 * surface.frame.band;
  std::vector<Index> vertices;
  for (const RimEdge& e : surface.rim) {
    vertices.push_back(e.from);
    vertices.push_back(e.to);
  }
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());

  struct Stop {
    double s;
    Vec2 place;
  };
  InnerVertices inner;
  std::vector<RimEdge> rim;
  std::vector<Stop> stops;
  for (const RimEdge& e : surface.rim) {
    // The same stops, to the last bit, for a wound face that lies on this one and runs the other way.
    const bool swapped = comesFirst(surface.positions[e.to], surface.positions[e.from]);
    const Index start = swapped ? e.to : e.from, end = swapped ? e.from : e.to;
    const Vec2 a = surface.places[start], edge = surface.places[end] - a;
    const double length = edge.norm();
    stops.clear();
    for (const Index v : vertices) {
      const Vec2 arm = surface.places[v] - a;
      const double along = edge.dot(arm) / length;
      if (!(along > snap && along < length - snap)) continue;
      if (std::abs(edge.x() * arm.y() - edge.y() * arm.x()) <= snap * length)
        stops.push_back({along / length, surface.places[v]});
    }
    std::sort(stops.begin(), stops.end(), [](const Stop& p, const Stop& q) { return p.s < q.s; });
    std::vector<Index> chain{start};
    double last = 0.0;
    for (const Stop& stop : stops) {
      if (chain.size() > 1 && (stop.s - last) * length <= snap) continue;
      last = stop.s;
      const Index made = surface.addBetween(start, end, stop.s);
      surface.places[made] = stop.place;
      chain.push_back(made);
    }
    chain.push_back(end);
    if (swapped) std::reverse(chain.begin(), chain.end());
    for (std::size_t k = 0; k + 1 < chain.size(); ++k) rim.push_back({chain[k], chain[k + 1], e.kind});
    if (chain.size() == 2) continue;
    std::vector<Index> between(chain.begin() + 1, chain.end() - 1);
    if (e.from > e.to) std::reverse(between.begin(), between.end());
    inner.emplace(edgeKey(e.from, e.to), std::move(between));
  }
  if (inner.empty()) return false;
  surface.rim = std::move(rim);
  splitAtEdges(surface.triangles, surface.patches, inner);
  return true;
}

}  // namespace incising
}  // namespace meshless
