#include "meshless_surgery/body/face_contact.h"

#include "meshless_surgery/geometry/nearest_on_triangle.h"

namespace meshless {

std::size_t pushFaces(const BodyModel& model, const Vec3& centre, double radius, BodyState& state,
                      const std::function<void(Index particle, const Vec3& shift)>& moved) {
  const std::vector<Index>& particle_of = model.binding.particle;
  Points& x = state.positions;
  std::size_t pushed = 0;
  for (const Triangle& t : model.surface.triangles) {
    const Index i[3] = {particle_of[t[0]], particle_of[t[1]], particle_of[t[2]]};
    if (i[0] == kNoIndex || i[1] == kNoIndex || i[2] == kNoIndex)
      continue;  // the places of embedded vertices are unknown
    const Vec3 &a = x[i[0]], &b = x[i[1]], &c = x[i[2]];
    if (((a.cwiseMin(b).cwiseMin(c) - centre).array() >= radius).any() ||
        ((centre - a.cwiseMax(b).cwiseMax(c)).array() >= radius).any())
      continue;
    const Vec3 weights = nearestWeights(centre, a, b, c);
    const Vec3 outwards = weights.x() * a + weights.y() * b + weights.z() * c - centre;
    const double distance = outwards.norm();
    // At the centre itself no direction is meant; the vertices' contact decides there.
    if (!(distance < radius) || !(distance > 1e-12 * radius)) continue;
    double mobility = 0.0;  // [1/kg]
    for (int k = 0; k < 3; ++k)
      if (!model.fixed[i[k]]) mobility += weights[k] * weights[k] / model.masses[i[k]];
    if (!(mobility > 0.0)) continue;
    const Vec3 pull = (radius - distance) / (distance * mobility) * outwards;
    ++pushed;
    for (int k = 0; k < 3; ++k) {
      if (model.fixed[i[k]] || !(weights[k] > 0.0)) continue;
      const Vec3 shift = weights[k] / model.masses[i[k]] * pull;
      x[i[k]] += shift;
      moved(i[k], shift);
    }
  }
  return pushed;
}

}  // namespace meshless
