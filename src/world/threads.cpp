#include "world_impl.h"

#include <atomic>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace meshless {

ForEach makeForEach(int threads) {
  if (threads <= 1) return oneAfterAnother;
  auto arena = std::make_shared<tbb::task_arena>(threads);
  return [arena](std::size_t count, const std::function<void(std::size_t)>& work) {
    if (count < 2) return oneAfterAnother(count, work);
#ifdef __SANITIZE_THREAD__
    // oneTBB is not instrumented: what it hands over from thread to thread is said here once more.
    std::atomic<bool> begun{false}, done{false};
    begun.store(true, std::memory_order_release);
    const auto told = [&](std::size_t n) {
      if (begun.load(std::memory_order_acquire)) work(n);
      done.exchange(true, std::memory_order_acq_rel);
    };
    arena->execute([&] { tbb::parallel_for(std::size_t{0}, count, told); });
    static_cast<void>(done.load(std::memory_order_acquire));
#else
    arena->execute([&] { tbb::parallel_for(std::size_t{0}, count, work); });
#endif
  };
}

}  // namespace meshless
