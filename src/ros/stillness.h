// What a topic has published last: while nothing of it moves it is published once a second.
#pragma once

#include <chrono>
#include <cstdint>
#include <vector>

#include <meshless_surgery/Surfaces.h>

#include "meshless_surgery/world/world.h"

namespace meshless {

class Stillness {
 public:
  using Clock = std::chrono::steady_clock;

  /// Whether there is something new since it said so last: bodies (their surfaces, or `particles` in place of these) or
  /// tools are elsewhere, commands were done, or a second has passed. `tools`: a message without bodies and header.
  bool news(const WorldSnapshot& snapshot, bool particles, const meshless_surgery::Surfaces& tools,
            std::uint64_t commands, Clock::time_point now);

 private:
  struct Body {
    std::uint32_t number = 0;
    BodyModelPtr model;
    bool asleep = false;
    Points places;
  };
  bool isSaid(const WorldSnapshot& snapshot, bool particles) const;

  std::vector<Body> bodies_;
  meshless_surgery::Surfaces tools_;
  std::uint64_t commands_ = 0;
  Clock::time_point until_{};
};

}  // namespace meshless
