#include "drive/rest_law.h"

#include "drive/words.h"

namespace meshless {
namespace {

constexpr double kRest = 0.01;  // [1/s] of its size

}  // namespace

Finding restLaw(const Seen& seen) {
  Finding worst;
  for (const SeenBody& body : seen.bodies)
    worst.take(body.speed() / (kRest * body.diagonal), words(body.name, " moves at ", 1e3 * body.speed(), " mm/s"));
  return worst;
}

Finding asleepLaw(const Seen& seen) {
  std::size_t awake = 0;
  std::string first;
  for (const SeenBody& body : seen.bodies) {
    if (body.asleep) continue;
    if (awake++ == 0) first = body.name;
  }
  Finding worst;
  if (awake > 0)
    worst.take(1.0 + static_cast<double>(awake),
               words(awake, " of ", seen.bodies.size(), " bodies are awake: ", first, awake > 1 ? " ..." : ""));
  return worst;
}

}  // namespace meshless
