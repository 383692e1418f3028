#include "meshless_surgery/training/training.h"

#include <algorithm>
#include <cmath>

namespace meshless {
namespace {

constexpr double kMomentEvery = 0.1;         // [s]
constexpr std::size_t kMostMoments = 36000;  // an hour; then each stands for twice as long
constexpr std::size_t kMostEvents = 10000;
constexpr std::size_t kOutline = 1500;  // points

}  // namespace

Training::Now::Now(const TaskDef& task)
    : metrics([&] {
        MetricLimits limits = task.limits.measured;
        limits.vessels = task.vessels();
        return limits;
      }()),
      tissue(task.plan, task.target, task.tray),
      progress(task) {}

Training::Training(TaskDef task) : task_(std::move(task)), now_(std::make_unique<Now>(task_)) {}

FrameWants Training::wants() const {
  FrameWants wants;
  if (over()) return wants;
  wants.centres = now_->tissue.wantsCentres() || task_.wantsCentres();
  wants.strains = task_.wantsStrain();
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
    if (Status status = begin(frame); !status) return status;
    // What came before the reset is not of this run.
    for (std::size_t k = frame.events.size(); k-- > 0;) {
      if (frame.events[k].type != EventType::kReset && frame.events[k].type != EventType::kLoaded) continue;
      frame.events.erase(frame.events.begin(), frame.events.begin() + static_cast<std::ptrdiff_t>(k) + 1);
      break;
    }
  }
  if (over()) return Done{};
  Now& now = *now_;
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
          isError(event.type));
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
  if (!progress().done() || !(score() >= task_.pass_mark)) return false;
  const std::vector<MetricValue> all = values();
  for (const WeightedMetric& metric : task_.metrics)
    for (const MetricValue& value : all)
      if (value.name == metric.name && !passes(metric, value.value)) return false;
  return true;
}

}  // namespace meshless
