#include "stillness.h"

#include <algorithm>

namespace meshless {
namespace {

constexpr std::chrono::seconds kStillPeriod{1};
constexpr double kNoMotion = 1e-9;  // [m] the rounding of a body that floats at rest

const Points& placesOf(const BodySnapshot& body, bool particles) { return particles ? body.particles : body.surface; }

bool alike(const Points& said, const Points& now) {
  return std::equal(said.begin(), said.end(), now.begin(), now.end(),
                    [](const Vec3& a, const Vec3& b) { return (a - b).cwiseAbs().maxCoeff() <= kNoMotion; });
}

}  // namespace

bool Stillness::isSaid(const WorldSnapshot& snapshot, bool particles) const {
  return std::equal(bodies_.begin(), bodies_.end(), snapshot.bodies.begin(), snapshot.bodies.end(),
                    [&](const Body& said, const BodySnapshot& body) {
                      return said.number == body.number && said.model == body.model && said.asleep == body.asleep &&
                             alike(said.places, placesOf(body, particles));
                    });
}

bool Stillness::news(const WorldSnapshot& snapshot, bool particles, const meshless_surgery::Surfaces& tools,
                     std::uint64_t commands, Clock::time_point now) {
  if (now < until_ && commands == commands_ && tools == tools_ && isSaid(snapshot, particles)) return false;
  bodies_.clear();
  for (const BodySnapshot& body : snapshot.bodies)
    bodies_.push_back({body.number, body.model, body.asleep, placesOf(body, particles)});
  tools_ = tools;
  commands_ = commands;
  until_ = now + kStillPeriod;
  return true;
}

}  // namespace meshless
