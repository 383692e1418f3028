// Which triangles of a surface are neighbours, and how it bends between them.
#include <algorithm>

#include "contact_facet.h"
#include "meshless_surgery/base/bytes.h"

namespace meshless {
namespace {

constexpr double kGentleEdge = 0.7;  // cosine between neighbours: 45 degrees

}  // namespace

// Edges by their lower vertex, and of each those with the same upper one.
void ContactShape::link() const {
  std::call_once(linked_, [this] {
    struct Edge {
      Index high, triangle;
      int corner;
    };
    const auto forEdges = [this](const auto& visit) {
      for (Index t = 0; t < surface_.triangles.size(); ++t)
        for (int k = 0; k < 3; ++k) {
          const Index a = surface_.triangles[t][(k + 1) % 3], b = surface_.triangles[t][(k + 2) % 3];
          visit(std::min(a, b), Edge{std::max(a, b), t, k});
        }
    };
    std::vector<Index> offsets(surface_.vertices.size() + 1, 0);
    forEdges([&](Index low, const Edge&) { ++offsets[low + 1]; });
    for (std::size_t v = 0; v + 1 < offsets.size(); ++v) offsets[v + 1] += offsets[v];
    std::vector<Edge> edges(offsets.back());
    std::vector<Index> next(offsets.begin(), offsets.end() - 1);
    forEdges([&](Index low, const Edge& edge) { edges[next[low]++] = edge; });
    across_.assign(surface_.triangles.size(), {kNoIndex, kNoIndex, kNoIndex});
    bends_.resize(surface_.triangles.size());
    for (std::size_t v = 0; v + 1 < offsets.size(); ++v) {
      const auto first = edges.begin() + offsets[v], end = edges.begin() + offsets[v + 1];
      std::stable_sort(first, end, [](const Edge& p, const Edge& q) { return p.high < q.high; });
      for (auto e = first; e != end && e + 1 != end; ++e) {
        const auto f = e + 1;
        if (e->high != f->high) continue;
        across_[e->triangle][e->corner] = f->triangle;
        across_[f->triangle][f->corner] = e->triangle;
      }
    }
    for (Index t = 0; t < surface_.triangles.size(); ++t)
      for (int k = 0; k < 3; ++k) bends_[t][k] = bendAt(t, k);
    cell_bytes_.fetch_add(bytesOf(across_, bends_), std::memory_order_relaxed);
  });
}

Index ContactShape::across(Index triangle, int corner) const {
  link();
  return across_[triangle][corner];
}

ContactShape::Bend ContactShape::bend(Index triangle, int corner) const {
  link();
  return bends_[triangle][corner];
}

ContactShape::Bend ContactShape::bendAt(Index triangle, int corner) const {
  const Index other = across_[triangle][corner];
  if (other == kNoIndex) return Bend::kBorder;
  const Facet &f = facets_[triangle], &g = facets_[other];
  const double cosine = f.normal.dot(g.normal);
  if (cosine > kFlatEdge) return Bend::kFlat;
  if (cosine > kGentleEdge) return Bend::kGentle;
  return f.normal.dot(g.centre - f.a) < 0.0 ? Bend::kRidge : Bend::kValley;
}

}  // namespace meshless
