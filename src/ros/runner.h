// The thread that owns the World: steps it at its rate and does what others ask for between two steps, paused or not.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <future>
#include <limits>
#include <memory>
#include <mutex>
#include <thread>

#include "clock.h"
#include "meshless_surgery/world/world.h"
#include "progress.h"

namespace meshless {

struct RunnerSettings {
  bool paused = false;       // at the start
  double max_backlog = 0.1;  // [s] that are caught up with at most; what is beyond is dropped, and counted
};

struct RunnerStatus {
  bool paused = false;
  std::string fault;              // why a step that failed has paused the world; empty: it did not, or runs again
  std::uint64_t steps = 0;        // done by this runner, over resets
  double step_rate = 0.0;         // [Hz] done, last second
  double real_time_factor = 0.0;  // simulated over wall time, last second
  double mean_step = 0.0;         // [s] last second
  double worst_step = 0.0;        // [s] last second
  std::uint64_t overruns = 0;     // steps that took longer than they simulate
  double dropped = 0.0;           // [s] of simulated time that was not caught up with
};

class WorldRunner {
 public:
  using Job = std::function<void(World&)>;
  static constexpr int kMostClosing = 16;  // cuts that wait for their blades at once
  using EventSink = std::function<void(std::vector<Event>)>;

  /// Steps are paced by `clock`, which outlives it and must not be one that they move themselves. What they cost is
  /// measured on the wall.
  WorldRunner(std::unique_ptr<World> world, const RunnerSettings& settings, const Clock& clock);
  ~WorldRunner();
  WorldRunner(const WorldRunner&) = delete;
  WorldRunner& operator=(const WorldRunner&) = delete;

  /// Called on the runner's thread: must only put the events aside. To be set before start.
  void setEventSink(EventSink sink) { event_sink_ = std::move(sink); }
  /// Called on the runner's thread after every step and its events, with what it simulated [s], and with 0 after every
  /// job that may have changed the world: must be fast, and only look. A step fails where it throws. To be set before
  /// start.
  using StepSink = std::function<void(World&, double)>;
  void setStepSink(StepSink sink) { step_sink_ = std::move(sink); }
  /// What a step is, instead of World::step; false: there is none, and the world is paused. To be set before start.
  using Step = std::function<bool(World&)>;
  void setStep(Step step) {
    step_ = std::move(step);
    says_time_ = false;
  }
  /// [1] of simulated time over the clock's; above 0.
  void setSpeed(double speed) { speed_ = speed; }
  void start();
  /// Ends the thread; whoever waits gets kFailed.
  void stop();

  /// Of the world as it is now: a loaded state brings its own.
  WorldSettings worldSettings() const;

  // Each of these returns when its effect is in force; kFailed once stopped. Not to be called from within a job.
  // Those with `progress` say there how far they are. Where it was cancelled before they had begun nothing is done, and
  // the answer is kFailed.
  Result<Reply> apply(const Command& command, Progress* progress = nullptr);
  /// Waits until the blades met. While paused they meet at once, as time stands still: close_time is then not used.
  /// kFailed where kMostClosing others wait already. Blades that are closing can be cancelled.
  struct CutAnswer {
    CutReply reply;
    bool closed_at_once = false;  // though a close time was asked for
  };
  Result<CutAnswer> cut(CutCommand command, Progress* progress = nullptr);
  /// Steps without pacing, paused or not; the simulated time after them [s]. Can be cancelled between two of them.
  Result<double> doSteps(std::uint64_t count, Progress* progress = nullptr);
  /// Looks for closing blades and steps whose progress was cancelled meanwhile, and ends them. Does not wait.
  void endCancelled();
  /// The number of the step that is the next one.
  Result<std::uint64_t> setPaused(bool paused);
  /// Closing blades and steps that are being done are given up: their callers get kFailed.
  Status reset();
  /// Becomes the saved state, as reset() does; `then` is done before anything else is.
  Status restore(std::shared_ptr<const SavedWorld> saved, const Job& then);
  /// A job that makes another state of the world, as restore() does.
  Status change(const Job& job);
  /// A job that only reads.
  Status look(const Job& job);
  std::shared_ptr<const WorldSnapshot> snapshot(const SnapshotWants& wants);  // null once stopped

  /// Does not wait; for streams.
  void post(Job job);

  RunnerStatus status() const;
  /// Grows with every step and every job that may have changed the world.
  std::uint64_t revision() const { return revision_.load(); }
  /// Grows with those of them that somebody waits for: not with steps by the clock, nor with streams.
  std::uint64_t commands() const { return commands_.load(); }

 private:
  struct Waiting {  // a caller
    std::promise<Status> done;
    Job job;
    bool changes = true;
    bool waited_for = true;
  };
  struct ClosingCut {
    std::uint32_t ticket = 0;
    std::promise<Result<CutReply>> done;
    Progress* progress = nullptr;  // or null; lives until `done` is set
    double begin = 0.0;            // [s] simulated
    double close_time = 0.0;       // [s]
  };
  struct OwedSteps {
    std::uint64_t total = 0, left = 0;
    std::promise<Result<double>> done;
    Progress* progress = nullptr;  // as above
    std::string doneSoFar() const;
  };

  Status run(Job job, bool changes);
  void loop();
  void doJobs();
  void stepOnce(bool paced);
  void sayTime(bool paced);
  void pauseAtEnd();
  void tellCuts();
  void answerCuts();
  void giveUp(const std::string& why);
  void handOverEvents();
  void sleepUntil(double due);
  void record(double step_time);
  void fail(const std::string& what);
  void mended();

  std::unique_ptr<World> world_;
  double dt_;  // [s]
  RunnerSettings settings_;
  const Clock& clock_;
  EventSink event_sink_;
  StepSink step_sink_;
  Step step_ = [](World& world) {
    world.step();
    return true;
  };
  std::atomic<double> speed_{1.0};

  // of the runner's thread alone
  std::deque<ClosingCut> closing_;
  std::deque<OwedSteps> owed_;
  bool paused_ = false;
  double due_ = 0.0;       // [s] when the next step is; now at the start, after a pause and after a reset
  bool says_time_ = true;  // World::setWallTime, of its own steps
  double epoch_ = 0.0;     // [s] since 1970, of the steady clock's zero
  double said_time_ = std::numeric_limits<double>::quiet_NaN();  // [s] since 1970
  std::vector<Event> own_events_;
  double last_over_budget_ = -1e300;

  mutable std::mutex jobs_mutex_;
  std::condition_variable jobs_changed_;
  std::deque<std::shared_ptr<Waiting>> jobs_;
  bool stopping_ = false;
  bool stopped_ = false;

  struct Sample {
    double wall, sim, step;  // [s]
  };
  mutable std::mutex status_mutex_;
  WorldSettings world_settings_;
  std::deque<Sample> samples_;  // of the last second
  RunnerStatus status_;
  double started_ = 0.0;

  std::atomic<std::uint64_t> revision_{0}, commands_{0};
  std::thread thread_;
};

}  // namespace meshless
