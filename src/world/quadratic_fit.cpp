#include "meshless_surgery/world/quadratic_fit.h"

namespace meshless {

void fitQuadraticMaps(const MatchInput& in, const Vec3* positions, std::vector<ContactMap>& maps,
                      std::vector<QuadraticMap>& quadratics) {
  quadratics.resize(maps.size());
  for (Index c = 0; c < maps.size(); ++c) {
    const ClusterRest& rest = in.shape.clusters[c];
    if (!rest.quadratic_rank) continue;
    const QuadraticRest& from = in.shape.quadratic[c];
    QuadraticMap& map = quadratics[c];
    map.mean = from.mean;
    map.rest = rest.centre;
    map.centre = maps[c].centre;
    map.scale = rest.radius;
    Mat39 moment = Mat39::Zero();
    for (Index k = in.clusters.offsets[c]; k < in.clusters.offsets[c + 1]; ++k) {
      const Index i = in.clusters.members[k];
      const QuadraticMap::Basis b = QuadraticMap::basis((in.rest[i] - rest.centre) / rest.radius) - from.mean;
      moment += (in.masses[i] * in.clusters.weights[k]) * (positions[i] - maps[c].centre) * b.transpose();
    }
    map.fit = moment * from.moment_inverse;
    if (map.fit.allFinite()) maps[c].quadratic = &map;
  }
}

}  // namespace meshless
