#include "meshless_surgery/geometry/mesh/refine.h"

#include <algorithm>
#include <map>
#include <utility>

namespace meshless {

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

TriangleMesh withShortEdges(TriangleMesh mesh, double longest) {
  std::vector<Triangle> parts;
  for (bool any = true; any;) {
    any = false;
    std::map<std::pair<Index, Index>, Index> middles;
    const auto middleOf = [&](Index a, Index b) {
      if (!((mesh.vertices[a] - mesh.vertices[b]).norm() > longest)) return kNoIndex;
      const auto [at, made] = middles.emplace(std::minmax(a, b), static_cast<Index>(mesh.vertices.size()));
      if (made) mesh.vertices.push_back(0.5 * (mesh.vertices[a] + mesh.vertices[b]));
      return at->second;
    };
    const std::size_t count = mesh.triangles.size();
    for (std::size_t f = 0; f < count; ++f) {
      const Triangle t = mesh.triangles[f];
      const std::array<Index, 3> inside = {middleOf(t[0], t[1]), middleOf(t[1], t[2]), middleOf(t[2], t[0])};
      if (inside == std::array<Index, 3>{kNoIndex, kNoIndex, kNoIndex}) continue;
      any = true;
      parts.clear();
      subdivide(t, inside, parts);
      mesh.triangles[f] = parts[0];
      for (std::size_t p = 1; p < parts.size(); ++p) {
        mesh.triangles.push_back(parts[p]);
        if (!mesh.patches.empty()) mesh.patches.push_back(mesh.patches[f]);
      }
    }
  }
  return mesh;
}

}  // namespace meshless
