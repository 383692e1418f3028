#include "meshless_surgery/training/training.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/number_text.h"

namespace meshless {
namespace {

constexpr double kMomentEvery = 0.1;         // [s]
constexpr std::size_t kMostMoments = 36000;  // an hour; then each stands for twice as long
constexpr std::size_t kMostEvents = 10000;
constexpr std::size_t kOutline = 1500;  // points
constexpr double kSlow = 0.5;           // [1] of real time
constexpr double kWatchedFor = 2.0;     // [s] on the wall, before that is judged

}  // namespace

Training::Now::Now(const TaskDef& task)
    : metrics([&] {
        MetricLimits limits = task.limits.measured;
        limits.vessels = task.vessels();
        limits.placed = task.placed();
        limits.view = task.view;
        return limits;
      }()),
      tissue(task.plan, task.target, task.tray),
      progress(task) {}

Training::Training(TaskDef task, bool after)
    : task_(std::move(task)),
      separates_(std::any_of(task_.stages.begin(), task_.stages.end(),
                             [](const Stage& stage) { return std::holds_alternative<Separate>(stage.condition); })),
      after_(after),
      now_(std::make_unique<Now>(task_)) {}

bool Training::tried() const {
  if (!begun_) return false;
  for (std::size_t h = 0; h < kHands; ++h)
    if (metrics().motion(static_cast<Hand>(h)).seen()) return true;
  return !events().empty() || progress().over();
}

FrameWants Training::wants() const {
  FrameWants wants;
  if (over()) return wants;
  wants.centres = now_->tissue.wantsCentres() || task_.wantsCentres();
  wants.strains = task_.wantsStrain();
  wants.placed = task_.placed();
  wants.seen = task_.seen();
  return wants;
}

Status Training::begin(const TrainingFrame& frame) {
  const auto known = [&](const std::string& name) {
    return std::any_of(frame.bodies.begin(), frame.bodies.end(),
                       [&](const TrainingFrame::Body& body) { return isOf(body.name, name); });
  };
  for (const std::string& name : task_.bodies()) {
    if (known(name)) continue;
    std::string bodies;
    for (const TrainingFrame::Body& body : frame.bodies) bodies += (bodies.empty() ? "" : ", ") + body.name;
    return Error{ErrorCode::kUnknownName, "task '" + task_.name + "' is about a body '" + name + "' of the scene '" +
                                              task_.scene + "'; bodies are: " + bodies};
  }
  begun_ = true;
  stopped_ = false;
  run_ = frame.run;
  now_ = std::make_unique<Now>(task_);
  now_->first_step = frame.step;
  now_->started_at = frame.wall;
  now_->settling = task_.settle > 0.0;
  std::size_t vertices = 0;
  for (const TrainingFrame::Body& body : frame.bodies) vertices += body.model->surface.vertices.size();
  const std::size_t every = std::max<std::size_t>(1, vertices / kOutline);
  for (const TrainingFrame::Body& body : frame.bodies)
    for (std::size_t v = 0; v < body.model->surface.vertices.size(); v += every)
      now_->outline.push_back(body.placed * body.model->surface.vertices[v]);
  return Done{};
}

Status Training::feed(TrainingFrame frame) {
  if (!begun_ || frame.run != run_) {
    const bool again = begun_ || after_;
    if (Status status = begin(frame); !status) return status;
    if (frame.step != 1)
      intervened(Intervention::kLoad,
                 "it begins at step " + std::to_string(frame.step - 1) + " of a state that was saved");
    // What came before the reset is not of this run.
    for (std::size_t k = frame.events.size(); k-- > 0;) {
      const Event& event = frame.events[k];
      if (event.type != EventType::kReset && event.type != EventType::kLoaded) continue;
      now_->first_command = event.command;
      if (again && event.type == EventType::kLoaded)
        intervened(Intervention::kLoad, "it begins with a state that was loaded");
      frame.events.erase(frame.events.begin(), frame.events.begin() + static_cast<std::ptrdiff_t>(k) + 1);
      break;
    }
  }
  if (over()) return Done{};
  Now& now = *now_;
  if (now.settling) {
    now.settled += frame.dt;
    const auto acts_by = [&](const TrainingFrame::Tool& tool) {  // an instrument lies there until it is moved
      return tool.kind != ToolKind::kInstrument ||
             now.rests.emplace(tool.pick, tool.position).first->second != tool.position;
    };
    const bool acts = std::any_of(frame.tools.begin(), frame.tools.end(), acts_by) ||
                      std::any_of(frame.events.begin(), frame.events.end(),
                                  [&](const Event& event) { return event.command > now.first_command; });
    if (!acts && now.settled < task_.settle + 1e-9) {
      now.last_step = frame.step;
      now.tissue.feed(frame);
      now.metrics.settle(frame);
      return Done{};
    }
    now.settling = false;
    now.first_step = frame.step;
    now.started_at = frame.wall;
  }
  noteInterventions(frame);
  const std::size_t stage_before = now.progress.stage();
  now.last_step = frame.step;
  now.tissue.feed(frame);
  now.metrics.feed(frame);
  now.progress.feed(frame, now.metrics, now.tissue);
  note(frame, stage_before);
  if (now.progress.over()) now.metrics.end();
  return Done{};
}

void Training::stop() {
  if (!begun_ || over()) return;
  stopped_ = true;
  now_->metrics.end();
}

void Training::noteInterventions(const TrainingFrame& frame) {
  if (std::isnan(frame.wall) && metrics().wallTime() > 0.0)
    intervened(Intervention::kPause, "steps were done one by one while somebody watched");
  std::uint64_t restored_by = 0;  // the scene's attachments come back with its bodies
  for (const Event& event : frame.events) {
    if (event.command <= now_->first_command && event.type != EventType::kLoaded) continue;  // the scene's own
    const std::string of = event.text + (event.text.find(event.body) == std::string::npos ? ": " + event.body : "");
    if (event.type == EventType::kUndone) intervened(Intervention::kUndo, "a cut was taken back");
    if (event.type == EventType::kRemoved) intervened(Intervention::kRemove, of);
    if (event.type == EventType::kDetached && event.taken_apart) intervened(Intervention::kDetach, of);
    if (event.type == EventType::kRestored) restored_by = event.command;
    if (event.type == EventType::kAttached && event.command != restored_by) intervened(Intervention::kAttach, of);
    if (event.type == EventType::kSpawned) intervened(Intervention::kSpawn, of);
    if (event.type == EventType::kMaterial) intervened(Intervention::kMaterial, of);
    if (event.type == EventType::kClampMoved) intervened(Intervention::kMoveClamp, of);
    if (event.type == EventType::kInstrument) intervened(Intervention::kInstrument, of);
    if (event.type == EventType::kGravity) intervened(Intervention::kGravity, event.text);
    if (event.type == EventType::kPlaced) intervened(Intervention::kPlace, of);
    if (event.type == EventType::kRestored) intervened(Intervention::kResetBodies, of);
    if (event.type == EventType::kForce && event.force > 0.0) intervened(Intervention::kForce, of);
  }
}

void Training::intervened(Intervention intervention, const std::string& what) {
  if (!begun_ || over() || task_.allow.count(intervention)) return;
  const auto [found, is_new] = now_->interventions.try_emplace(intervention, what);
  if (is_new) found->second += " (" + numberText(now_->metrics.time(), 3) + " s)";
}

std::vector<std::string> Training::notCounted() const {
  std::vector<std::string> why;
  for (const auto& [intervention, what] : now_->interventions)
    why.push_back(what + "; the task does not allow " + toString(intervention));
  if (metrics().slowerThan(kSlow, kWatchedFor) && !task_.allow.count(Intervention::kSlow))
    why.push_back("the world ran at less than " + numberText(kSlow) + " of real time; the task does not allow slow");
  return why;
}

void Training::note(const TrainingFrame& frame, std::size_t stage_before) {
  Now& now = *now_;
  const double time = now.metrics.time();
  const auto say = [&](const std::string& text, bool error) {
    if (now.events.size() < kMostEvents) now.events.push_back({time, text, error});
  };
  for (const Event& event : frame.events)
    if (isShown(event.type))
      say(event.text +
              (event.body.empty() || event.text.find(event.body) != std::string::npos ? "" : ": " + event.body),
          isError(event.type) && !(event.type == EventType::kTorn && separates_));
  for (std::size_t s = stage_before; s < now.progress.stage(); ++s) say("stage met: " + task_.stages[s].name, false);
  if (!now.progress.failed().empty()) say("failed: " + now.progress.failed(), true);
  now.next.force = std::max(now.next.force, now.metrics.force());
  now.since += frame.dt;
  const double every = kMomentEvery * std::pow(2.0, static_cast<double>(now.moments.size() / kMostMoments));
  if (now.since < every - 1e-9 && !now.progress.over()) return;
  now.next.time = time;
  for (std::size_t h = 0; h < kHands; ++h) {
    const double path = now.metrics.motion(static_cast<Hand>(h)).path();
    now.next.speed[h] = (path - now.paths[h]) / now.since;
    now.paths[h] = path;
    now.next.place[h] = now.metrics.place(static_cast<Hand>(h));
  }
  now.moments.push_back(now.next);
  now.next = TrainingMoment();
  now.since = 0.0;
}

double Training::score() const {
  if (!notCounted().empty()) return 0.0;
  if (!task_.metrics.empty() && !progress().done()) return 0.0;
  if (task_.metrics.empty())
    return 100.0 * static_cast<double>(progress().stage()) / static_cast<double>(task_.stages.size());
  const std::vector<MetricValue> all = values();
  double sum = 0.0, weights = 0.0;
  for (const WeightedMetric& metric : task_.metrics) {
    weights += metric.weight;
    for (const MetricValue& value : all)
      if (value.name == metric.name) sum += metric.weight * scoreOf(metric, value.value);
  }
  return 100.0 * sum / weights;
}

bool Training::passed() const {
  if (!progress().done() || !notCounted().empty() || !(score() >= task_.pass_mark)) return false;
  const std::vector<MetricValue> all = values();
  for (const WeightedMetric& metric : task_.metrics)
    for (const MetricValue& value : all)
      if (value.name == metric.name && !passes(metric, value.value)) return false;
  return true;
}

}  // namespace meshless
