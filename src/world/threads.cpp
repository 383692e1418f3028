#include <algorithm>
#include <thread>

#include "team.h"
#include "world_impl.h"

namespace meshless {

// No more than there are cores: one that watches for work on the core of one that works takes it away.
ForEach makeForEach(int threads) {
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  if (cores > 0) threads = std::min(threads, cores);
  if (threads <= 1) return oneAfterAnother;
  auto team = std::make_shared<Team>(threads);
  return [team](std::size_t count, const std::function<void(std::size_t)>& work) { team->run(count, work); };
}

}  // namespace meshless
