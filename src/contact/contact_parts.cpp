// Queries in parts that threads share.
#include "contacts_impl.h"

namespace meshless {
namespace {

constexpr Index kPartSamples = 1024;     // points of a part
constexpr std::size_t kMostParts = 64;   // of a task
constexpr std::size_t kLeastTasks = 16;  // where there are parts enough

}  // namespace

void Inside::add(const Inside& other) {
  points += other.points;
  asked += other.asked;
  inside += other.inside;
  near += other.near;
  deepest = std::min(deepest, other.deepest);
}

void QueryParts::add(const std::vector<ShapeCollider>& colliders, const Pair& pair, Index number) {
  if (pair.a == pair.b) {
    parts_.push_back({number, false, 0, 0, {}});
    return;
  }
  for (const bool second : {false, true}) {
    const Index count = samplesFor(pair, *colliders[second ? pair.b : pair.a].shape);
    for (Index first = 0; first == 0 || first < count; first += kPartSamples)
      parts_.push_back({number, second, first, std::min(count, first + kPartSamples), {}});
  }
}

std::size_t QueryParts::perTask() const { return std::clamp<std::size_t>(parts_.size() / kLeastTasks, 1, kMostParts); }

}  // namespace meshless
