#include "drive/momentum_law.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "drive/words.h"

namespace meshless {
namespace {

constexpr double kCutRounding = 1e-6;
constexpr double kFallRounding = 1e-3;
constexpr double kStill = 1e-4;  // [m/s] a momentum of less than this for the whole mass is rounding's

struct Totals {
  double mass = 0.0, size = 0.0;
  double moving = 0.0;  // [kg m/s] sum of mass times root mean square speed
  Vec3 centre = Vec3::Zero(), linear = Vec3::Zero(), angular = Vec3::Zero();  // angular: about centre
};

Totals totalsOf(const Seen& seen) {
  Totals sum;
  for (const SeenBody& body : seen.bodies) {
    sum.mass += body.mass;
    sum.centre += body.mass * body.centre;
    sum.linear += body.linear_momentum;
    sum.moving += body.mass * body.speed();
    sum.size = std::max(sum.size, body.diagonal);
  }
  sum.centre /= sum.mass;
  for (const SeenBody& body : seen.bodies) {
    sum.angular += body.angular_momentum + (body.centre - sum.centre).cross(body.linear_momentum);
    sum.size = std::max(sum.size, (body.centre - sum.centre).norm());
  }
  return sum;
}

}  // namespace

Finding cutMomentumLaw(const Seen& before, const Seen& after) {
  Finding worst;
  if (before.bodies.empty()) return worst;
  const Totals a = totalsOf(before), b = totalsOf(after);
  const double allowed = kCutRounding * (a.moving + kStill * a.mass);
  const double linear = (b.linear - a.linear).norm(), angular = (b.angular - a.angular).norm();
  worst.take(linear / allowed, words("a cut gave ", linear, " kg m/s to what had ", a.moving));
  worst.take(angular / (allowed * a.size), words("a cut gave ", angular, " kg m^2/s to what had ", a.moving * a.size));
  return worst;
}

bool fallsFreely(const Seen& seen, double seconds) {
  for (const SeenBody& body : seen.bodies) {
    if (body.handled || body.fixed || body.surface.empty()) return false;
    // Parts of it may be faster than it is on the mean.
    const double way = 4.0 * body.speed() * seconds + seen.gravity.norm() * seconds * seconds + 0.05 * body.diagonal;
    Box reach = boundsOf(body.surface.vertices);
    reach.min.array() -= way;
    reach.max.array() += way;
    if (seen.ground && !(reach.min.z() > *seen.ground)) return false;
    for (const auto& obstacle : seen.obstacles)
      if (reach.overlaps(boundsOf(obstacle->mesh.vertices))) return false;
  }
  return !seen.bodies.empty();
}

Finding freeFallLaw(const Seen& before, const Seen& after) {
  Finding worst;
  const Totals a = totalsOf(before), b = totalsOf(after);
  const double seconds = after.time - before.time;
  const Vec3 weight = seconds * a.mass * before.gravity;
  const double allowed = kFallRounding * (weight.norm() + a.moving + b.moving + kStill * a.mass);
  const double linear = (b.linear - a.linear - weight).norm(), angular = (b.angular - a.angular).norm();
  worst.take(linear / allowed, words("a free fall of ", seconds, " s was off by ", linear, " kg m/s"));
  worst.take(angular / (allowed * a.size), words("a free fall of ", seconds, " s gave ", angular, " kg m^2/s"));
  return worst;
}

}  // namespace meshless
