#include "drive/crossing_law.h"

#include <algorithm>

#include "drive/depth_law.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "drive/words.h"

namespace meshless {
namespace {

constexpr double kCrossed = 1e-3;  // of all edges

struct Surface {
  const std::string* name;
  const TriangleMesh* mesh;
  Box bounds;
  double diagonal;
};

Box boxOf(const Vec3& p, const Vec3& q) {
  Box box;
  box.extend(p);
  box.extend(q);
  return box;
}

constexpr int kSteps = 16;  // along an edge

/// How deep any of the places between two ends is inside [m].
double depthOf(const Vec3& p, const Vec3& q, const SolidQuery& solid) {
  double deepest = 0.0;
  for (int n = 1; n < kSteps; ++n) {
    const Vec3 at = p + (q - p) * n / kSteps;
    if (solid.contains(at)) deepest = std::max(deepest, solid.distance(at));
  }
  return deepest;
}

std::size_t crossings(const Surface& a, const Surface& b) {
  const double allowed = allowedDepth(std::min(a.diagonal, b.diagonal));
  std::vector<std::array<Index, 2>> edges;
  for (const Triangle& t : a.mesh->triangles)
    for (int k = 0; k < 3; ++k) {
      const Index v = t[k], w = t[(k + 1) % 3];
      if (v < w && boxOf(a.mesh->vertices[v], a.mesh->vertices[w]).overlaps(b.bounds)) edges.push_back({v, w});
    }
  if (edges.empty()) return 0;
  const SolidQuery query(*b.mesh);
  return static_cast<std::size_t>(std::count_if(edges.begin(), edges.end(), [&](const std::array<Index, 2>& edge) {
    const Vec3 &p = a.mesh->vertices[edge[0]], &q = a.mesh->vertices[edge[1]];
    return query.crosses(p, q) && depthOf(p, q, query) > allowed;
  }));
}

}  // namespace

Finding crossingLaw(const Seen& seen) {
  std::vector<Surface> surfaces;
  for (const SeenBody& body : seen.bodies)
    surfaces.push_back({&body.name, &body.met(), boundsOf(body.met().vertices), body.diagonal});
  const std::size_t bodies = surfaces.size();
  for (const auto& obstacle : seen.obstacles) {
    const Box bounds = boundsOf(obstacle->mesh.vertices);
    surfaces.push_back({&obstacle->name, &obstacle->mesh, bounds, bounds.diagonal()});
  }
  std::size_t sum = 0, most = 0, edges = 0;
  std::string where;
  for (std::size_t a = 0; a < bodies; ++a) edges += 3 * surfaces[a].mesh->triangles.size() / 2;
  for (std::size_t a = 0; a < bodies; ++a)
    for (std::size_t b = a + 1; b < surfaces.size(); ++b) {
      if (!surfaces[a].bounds.overlaps(surfaces[b].bounds)) continue;
      const std::size_t count = crossings(surfaces[a], surfaces[b]) + crossings(surfaces[b], surfaces[a]);
      sum += count;
      if (count <= most) continue;
      most = count;
      where = *surfaces[a].name + " and " + *surfaces[b].name;
    }
  Finding worst;
  if (sum > 0)
    worst.take(static_cast<double>(sum) / (kCrossed * static_cast<double>(edges)),
               words(sum, " of ", edges, " edges go through faces, most of ", where));
  return worst;
}

}  // namespace meshless
