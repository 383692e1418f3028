// Threads that stand by: a loop of some microseconds is shared out, which a task graph would not be worth.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace meshless {

/// The threads watch for work for a while, and sleep where none comes. Who calls takes part, and waits for none that
/// has not begun: where other programs have the cores, it does all of it.
class Team {
 public:
  /// threads: with the one that calls, at least 2.
  explicit Team(int threads);
  ~Team();
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;

  /// work(0) .. work(count - 1), on any of them; returns when all are done, and throws what the
  /// first of them threw. Within such work it is a plain loop. One
  /// caller at a time; others' loops are plain.
  void run(std::size_t count, const std::function<void(std::size_t)>& work);

  std::uint64_t shared() const { return shared_; }  // loops that were offered to the others

 private:
  void standBy(std::size_t who);
  void take(std::size_t who);

  // Of an offer: its number, whether it still stands, and how many of the others are at it.
  static constexpr std::uint64_t kOpen = 1u << 16, kNext = 1u << 17, kInside = kOpen - 1;
  alignas(64) std::atomic<std::uint64_t> offer_{0};
  /// Each has a part of its own, the same in every loop of that length, so that what it is about stays in its cache;
  /// who is done goes on with those of others.
  struct alignas(64) Part {
    std::atomic<std::size_t> next{0};
    std::size_t end = 0;
  };
  std::vector<Part> parts_;  // the first is the caller's
  alignas(64) const std::function<void(std::size_t)>* work_ = nullptr;
  std::size_t grain_ = 1;
  std::uint64_t shared_ = 0;
  std::atomic<bool> busy_{false}, faulted_{false};
  std::exception_ptr fault_;  // the first
  std::atomic<int> asleep_{0};
  std::atomic<bool> end_{false};
  std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<std::thread> others_;
};

}  // namespace meshless
