// What threads hand over to each other, for ThreadSanitizer.
#pragma once

#include <atomic>

namespace meshless {

/// oneTBB is not instrumented: what its loops hand over from thread to thread is said here once more. Made before the
/// loop, whose tasks go through run(), and told of its end by finish(). Without ThreadSanitizer it does nothing.
class HandOver {
 public:
#ifdef __SANITIZE_THREAD__
  HandOver() { begun_.store(true, std::memory_order_release); }
  template <class Task>
  void run(const Task& task) {
    if (begun_.load(std::memory_order_acquire)) task();
    done_.exchange(true, std::memory_order_acq_rel);
  }
  void finish() { static_cast<void>(done_.load(std::memory_order_acquire)); }

 private:
  std::atomic<bool> begun_{false}, done_{false};
#else
  template <class Task>
  void run(const Task& task) {
    task();
  }
  void finish() {}
#endif
};

}  // namespace meshless
