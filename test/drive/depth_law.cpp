#include "drive/depth_law.h"

#include <algorithm>
#include <map>
#include <memory>

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "drive/words.h"

namespace meshless {
namespace {

struct Solid {
  const std::string* name;
  const TriangleMesh* surface;
  Box bounds;
  double diagonal;
  std::unique_ptr<SolidQuery> query;  // once somebody asks
};

void vertexDepth(const Solid& a, Solid& b, Finding& worst) {
  const double allowed = allowedDepth(std::min(a.diagonal, b.diagonal));
  for (const Vec3& p : a.surface->vertices) {
    if (!b.bounds.contains(p)) continue;
    if (!b.query) b.query = std::make_unique<SolidQuery>(*b.surface);
    if (!b.query->contains(p)) continue;
    const double depth = b.query->distance(p);
    worst.take(depth / allowed, words("a vertex of ", *a.name, " is ", 1e3 * depth, " mm inside ", *b.name));
  }
}

}  // namespace

double allowedDepth(double smaller_diagonal) { return std::max(1e-3, 0.01 * smaller_diagonal); }

Finding depthLaw(const Seen& seen) {
  Finding worst;
  std::vector<Solid> solids;
  for (const SeenBody& body : seen.bodies)
    solids.push_back({&body.name, &body.met(), boundsOf(body.met().vertices), body.diagonal, nullptr});
  const std::size_t bodies = solids.size();
  for (const auto& obstacle : seen.obstacles) {
    const Box bounds = boundsOf(obstacle->mesh.vertices);
    solids.push_back({&obstacle->name, &obstacle->mesh, bounds, bounds.diagonal(), nullptr});
  }
  for (std::size_t a = 0; a < bodies; ++a) {
    if (seen.ground)
      for (const Vec3& p : solids[a].surface->vertices)
        if (const double depth = *seen.ground - p.z(); depth > 0.0)
          worst.take(depth / allowedDepth(solids[a].diagonal),
                     words("a vertex of ", *solids[a].name, " is ", 1e3 * depth, " mm below the ground"));
    for (std::size_t b = a + 1; b < solids.size(); ++b) {
      if (!solids[a].bounds.overlaps(solids[b].bounds)) continue;
      vertexDepth(solids[a], solids[b], worst);
      vertexDepth(solids[b], solids[a], worst);
    }
  }
  return worst;
}

}  // namespace meshless
