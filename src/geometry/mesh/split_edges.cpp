#include "split_edges.h"

namespace meshless {

void splitAtEdges(std::vector<Triangle>& triangles, std::vector<std::uint32_t>& patches, const InnerVertices& inner) {
  const std::size_t count = triangles.size();
  std::vector<Triangle> open;
  for (std::size_t t = 0; t < count; ++t) {
    open.assign(1, triangles[t]);
    bool first = true;
    while (!open.empty()) {
      const Triangle v = open.back();
      open.pop_back();
      int edge = 0;
      auto found = inner.end();
      for (; edge < 3; ++edge) {
        found = inner.find(edgeKey(v[edge], v[(edge + 1) % 3]));
        if (found != inner.end()) break;
      }
      if (found == inner.end()) {
        if (first) {
          triangles[t] = v;
        } else {
          triangles.push_back(v);
          patches.push_back(patches[t]);
        }
        first = false;
        continue;
      }
      const Index a = v[edge], b = v[(edge + 1) % 3], apex = v[(edge + 2) % 3];
      std::vector<Index> stops = found->second;
      if (a > b) std::reverse(stops.begin(), stops.end());
      stops.push_back(b);
      Index from = a;
      for (const Index to : stops) {
        open.push_back({from, to, apex});
        from = to;
      }
    }
  }
}

bool mixOrigins(const VertexOrigin& a, const VertexOrigin& b, double s, VertexOrigin& mixed) {
  mixed = VertexOrigin();
  std::size_t used = 0;
  const auto add = [&](const VertexOrigin& end, double share) {
    for (std::size_t k = 0; k < 4 && end.parents[k] != kNoIndex; ++k) {
      std::size_t slot = 0;
      while (slot < used && mixed.parents[slot] != end.parents[k]) ++slot;
      if (slot == 4) return false;
      if (slot == used) mixed.parents[used++] = end.parents[k];
      mixed.weights[slot] += share * end.weights[k];
    }
    return true;
  };
  return add(a, 1.0 - s) && add(b, s);
}

}  // namespace meshless
