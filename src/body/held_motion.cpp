#include "meshless_surgery/body/held_motion.h"

namespace meshless {

void HeldMotion::advance(double h) {
  if (!(left > h)) {
    now = target;
    left = 0.0;
    return;
  }
  const double share = h / left;
  now.translation += share * (target.translation - now.translation);
  now.rotation = now.rotation.slerp(share, target.rotation).normalized();
  left -= h;
}

}  // namespace meshless
