// A task: what is to be done, stage by stage, within which limits, and what counts. A file says it (io/task.h).
#pragma once

#include <variant>

#include "meshless_surgery/training/metrics.h"

namespace meshless {

// Conditions of a stage.

/// A hand of that tool is in the region of the world.
struct Reach {
  ToolKind tool = ToolKind::kPick;
  Region region;
};
/// A pick of the body holds its tissue that far from where it was when it was grabbed.
struct StretchTo {
  std::string body;
  double distance = 0.0;  // [m] > 0
};
/// The push sphere presses, or a pick pulls, at least so hard, in the region of the world if there is one.
struct PressTo {
  ToolKind tool = ToolKind::kPush;
  double force = 0.0;  // [N] > 0
  std::optional<Region> region;
  bool touch = false;  // in the region is the place where the tissue is touched; else the middle of the tool
};
/// A cut has come within the plan's tolerance of that share of the plan.
struct CutAlong {
  double share = 0.9;  // above 0 to 1
};
/// No attachment joins them any more.
struct Separate {
  std::string a, b;
};
/// The piece that has the target's middle lies in the task's tray, or was removed.
struct RemoveToTray {};
/// Of the target there is no more than that share left.
struct LeaveNothing {
  double share = 0.05;  // 0 to below 1
};
/// Every pick is let go of, and the push sphere is gone.
struct LetGo {};
/// A clip is on the body, or on a piece of it; the middle of its jaws in the rest shape is in the region, if there is
/// one.
struct Clipped {
  std::string body;
  std::optional<Region> region;
};
/// So many picks hold the body, or pieces of it, by tissue that is in the region of the world if there is one.
struct Hold {
  std::string body;
  int picks = 1;  // 1 to 10, at least
  std::optional<Region> region;
};
/// One pick alone holds the body, and took it over from another: both held it when that one let go.
struct HandOver {
  std::string body;
};
/// The centre of mass of the body, or of its pieces, is so near to where it was when the task began.
struct PutBack {
  std::string body;
  double distance = 0.0;  // [m] > 0
};

/// Each of the bodies is on one of the obstacles (isAround()), no two on one, and no hand holds one of them.
struct PutOn {
  std::vector<std::string> bodies, obstacles;
  bool handed_over = false;  // and each came there by a hand that took it over from another one in the air
};

/// An endoscope shows the body: its middle is so near to that of the picture, nothing is in front of it, and it is
/// neither too far nor too near. A body that was cut is not seen.
struct See {
  std::string body;
  double off_centre = 0.3;  // above 0 to 1, of the way from the middle of the picture to its rim; at most
  double fills_least = 0.05, fills_most = 1.0;  // of the width of the picture
};

using Condition = std::variant<Reach, StretchTo, PressTo, CutAlong, Separate, RemoveToTray, LeaveNothing, LetGo,
                               Clipped, Hold, HandOver, PutBack, PutOn, See>;

struct Stage {
  std::string name, brief;
  Condition condition;
  double hold_for = 0.0;  // [s] without a break
};

/// What ends a task as failed.
enum class LimitKind { kTime, kForce, kStrain, kForbidden };
const char* toString(LimitKind kind);

/// A metric beyond which the task has failed: above it where lower is better, else below it.
struct FailLimit {
  std::string metric;
  double value = 0.0;
};

struct TaskLimits {
  std::optional<double> time;  // [s] > 0
  MetricLimits measured;
  bool strain_limited = false;
  std::set<LimitKind> ends{LimitKind::kTime};
  std::vector<FailLimit> fail;
};

/// What no hand of a trainee does. Where a task does not allow it, who has done it is not counted.
enum class Intervention {
  kUndo,
  kPause,
  kSlow,
  kLoad,
  kRemove,
  kDetach,
  kAttach,
  kSpawn,
  kMaterial,
  kMoveClamp,
  kInstrument,
  kGravity,
  kPlace,
  kResetBodies,
  kForce
};
constexpr std::size_t kInterventions = 15;
const char* toString(Intervention intervention);

/// A metric that counts: full marks at `good`, none at `bad`, even in between.
struct WeightedMetric {
  std::string name;
  double weight = 1.0;  // > 0
  double good = 0.0, bad = 0.0;
  std::optional<double> pass;  // what it must reach
};

struct TaskDef {
  std::string name, scene, brief;
  std::string picture;  // a data: URI; empty: none
  std::vector<Stage> stages;
  TaskLimits limits;
  std::optional<CutPlan> plan;
  std::optional<Target> target;
  std::optional<Box> tray;
  std::optional<Box> view;  // what can be seen
  std::vector<WeightedMetric> metrics;
  double pass_mark = 0.0;  // 0..100
  double settle = 0.0;     // [s] >= 0 that the scene has to come to rest before the task begins
  std::set<Intervention> allow;
  std::string version;  // of the file: a checksum of its bytes

