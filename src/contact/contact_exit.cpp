// The way out of another body.
#include <algorithm>
#include <cmath>
#include <limits>

#include "contacts_impl.h"

namespace meshless {
namespace {

constexpr double kExitTime = 1.0;   // [s] in which one body leaves another
constexpr double kExitDeep = 0.05;  // of the size: how deep the deepest point is at the least
constexpr double kSameShare = 0.8;  // of points inside each other, both ways: bodies at the same place

}  // namespace

// One body is inside another, or both are at the same place: they are moved apart as a whole, along the cheapest way.
bool Contacts::Impl::depenetrateWhole(const std::vector<ShapeCollider>& colliders, const Pair& pair, const Inside& of_a,
                                      const Inside& of_b, double h, ContactCounters& counters) {
  const ShapeCollider &a = colliders[pair.a], &b = colliders[pair.b];
  const PairKey key{a.key, b.key};
  const auto known = exits.find(key);
  const auto wholly = [](const Inside& in, const ShapeCollider& collider) {
    return in.points > 0 && in.inside == in.points && -in.deepest > kExitDeep * collider.shape->size();
  };
  const auto share = [](const Inside& in) {
    return in.points ? static_cast<double>(in.near) / static_cast<double>(in.points) : 0.0;
  };
  if (known == exits.end()) {
    const bool same = share(of_a) >= kSameShare && share(of_b) >= kSameShare;
    if (!wholly(of_a, a) && !wholly(of_b, b) && !same) return false;
  } else if (of_a.inside == 0 && of_b.inside == 0 && of_a.near == 0 && of_b.near == 0) {
    exits.erase(known);
    return false;
  }
  const double part_a = a.moves && a.rigid_share > 0.0 ? 1.0 / a.mass : 0.0;
  const double part_b = b.moves && b.rigid_share > 0.0 ? 1.0 / b.mass : 0.0;
  if (!(part_a + part_b > 0.0)) return false;
  const auto extent = [](const ShapeCollider& collider, const Vec3& d, bool most) {
    double value = -std::numeric_limits<double>::infinity();
    for (const ContactSample& s : collider.shape->samples())
      if (!(s.share > 0.0)) value = std::max(value, (most ? 1.0 : -1.0) * d.dot(vertexAt(collider, s.vertices[0])));
    return value;
  };
  Exit exit{Vec3::UnitZ(), 0.0};
  if (known != exits.end()) {
    exit = known->second;
  } else {
    double least = std::numeric_limits<double>::infinity();
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z) {
          if (!x && !y && !z) continue;
          const Vec3 d = Vec3(x, y, z).normalized();
          // No body leaves into the ground.
          if (scene.ground && ((part_a > 0.0 && d.z() < -0.5) || (part_b > 0.0 && part_a == 0.0 && d.z() > 0.5)))
            continue;
          const double way = extent(b, d, true) + extent(a, d, false);
          if (way < least * (1.0 - 1e-9)) {
            least = way;
            exit = {d, way / kExitTime};
          }
        }
    if (!std::isfinite(least)) return false;
    exit.speed =
        std::clamp(exit.speed, 0.1 * a.shape->size() / kExitTime, 2.0 * std::max(a.shape->size(), b.shape->size()));
    exits[key] = exit;
  }
  ++counters.expelled;
  const Vec3 way = exit.speed * h * exit.direction / (part_a + part_b);
  for (Index i = 0; part_a > 0.0 && i < a.particles; ++i) a.positions[i] += part_a * way;
  for (Index i = 0; part_b > 0.0 && i < b.particles; ++i) b.positions[i] -= part_b * way;
  return true;
}

}  // namespace meshless
