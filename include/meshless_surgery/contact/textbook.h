// The paper's contact: particles against tetrahedra through a spatial hash (Teschner et al. 2003), consistent
// penetration depth and direction (Heidelberger et al. 2004), and a projection that keeps momentum. A scene chooses it
// as `contact: textbook`.
#pragma once

#include "meshless_surgery/contact/deformable.h"

namespace meshless {

/// A particle of body `a` inside body `b`.
struct Penetration {
  Index body_a = 0, particle = 0;
  Index body_b = 0, tetrahedron = 0;
  std::array<double, 4> weights{};    // barycentric in the tetrahedron
  double depth = 0.0;                 // [m] >= 0
  Vec3 direction = Vec3::Zero();      // unit: where the particle must go to get out
};

/// Finds every penetration between different bodies whose bounds overlap; ordered by body and particle.
std::vector<Penetration> findPenetrations(const std::vector<ContactBody>& bodies, ContactCounters& counters);

/// Moves particle and tetrahedron apart along the direction until the depth is gone, at most max_correction [m] for one
/// contact; shares the motion by inverse mass, so that the impulses are equal and opposite; then friction on the
/// motion of this substep within Coulomb's cone.
void resolvePenetrations(const std::vector<Penetration>& penetrations, std::vector<ContactBody>& bodies,
                         double max_correction, ContactCounters& counters);

}  // namespace meshless
