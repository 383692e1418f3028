#include "drive/finite_law.h"

#include <cmath>
#include <limits>

#include "drive/words.h"

namespace meshless {

Finding finiteLaw(const Seen& seen) {
  constexpr double kBroken = std::numeric_limits<double>::infinity();
  Finding worst;
  if (seen.mended > 0) worst.take(kBroken, words(seen.mended, " bodies were not finite and began anew"));
  for (const SeenBody& body : seen.bodies) {
    bool finite = body.particles_finite && std::isfinite(body.mass) && std::isfinite(body.kinetic_energy) &&
                  body.centre.allFinite() && body.linear_momentum.allFinite() && body.angular_momentum.allFinite();
    double reach = body.centre.norm();
    for (const Vec3& p : body.surface.vertices) {
      finite = finite && p.allFinite();
      reach = std::max(reach, p.norm());
    }
    if (!finite) worst.take(kBroken, body.name + " is not finite");
    worst.take(reach / kReach, words(body.name, " reaches to ", reach, " m"));
  }
  return worst;
}

}  // namespace meshless
