#include "cut_rim.h"

#include <algorithm>
#include <tuple>

namespace meshless {
namespace cutting {

std::vector<Index> Nodes::lowestVertices() const {
  std::vector<Index> lowest(places.size(), kNoIndex);
  for (Index v = 0; v < of_vertex.size(); ++v)
    if (of_vertex[v] != kNoIndex) lowest[of_vertex[v]] = std::min(lowest[of_vertex[v]], first_vertex + v);
  return lowest;
}

std::vector<Index> Nodes::mergedVertices() const {
  const std::vector<Index> lowest = lowestVertices();
  std::vector<Index> merged(of_vertex.size());
  for (Index v = 0; v < merged.size(); ++v)
    merged[v] = of_vertex[v] == kNoIndex ? first_vertex + v : lowest[of_vertex[v]];
  return merged;
}

Nodes nodesOf(const Workpiece& work, const std::vector<RimEdge>& rim) {
  Nodes nodes;
  nodes.first_vertex = work.mesh_vertices;
  nodes.of_vertex.assign(work.new_positions.size(), kNoIndex);
  struct Placed {
    double x, y;
    Index vertex;
  };
  std::vector<Placed> placed;
  for (const RimEdge& e : rim) {
    for (const Index v : {e.from, e.to}) {
      Index& node = nodes.of_vertex[v - nodes.first_vertex];
      if (node != kNoIndex) continue;
      node = 0;
      const Vec2 p = work.flat(v);
      placed.push_back({p.x(), p.y(), v});
    }
  }
  std::sort(placed.begin(), placed.end(), [](const Placed& a, const Placed& b) {
    return std::tie(a.x, a.y, a.vertex) < std::tie(b.x, b.y, b.vertex);
  });
  for (std::size_t i = 0; i < placed.size(); ++i) {
    if (i == 0 || placed[i].x != placed[i - 1].x || placed[i].y != placed[i - 1].y)
      nodes.places.emplace_back(placed[i].x, placed[i].y);
    nodes.of_vertex[placed[i].vertex - nodes.first_vertex] = static_cast<Index>(nodes.places.size() - 1);
  }
  return nodes;
}

std::vector<OutlineSegment> outlineOf(const Nodes& nodes, const std::vector<RimEdge>& rim) {
  std::vector<OutlineSegment> outline;
  outline.reserve(rim.size());
  for (const RimEdge& e : rim) {
    const Index from = nodes.at(e.from), to = nodes.at(e.to);
    if (from != to) outline.push_back({from, to, e.net});
  }
  return outline;
}

bool splitRim(Workpiece& work, const std::vector<RimEdge>& rim, Nodes& nodes) {
  std::vector<OutlineSegment> segments;
  for (const RimEdge& e : rim) segments.push_back({nodes.at(e.from), nodes.at(e.to), e.net});
  SplitOutline split = splitOutline(nodes.places, segments);
  if (!split.ok) return false;

  const std::size_t old_nodes = nodes.places.size();
  // Where two edges cross they share one vertex; at a node that was there an edge gets a vertex of its own, on itself.
  std::vector<Index> shared(split.nodes.size(), kNoIndex);
  InnerVertices inner;
  for (std::size_t i = 0; i < rim.size(); ++i) {
    const std::vector<Index>& chain = split.chains[i];
    if (chain.size() < 3) continue;
    const Vec2 start = split.nodes[chain.front()], edge = split.nodes[chain.back()] - start;
    std::vector<Index>& vertices = inner[edgeKey(rim[i].from, rim[i].to)];
    for (std::size_t k = 1; k + 1 < chain.size(); ++k) {
      const Index node = chain[k];
      if (shared[node] == kNoIndex) {
        const double s = edge.dot(split.nodes[node] - start) / edge.squaredNorm();
        const Index made = work.addBetween(rim[i].from, rim[i].to, std::min(std::max(s, 0.0), 1.0));
        nodes.of_vertex.push_back(node);
        if (node >= old_nodes) shared[node] = made;
        vertices.push_back(made);
      } else {
        vertices.push_back(shared[node]);
      }
    }
  }
  for (SideSurface& side : work.sides) splitAtEdges(side.triangles, side.patches, inner);
  nodes.places = std::move(split.nodes);
  for (Index& node : nodes.of_vertex)
    if (node != kNoIndex) node = split.merged[node];
  return true;
}

}  // namespace cutting
}  // namespace meshless
