// Long work as who asked for it sees it: how far it is, and the wish that it ends. Shared by the threads that do it.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>

namespace meshless {

class Progress {
 public:
  enum class Phase { kWaiting, kReading, kPreparing, kAdding, kClosing, kCutting, kStepping };

  Progress() = default;
  virtual ~Progress() = default;
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Says how far it is. Called by the thread that waits for the work, now and then: may take a while.
  virtual void tell() {}

  // --- who asked
  /// Wishes that it ends. True where it has not begun: then nothing will be done, and the caller is to answer.
  bool cancel();
  bool cancelled() const;

  // --- who works
  /// Before the world is changed. False, and so it ended, where it was cancelled: then nothing may be done.
  bool begin();
  /// Before the answer. False where cancel() has left that to another one.
  bool finish();
  /// It was given up because it was cancelled.
  void end() { ended_ = true; }
  bool ended() const { return ended_; }

  void enter(Phase phase) { phase_ = phase; }
  Phase phase() const { return phase_; }
  /// The share of the way that the blades have closed.
  void close(double share) { closed_ = share; }
  double closed() const { return closed_; }
  /// Steps done in all, and the simulated time after them [s].
  void step(std::uint64_t done, double sim_time) {
    sim_time_ = sim_time;
    steps_done_ = done;
  }
  std::uint64_t stepsDone() const { return steps_done_; }
  double simTime() const { return sim_time_; }

 private:
  mutable std::mutex mutex_;
  bool begun_ = false, cancelled_ = false;
  std::atomic<bool> ended_{false};
  std::atomic<Phase> phase_{Phase::kWaiting};
  std::atomic<double> closed_{0.0}, sim_time_{0.0};
  std::atomic<std::uint64_t> steps_done_{0};
};

}  // namespace meshless
