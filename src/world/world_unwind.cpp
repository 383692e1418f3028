// Bodies that rest wound up in themselves are led back to their shape once nobody holds them: a trainee who has let go
// of a body that was dragged through itself would have to reset it.
#include <algorithm>

#include "meshless_surgery/body/unwind.h"
#include "world_impl.h"

namespace meshless {

// What holds a body may hold it folded: then that is its shape. The ground, others, obstacles, picks and the push
// sphere.
void World::Impl::findWound() {
  for (WorldBody* body : awake)
    if (body->state.unwinding || isWoundUp(*body->model, body->material, body->state)) wound.push_back(body);
  if (wound.empty()) return;
  listLoaded();
  for (WorldBody* body : wound) {
    const auto is = [&](Index b) { return b < bodies.size() && bodies[b].get() == body; };
    const bool touched = std::any_of(loaded.begin(), loaded.end(), [&](const auto& pair) {
      return pair.first != pair.second && (is(pair.first) || is(pair.second));
    });
    const bool picked = std::any_of(picks.begin(), picks.end(), [&](const Pick& p) { return p.body == body->id; });
    const bool free = !touched && !picked && !body->touched_by_push;
    // Another material may have come with what does not suit.
    body->state.unwinding = free && !body->material.plastic() && body->state.eased.empty();
    report.unwinding += body->state.unwinding;
  }
  wound.clear();
}

}  // namespace meshless
