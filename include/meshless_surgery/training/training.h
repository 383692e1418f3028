// A task that is being done: its stages, its metrics, and what a report needs. It begins with the first frame, and anew
// with each reset of the world; once the task is over, done or failed, nothing changes any more.
#pragma once

#include "meshless_surgery/training/task.h"

namespace meshless {

/// A moment, for the line of time.
struct TrainingMoment {
  double time = 0.0;                              // [s] since the start
  double force = 0.0;                             // [N] the largest since the moment before
  std::array<double, kHands> speed{};             // [m/s] mean since the moment before
  std::array<std::optional<Vec3>, kHands> place;  // [m]
};

struct TrainingEvent {
  double time = 0.0;  // [s] since the start
  std::string text;
  bool error = false;  // something that should not happen
};

class Training {
 public:
  /// `after`: another run of it came before.
  explicit Training(TaskDef task, bool after = false);
  Training(const Training&) = delete;
  Training& operator=(const Training&) = delete;

  /// What the next frame should have.
  FrameWants wants() const;
  /// Refuses kUnknownName, and stays as it was, where the first frame lacks a body of the task.
  Status feed(TrainingFrame frame);
  /// The task is over, whatever was reached: what comes later is not looked at.
  void stop();

  const TaskDef& task() const { return task_; }
  bool begun() const { return begun_; }
  /// The scene comes to rest, and the task begins after that, or when the trainee does something.
  bool settling() const { return begun_ && now_->settling; }
  bool over() const { return stopped_ || now_->progress.over(); }
  const TaskProgress& progress() const { return now_->progress; }
  const Metrics& metrics() const { return now_->metrics; }
  const RestTissue& tissue() const { return now_->tissue; }
  const std::vector<TrainingMoment>& moments() const { return now_->moments; }
  const std::vector<TrainingEvent>& events() const { return now_->events; }
  const Points& outline() const { return now_->outline; }  // [m] some points of the tissue at rest
  std::uint64_t firstStep() const { return now_->first_step; }
  std::uint64_t lastStep() const { return now_->last_step; }
  std::uint32_t run() const { return run_; }             // of the world
  double startedAt() const { return now_->started_at; }  // [s] since 1970; NaN where nobody watched
  /// There is something to report: a hand was there, or tissue was cut, or it is over.
  bool tried() const;

  std::vector<MetricValue> values() const { return metrics().values(tissue(), progress().stage()); }
  /// 0..100: of those metrics that count, 0 until all stages were met; the share of the stages where none do. 0 where
  /// it does not count.
  double score() const;
  /// All stages were met, every metric reaches what it must, and the score the pass mark; and it counts.
  bool passed() const;
  /// What was done that no hand of a trainee does, and the task does not allow: sentences. Empty: it counts.
  std::vector<std::string> notCounted() const;
  /// Likewise, by what does not show in the world. Nothing before the task was begun.
  void intervened(Intervention intervention, const std::string& what);

 private:
  struct Now {
    explicit Now(const TaskDef& task);
    Metrics metrics;
    RestTissue tissue;
    TaskProgress progress;
    std::vector<TrainingMoment> moments;
    std::vector<TrainingEvent> events;
    Points outline;
    std::map<std::uint32_t, Vec3> rests;  // [m] where instruments lie
    TrainingMoment next;                  // being summed up
    std::array<double, kHands> paths{};
    std::uint64_t first_step = 0, last_step = 0;
    double since = 0.0;
    double started_at = std::numeric_limits<double>::quiet_NaN();
    bool settling = false;
    double settled = 0.0;             // [s]
    std::uint64_t first_command = 0;  // what has this number is of the scene
    std::map<Intervention, std::string> interventions;
  };
  void noteInterventions(const TrainingFrame& frame);
  Status begin(const TrainingFrame& frame);
  void note(const TrainingFrame& frame, std::size_t stage_before);

  TaskDef task_;
  bool separates_ = false;  // what tears is then the task, and no error
  bool after_ = false, begun_ = false, stopped_ = false;
  std::uint32_t run_ = 0;
  std::unique_ptr<Now> now_;
};

}  // namespace meshless