  /// Strain costs something, and is looked at where it is limited or counts.
  bool wantsStrain() const;
  /// So does where bodies are: where a stage puts one back, or it is said how deep they fall.
  bool wantsCentres() const;
  /// Whether a metric counts, or ends it.
  bool looksAt(const std::string& metric) const;
  /// That stages want clips on.
  std::vector<std::string> vessels() const;
  /// That stages want put on obstacles.
  std::vector<std::string> placed() const;
  /// That an endoscope is to show.
  std::vector<std::string> seen() const;
  /// That the world has to have.
  std::vector<std::string> bodies() const;
};

/// What is wrong with a task, and where: "plan", "target", "limits", or "stages" and the number of one.
struct TaskFault {
  std::string where;
  std::size_t stage = 0;
  std::string what, accepted;
};
/// Whether the task can be done in that scene: it has the bodies, the plan meets its body, the target has tissue, every
/// stage can be met within the limits and after those before it. nullopt: it can, as far as is known beforehand.
std::optional<TaskFault> findTaskFault(const TaskDef& task, const SceneDef& scene);

/// 0..1 for one metric; 0 where there was nothing to measure.
double scoreOf(const WeightedMetric& metric, double value);
/// Whether it reaches what it must.
bool passes(const WeightedMetric& metric, double value);

/// The stages of a task, one after the other.
class TaskProgress {
 public:
  explicit TaskProgress(const TaskDef& task) : task_(task) {}

  void feed(const TrainingFrame& frame, const Metrics& metrics, const RestTissue& tissue);

  std::size_t stage() const { return times_.size(); }  // that is to be met now; their number once all are
  bool done() const { return times_.size() == task_.stages.size(); }
  const std::string& failed() const { return failed_; }  // why; empty: it has not
  bool over() const { return done() || !failed_.empty(); }
  double heldFor() const { return held_for_; }                 // [s] of the present stage
  const std::vector<double>& times() const { return times_; }  // [s] when each was met

 private:
  void watch(const Condition& condition, const TrainingFrame& frame);
  void watch(const PutOn& put, const TrainingFrame& frame);
  void watch(const See& see, const TrainingFrame& frame);
  bool meets(const PutOn& put) const;
  bool meets(const Condition& condition, const TrainingFrame& frame, const RestTissue& tissue) const;
  std::string broken(const Metrics& metrics) const;
  std::string brokenMetric(const Metrics& metrics, const RestTissue& tissue) const;

  const TaskDef& task_;
  /// Who holds what is to be handed over; picks have their numbers in the order in which they came.
  struct Hands {
    std::vector<PickId> held;
    bool taken_over = false;  // from one that came before those who hold it
  };
  std::map<PickId, Vec3> grabbed_;  // [m] where
  std::map<std::string, Hands> hands_;
  struct Whereabouts {
    Vec3 at_start, now;  // [m]
  };
  /// How a body comes to the obstacles of a stage.
  struct Carried {
    std::vector<PickId> held;
    PickId last = 0;          // hand that held it
    bool taken_over = false;  // in the air, by that hand
    std::string on;           // the obstacle that it is on, as of the last frame that says so
  };
  std::map<const PutOn*, std::map<std::string, Carried>> carried_;
  std::set<const See*> in_picture_;                 // those that are met, as of the last frame that says so
  std::map<std::string, Whereabouts> whereabouts_;  // of bodies that are to be put back, once they were looked at
  double held_for_ = 0.0;
  std::vector<double> times_;
  std::string failed_;
};

}  // namespace meshless
