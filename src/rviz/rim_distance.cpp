#include "rim_distance.h"

#include <algorithm>
#include <array>
#include <queue>

#include "ogre_convert.h"

namespace meshless {
namespace {

using Edge = std::array<std::uint32_t, 2>;

float distanceTo(const Ogre::Vector3& p, const Ogre::Vector3& a, const Ogre::Vector3& b) {
  const Ogre::Vector3 along = b - a;
  const float length = along.squaredLength();
  const float share = length > 0.0f ? std::clamp((p - a).dotProduct(along) / length, 0.0f, 1.0f) : 0.0f;
  return p.distance(a + share * along);
}

/// The edges that a face of a cut and one of the outer surface share.
std::vector<Edge> rimOf(const std::vector<std::uint32_t>& triangles, const std::vector<std::uint8_t>& cut) {
  std::vector<std::pair<Edge, bool>> edges;
  edges.reserve(triangles.size());
  for (std::size_t c = 0; c < triangles.size(); ++c) {
    const std::uint32_t a = triangles[c], b = triangles[c % 3 == 2 ? c - 2 : c + 1];
    edges.push_back({{std::min(a, b), std::max(a, b)}, cut[c / 3] != 0});
  }
  std::sort(edges.begin(), edges.end());
  std::vector<Edge> rim;
  for (std::size_t k = 1; k < edges.size(); ++k)  // of an edge, those of the outer surface come first
    if (edges[k].first == edges[k - 1].first && edges[k].second != edges[k - 1].second) rim.push_back(edges[k].first);
  return rim;
}

}  // namespace

std::vector<float> rimDistances(const std::vector<float>& vertices, const std::vector<std::uint32_t>& triangles,
                                const std::vector<std::uint8_t>& cut, float most) {
  const std::size_t count = vertices.size() / 3;
  std::vector<float> distances(count, most);
  if (std::all_of(cut.begin(), cut.end(), [](std::uint8_t c) { return c == 0; })) return distances;
  const std::vector<Edge> rim = rimOf(triangles, cut);
  // Triangles around a vertex: fan[first[v] .. first[v + 1])
  std::vector<std::uint32_t> first(count + 1, 0), fan(triangles.size());
  for (const std::uint32_t v : triangles) ++first[v + 1];
  for (std::size_t v = 0; v < count; ++v) first[v + 1] += first[v];
  std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
  for (std::size_t c = 0; c < triangles.size(); ++c) fan[next[triangles[c]]++] = static_cast<std::uint32_t>(c / 3);

  // Dijkstra, in which each vertex hands on the piece of the edge that it is nearest to.
  struct Reached {
    float distance;
    std::uint32_t vertex, piece;
    bool operator<(const Reached& other) const { return distance > other.distance; }  // the nearest is on top
  };
  std::priority_queue<Reached> queue;
  const auto reach = [&](std::uint32_t v, std::uint32_t piece) {
    const float distance =
        distanceTo(vertexOf(vertices, v), vertexOf(vertices, rim[piece][0]), vertexOf(vertices, rim[piece][1]));
    if (!(distance < distances[v])) return;
    distances[v] = distance;
    queue.push({distance, v, piece});
  };
  for (std::uint32_t piece = 0; piece < rim.size(); ++piece)
    for (const std::uint32_t v : rim[piece]) reach(v, piece);
  while (!queue.empty()) {
    const Reached at = queue.top();
    queue.pop();
    if (at.distance > distances[at.vertex]) continue;
    for (std::uint32_t i = first[at.vertex]; i < first[at.vertex + 1]; ++i)
      for (int k = 0; k < 3; ++k) reach(triangles[3 * fan[i] + k], at.piece);
  }
  return distances;
}

}  // namespace meshless
