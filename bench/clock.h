// Wall time.
#pragma once

#include <chrono>

namespace meshless::bench {

/// [s] since some fixed moment.
inline double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace meshless::bench
