#include "stillness.h"

#include <algorithm>

namespace meshless {
namespace {

constexpr std::chrono::seconds kStillPeriod{1};

const Points& placesOf(const BodySnapshot& body, bool particles) { return particles ? body.particles : body.surface; }

}  // namespace

bool Stillness::isSaid(const WorldSnapshot& snapshot, bool particles) const {
  return std::equal(bodies_.begin(), bodies_.end(), snapshot.bodies.begin(), snapshot.bodies.end(),
                    [&](const Body& said, const BodySnapshot& body) {
                      return said.number == body.number && said.model == body.model && said.asleep == body.asleep &&
                             said.places == placesOf(body, particles);
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
