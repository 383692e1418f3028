#include "meshless_surgery/training/task.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/thicken.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "volume_within.h"

namespace meshless {
namespace {

constexpr PickId kOfJaws = PickId{1} << 31;  // beyond the numbers of picks
constexpr double kFailEvery = 0.1;           // [s]

/// The tissue's surface, where the scene puts it.
TriangleMesh placedMesh(const BodyDef& body) {
  TriangleMesh mesh = body.mesh;
  if (body.thickness > 0.0)
    if (Result<TriangleMesh> layer = thickened(mesh, body.thickness)) mesh = std::move(*layer);
  for (Vec3& p : mesh.vertices) p = body.pose * p;
  return mesh;
}

/// Whether a region has tissue: more than what rounding leaves.
bool anyWithin(const TriangleMesh& tissue, const Region& region) {
  return volumeWithin(tissue, region) > 1e-9 * std::abs(signedVolume(tissue));
}

/// Those that hold it, in the order of their numbers.
std::vector<PickId> holdersOf(const std::string& body, const TrainingFrame& frame) {
  std::vector<PickId> held;
  for (const TrainingFrame::Tool& tool : frame.tools)
    if (isOf(tool.body, body)) held.push_back(tool.pick + (tool.kind == ToolKind::kInstrument ? kOfJaws : 0));
  std::sort(held.begin(), held.end());
  return held;
}

const BodyDef* bodyOf(const SceneDef& scene, const std::string& name) {
  for (const BodyDef& body : scene.bodies)
    if (body.name == name) return &body;
  return nullptr;
}

std::string bodiesOf(const SceneDef& scene) {
  std::string text;
  for (std::size_t k = 0; k < scene.bodies.size() && k < 20; ++k) text += (k ? ", " : "") + scene.bodies[k].name;
  return text.empty() ? "none, for the scene has no bodies" : "bodies of the scene: " + text;
}

// A box or a sphere that lies wholly within another region.
bool liesWithin(const Region& inner, const Region& outer) {
  if (inner.kind == Region::Kind::kSphere) return outer.height(inner.centre) <= -inner.radius;
  if (inner.kind != Region::Kind::kBox) return false;
  for (int corner = 0; corner < 8; ++corner) {
    Vec3 p;
    for (int k = 0; k < 3; ++k) p[k] = (corner >> k & 1) ? inner.box.max[k] : inner.box.min[k];
    if (!outer.contains(p)) return false;
  }
  return outer.kind != Region::Kind::kMesh;
}

class FaultFinder {
 public:
  FaultFinder(const TaskDef& task, const SceneDef& scene) : task_(task), scene_(scene) {}

  std::optional<TaskFault> find() {
    if (task_.stages.empty()) return TaskFault{"stages", 0, "there are no stages", "at least one"};
    if (task_.plan) {
      if (auto fault = needsBody("plan", 0, task_.plan->body)) return fault;
      const BodyDef& body = *bodyOf(scene_, task_.plan->body);
      if (planPointsIn(*task_.plan, placedMesh(body)).empty())
        return TaskFault{"plan", 0, "no part of the plan is in '" + body.name + "' at rest",
                         "a rectangle that meets it"};
    }
    if (task_.target) {
      if (auto fault = needsBody("target", 0, task_.target->body)) return fault;
      const BodyDef& body = *bodyOf(scene_, task_.target->body);
      if (!anyWithin(placedMesh(body), task_.target->region))
        return TaskFault{"target", 0, "no tissue of '" + body.name + "' is in the target at rest",
                         "a region that has some"};
    }
    for (const Forbidden& forbidden : task_.limits.measured.forbidden)
      if (!forbidden.body.empty())
        if (auto fault = needsBody("limits", 0, forbidden.body)) return fault;
    double held = 0.0;
    for (std::size_t k = 0; k < task_.stages.size(); ++k) {
      const Stage& stage = task_.stages[k];
      held += stage.hold_for;
      if (task_.limits.time && ends(LimitKind::kTime) && held > *task_.limits.time)
        return TaskFault{"stages", k,
                         "the stages up to this one are to be held for " + numberText(held) +
                             " s together, and time is " + numberText(*task_.limits.time) + " s",
                         "less than that"};
      if (auto fault = std::visit([&](const auto& condition) { return check(k, condition); }, stage.condition))
        return fault;
    }
    return std::nullopt;
  }

 private:
  std::optional<TaskFault> needsBody(const std::string& where, std::size_t stage, const std::string& name) const {
    if (bodyOf(scene_, name)) return std::nullopt;
    return TaskFault{where, stage, "there is no body '" + name + "' in the scene", bodiesOf(scene_)};
  }
  bool ends(LimitKind kind) const { return task_.limits.ends.count(kind) > 0; }
  std::optional<TaskFault> never(std::size_t stage, const std::string& why, const std::string& accepted) const {
    return TaskFault{"stages", stage, "this stage can never be met: " + why, accepted};
  }
  std::optional<TaskFault> inForbidden(std::size_t stage, const Region& region) const {
    if (ends(LimitKind::kForbidden))
      for (const Forbidden& forbidden : task_.limits.measured.forbidden)
        if (forbidden.body.empty() && liesWithin(region, forbidden.region))
          return never(stage, "its region lies in the forbidden region '" + forbidden.name + "'",
                       "a region outside of it");
    return std::nullopt;
  }

  std::optional<TaskFault> heldForbidden(std::size_t k, const std::string& body) const {
    if (auto fault = needsBody("stages", k, body)) return fault;
    if (ends(LimitKind::kForbidden))
      for (const Forbidden& forbidden : task_.limits.measured.forbidden)
        if (!forbidden.body.empty() && isOf(body, forbidden.body))
          return never(k, "'" + body + "' is forbidden", "another body");
    return std::nullopt;
  }

  std::optional<TaskFault> check(std::size_t k, const Reach& reach) const { return inForbidden(k, reach.region); }
  std::optional<TaskFault> check(std::size_t k, const StretchTo& stretch) const {
    return heldForbidden(k, stretch.body);
  }
  std::optional<TaskFault> check(std::size_t k, const PressTo& press) const {
    if (ends(LimitKind::kForce) && press.force > task_.limits.measured.force)
      return never(k,
                   "force is " + numberText(press.force) + " N, and a force above " +
                       numberText(task_.limits.measured.force) + " N ends the task",
                   "up to that");
    return press.region ? inForbidden(k, *press.region) : std::nullopt;
  }
  std::optional<TaskFault> check(std::size_t k, const CutAlong&) const {
    if (!task_.plan) return never(k, "the task has no plan", "a task with plan");
    if (ends(LimitKind::kForbidden))
      for (const Forbidden& forbidden : task_.limits.measured.forbidden)
        if (!forbidden.body.empty() && isOf(task_.plan->body, forbidden.body))
          return never(k, "the body of the plan is forbidden", "a plan in another body");
    return std::nullopt;
  }
  std::optional<TaskFault> check(std::size_t k, const Separate& separate) const {
    for (const std::string& name : {separate.a, separate.b}) {
      const bool obstacle = std::any_of(scene_.obstacles.begin(), scene_.obstacles.end(),
                                        [&](const ObstacleDef& def) { return def.name == name; });
      if (!obstacle && name != kWorldEnd)
        if (auto fault = needsBody("stages", k, name)) return fault;
    }
    for (const AttachCommand& joint : scene_.attachments)
      if ((joint.body == separate.a && joint.other == separate.b) ||
          (joint.body == separate.b && joint.other == separate.a))
        return std::nullopt;
    return TaskFault{
        "stages", k,
        "no attachment joins '" + separate.a + "' and '" + separate.b + "': this stage is met from the start",
        "two ends of an attachment of the scene"};
  }
  std::optional<TaskFault> check(std::size_t k, const RemoveToTray&) const {
    if (!task_.target) return never(k, "the task has no target", "a task with target");
    if (!task_.tray) return TaskFault{"stages", k, "the task has no tray", "a task with tray"};
    if (!SolidQuery(placedMesh(*bodyOf(scene_, task_.target->body))).contains(task_.target->middle()))
      return never(k, "the middle of the target is in no tissue at rest", "a target whose middle is in tissue");
    return std::nullopt;
  }
  std::optional<TaskFault> check(std::size_t k, const LeaveNothing&) const {
    if (!task_.target) return never(k, "the task has no target", "a task with target");
    return std::nullopt;
  }
  std::optional<TaskFault> check(std::size_t, const LetGo&) const { return std::nullopt; }
  std::optional<TaskFault> check(std::size_t k, const Clipped& clipped) const {
    if (auto fault = needsBody("stages", k, clipped.body)) return fault;
    if (clipped.region && !anyWithin(placedMesh(*bodyOf(scene_, clipped.body)), *clipped.region))
      return never(k, "no tissue of '" + clipped.body + "' is in its region at rest", "a region that has some");
    return std::nullopt;
  }
  std::optional<TaskFault> check(std::size_t k, const Hold& hold) const { return heldForbidden(k, hold.body); }
  std::optional<TaskFault> check(std::size_t k, const HandOver& over) const { return heldForbidden(k, over.body); }
  std::optional<TaskFault> check(std::size_t k, const PutBack& back) const {
    if (auto fault = needsBody("stages", k, back.body)) return fault;
    if (k > 0) return std::nullopt;
    return TaskFault{"stages", k, "put_back is the first stage: it is met from the start",
                     "a stage before it, in which '" + back.body + "' is moved"};
  }

  std::optional<TaskFault> check(std::size_t k, const PutOn& put) const {
    for (const std::string& body : put.bodies)
      if (auto fault = heldForbidden(k, body)) return fault;
    for (const std::string& name : put.obstacles) {
      std::string known;
      for (const ObstacleDef& obstacle : scene_.obstacles) known += (known.empty() ? "" : ", ") + obstacle.name;
      if (std::none_of(scene_.obstacles.begin(), scene_.obstacles.end(),
                       [&](const ObstacleDef& obstacle) { return obstacle.name == name; }))
        return TaskFault{"stages", k, "there is no obstacle '" + name + "' in the scene",
                         known.empty() ? "none, for the scene has no obstacles" : "obstacles of the scene: " + known};
    }
    if (put.obstacles.size() < put.bodies.size())
      return never(k,
                   numberText(static_cast<double>(put.bodies.size())) + " bodies are to be put on " +
                       numberText(static_cast<double>(put.obstacles.size())) + " obstacles, one on each",
                   "as many obstacles as bodies, or more");
    if (scene_.world.contact != ContactMethod::kSurface)
      return never(k, "bodies do not meet obstacles in this scene", "a scene with contact: surface");
    return std::nullopt;
  }

  std::optional<TaskFault> check(std::size_t k, const See& see) const {
    if (auto fault = needsBody("stages", k, see.body)) return fault;
    if (std::any_of(scene_.instruments.begin(), scene_.instruments.end(),
                    [](const InstrumentDef& def) { return def.type == InstrumentType::kEndoscope; }))
      return std::nullopt;
    return never(k, "the scene has no endoscope", "a scene with an instrument of type endoscope");
  }

  const TaskDef& task_;
  const SceneDef& scene_;
};

}  // namespace

const char* toString(LimitKind kind) {
  switch (kind) {
    case LimitKind::kTime:
      return "time";
    case LimitKind::kForce:
      return "force";
    case LimitKind::kStrain:
      return "strain";
    case LimitKind::kForbidden:
      return "forbidden";
  }
  return "unknown";
}

const char* toString(Intervention intervention) {
  switch (intervention) {
    case Intervention::kUndo:
      return "undo";
    case Intervention::kPause:
      return "pause";
    case Intervention::kSlow:
      return "slow";
    case Intervention::kLoad:
      return "load";
    case Intervention::kRemove:
      return "remove";
    case Intervention::kDetach:
      return "detach";
    case Intervention::kAttach:
      return "attach";
    case Intervention::kSpawn:
      return "spawn";
    case Intervention::kMaterial:
      return "material";
    case Intervention::kMoveClamp:
      return "move_clamp";
    case Intervention::kInstrument:
      return "instrument";
    case Intervention::kGravity:
      return "set_gravity";
    case Intervention::kPlace:
      return "set_pose";
    case Intervention::kResetBodies:
      return "reset_bodies";
    case Intervention::kForce:
      return "apply_force";
  }
  return "unknown";
}

bool TaskDef::looksAt(const std::string& metric) const {
  return std::any_of(metrics.begin(), metrics.end(), [&](const WeightedMetric& one) { return one.name == metric; }) ||
         std::any_of(limits.fail.begin(), limits.fail.end(),
                     [&](const FailLimit& one) { return one.metric == metric; });
}

bool TaskDef::wantsStrain() const {
  return limits.strain_limited || looksAt("strain_peak") || looksAt("strained_volume");
}

bool TaskDef::wantsCentres() const {
  return looksAt("drop_height") || view || std::any_of(stages.begin(), stages.end(), [](const Stage& stage) {
           return std::holds_alternative<PutBack>(stage.condition);
         });
}

std::vector<std::string> TaskDef::vessels() const {
  std::vector<std::string> all;
  for (const Stage& stage : stages)
    if (const auto* clipped = std::get_if<Clipped>(&stage.condition)) all.push_back(clipped->body);
  return all;
}

std::vector<std::string> TaskDef::placed() const {
  std::vector<std::string> all;
  for (const Stage& stage : stages)
    if (const auto* put = std::get_if<PutOn>(&stage.condition))
      for (const std::string& body : put->bodies)
        if (std::find(all.begin(), all.end(), body) == all.end()) all.push_back(body);
  return all;
}

std::vector<std::string> TaskDef::seen() const {
  std::vector<std::string> all;
  for (const Stage& stage : stages)
    if (const auto* see = std::get_if<See>(&stage.condition)) all.push_back(see->body);
  return all;
}

std::vector<std::string> TaskDef::bodies() const {
  std::vector<std::string> all = vessels();
  for (const std::string& body : placed()) all.push_back(body);
  for (const std::string& body : seen()) all.push_back(body);
  if (plan) all.push_back(plan->body);
  if (target) all.push_back(target->body);
  for (const Forbidden& forbidden : limits.measured.forbidden)
    if (!forbidden.body.empty()) all.push_back(forbidden.body);
  for (const Stage& stage : stages) {
    if (const auto* stretch = std::get_if<StretchTo>(&stage.condition)) all.push_back(stretch->body);
    if (const auto* hold = std::get_if<Hold>(&stage.condition)) all.push_back(hold->body);
    if (const auto* over = std::get_if<HandOver>(&stage.condition)) all.push_back(over->body);
    if (const auto* back = std::get_if<PutBack>(&stage.condition)) all.push_back(back->body);
  }
  return all;
}

std::optional<TaskFault> findTaskFault(const TaskDef& task, const SceneDef& scene) {
  return FaultFinder(task, scene).find();
}

double scoreOf(const WeightedMetric& metric, double value) {
  if (!std::isfinite(value)) return 0.0;
  return std::clamp((value - metric.bad) / (metric.good - metric.bad), 0.0, 1.0);
}

bool passes(const WeightedMetric& metric, double value) {
  if (!metric.pass) return true;
  return metric.good < metric.bad ? value <= *metric.pass : value >= *metric.pass;  // NaN: no
}

void TaskProgress::feed(const TrainingFrame& frame, const Metrics& metrics, const RestTissue& tissue) {
  if (over()) return;
  for (const TrainingFrame::Tool& tool : frame.tools)
    if (tool.kind == ToolKind::kPick) grabbed_.emplace(tool.pick, tool.tissue);
  for (const Stage& stage : task_.stages) watch(stage.condition, frame);
  failed_ = broken(metrics);
  // All metrics at once cost something.
  const auto every = static_cast<std::uint64_t>(std::max(1.0, std::round(kFailEvery / frame.dt)));
  if (failed_.empty() && frame.step % every == 0) failed_ = brokenMetric(metrics, tissue);
  if (!failed_.empty()) return;
  // Two stages are never met in one step: the next one begins with the next.
  const Stage& stage = task_.stages[times_.size()];
  if (!meets(stage.condition, frame, tissue)) {
    held_for_ = 0.0;
    return;
  }
  held_for_ += frame.dt;
  if (!(held_for_ >= stage.hold_for - 1e-9)) return;
  if (times_.size() + 1 == task_.stages.size()) failed_ = brokenMetric(metrics, tissue);
  if (!failed_.empty()) return;
  times_.push_back(metrics.time());
  held_for_ = 0.0;
}

// What a stage that comes later has to know of now.
void TaskProgress::watch(const Condition& condition, const TrainingFrame& frame) {
  if (const auto* put = std::get_if<PutOn>(&condition)) watch(*put, frame);
  if (const auto* see = std::get_if<See>(&condition); see && frame.pictures) watch(*see, frame);
  if (const auto* over = std::get_if<HandOver>(&condition)) {
    Hands& hands = hands_[over->body];
    std::vector<PickId> held = holdersOf(over->body, frame);
    if (held.empty())
      hands.taken_over = false;
    else if (!hands.held.empty() && held.front() != hands.held.front())
      hands.taken_over = std::find(hands.held.begin(), hands.held.end(), held.front()) != hands.held.end();
    hands.held = std::move(held);
  }
  if (const auto* back = std::get_if<PutBack>(&condition); back && frame.sampled) {
    Vec3 sum = Vec3::Zero();
    double volume = 0.0;
    for (const TrainingFrame::Body& body : frame.bodies) {
      if (!isOf(body.name, back->body)) continue;
      sum += body.model->rest_volume * body.centre;
      volume += body.model->rest_volume;
    }
    if (!(volume > 0.0)) return;
    const auto [found, is_new] = whereabouts_.try_emplace(back->body, Whereabouts{sum / volume, sum / volume});
    if (!is_new) found->second.now = sum / volume;
  }
}

void TaskProgress::watch(const PutOn& put, const TrainingFrame& frame) {
  for (const std::string& name : put.bodies) {
    const auto body = std::find_if(frame.bodies.begin(), frame.bodies.end(),
                                   [&](const TrainingFrame::Body& one) { return one.name == name; });
    Carried& carried = carried_[&put][name];
    if (body == frame.bodies.end()) {  // cut, or gone
      carried = Carried();
      continue;
    }
    std::vector<PickId> held = holdersOf(name, frame);
    if (held.size() == 1 && held.front() != carried.last) {
      // Another hand alone: it took it over where both held it before, in the air.
      const auto had = [&](PickId hand) {
        return std::find(carried.held.begin(), carried.held.end(), hand) != carried.held.end();
      };
      carried.taken_over = had(held.front()) && had(carried.last) && !body->supported;
      carried.last = held.front();
    }
    if (frame.places) {
      const auto listed = [&](const std::string& obstacle) {
        return std::find(put.obstacles.begin(), put.obstacles.end(), obstacle) != put.obstacles.end();
      };
      const auto on = std::find_if(body->around.begin(), body->around.end(), listed);
      carried.on = on == body->around.end() ? "" : *on;
      // Where it is put on another one, it comes from there anew.
      if (held.empty() && carried.on.empty() && !body->around.empty()) carried.taken_over = false;
    }
    carried.held = std::move(held);
  }
}

void TaskProgress::watch(const See& see, const TrainingFrame& frame) {
  in_picture_.erase(&see);
  for (const TrainingFrame::Tool& tool : frame.tools)
    for (const TrainingFrame::Shown& shown : tool.shown)
      if (shown.body == see.body && !shown.hidden && shown.off_centre <= see.off_centre &&
          shown.fills >= see.fills_least && shown.fills <= see.fills_most)
        in_picture_.insert(&see);
}

bool TaskProgress::meets(const PutOn& put) const {
  std::set<std::string> taken;
  for (const std::string& name : put.bodies) {
    const Carried& carried = carried_.at(&put).at(name);
    if (!carried.held.empty() || carried.on.empty() || !taken.insert(carried.on).second) return false;
    if (put.handed_over && !carried.taken_over) return false;
  }
  return true;
}

bool TaskProgress::meets(const Condition& condition, const TrainingFrame& frame, const RestTissue& tissue) const {
  const auto anyTool = [&](const auto& test) { return std::any_of(frame.tools.begin(), frame.tools.end(), test); };
  if (const auto* reach = std::get_if<Reach>(&condition))
    return anyTool([&](const auto& tool) { return tool.kind == reach->tool && reach->region.contains(tool.position); });
  if (const auto* stretch = std::get_if<StretchTo>(&condition))
    return anyTool([&](const TrainingFrame::Tool& tool) {
      return tool.kind == ToolKind::kPick && isOf(tool.body, stretch->body) &&
             (tool.tissue - grabbed_.at(tool.pick)).norm() >= stretch->distance;
    });
  if (const auto* press = std::get_if<PressTo>(&condition))
    return anyTool([&](const auto& tool) {
      return tool.kind == press->tool && tool.force >= press->force &&
             (!press->region || press->region->contains(press->touch ? tool.touch : tool.position));
    });
  if (const auto* put = std::get_if<PutOn>(&condition)) return meets(*put);
  if (const auto* see = std::get_if<See>(&condition)) return in_picture_.count(see) > 0;
  if (const auto* cut = std::get_if<CutAlong>(&condition)) return tissue.planDone() >= cut->share;
  if (const auto* separate = std::get_if<Separate>(&condition)) {
    const auto has = [](const TrainingFrame::Joint& joint, const std::string& name) {
      return std::any_of(joint.ends.begin(), joint.ends.end(), [&](const std::string& end) { return isOf(end, name); });
    };
    return std::none_of(frame.joints.begin(), frame.joints.end(), [&](const TrainingFrame::Joint& joint) {
      return joint.fibres > 0 && has(joint, separate->a) && has(joint, separate->b);
    });
  }
  if (std::holds_alternative<RemoveToTray>(condition)) return tissue.targetRemoved();
  if (const auto* leave = std::get_if<LeaveNothing>(&condition)) return tissue.targetLeft() <= leave->share;
  if (const auto* clipped = std::get_if<Clipped>(&condition))
    return std::any_of(frame.joints.begin(), frame.joints.end(), [&](const TrainingFrame::Joint& joint) {
      return joint.clip && (!clipped->region || clipped->region->contains(*joint.clip)) &&
             std::any_of(joint.ends.begin(), joint.ends.end(),
                         [&](const std::string& end) { return isOf(end, clipped->body); });
    });
  const auto holders = [&](const std::string& body, const std::optional<Region>& region) {
    return std::count_if(frame.tools.begin(), frame.tools.end(), [&](const TrainingFrame::Tool& tool) {
      const bool jaws = tool.kind == ToolKind::kInstrument;
      return (jaws || tool.kind == ToolKind::kPick) && isOf(tool.body, body) &&
             (!region || region->contains(jaws ? tool.position : tool.tissue));
    });
  };
  if (const auto* hold = std::get_if<Hold>(&condition)) return holders(hold->body, hold->region) >= hold->picks;
  if (const auto* over = std::get_if<HandOver>(&condition))
    return holders(over->body, std::nullopt) == 1 && hands_.at(over->body).taken_over;
  if (const auto* back = std::get_if<PutBack>(&condition)) {
    const auto found = whereabouts_.find(back->body);
    return found != whereabouts_.end() && (found->second.now - found->second.at_start).norm() <= back->distance;
  }
  return !anyTool([](const auto& tool) {
    return tool.kind == ToolKind::kInstrument ? !tool.body.empty() : tool.kind != ToolKind::kScissors;
  });
}

std::string TaskProgress::broken(const Metrics& metrics) const {
  const TaskLimits& limits = task_.limits;
  const auto ends = [&](LimitKind kind) { return limits.ends.count(kind) > 0; };
  if (limits.time && ends(LimitKind::kTime) && metrics.time() > *limits.time + 1e-9)
    return "the time of " + numberText(*limits.time) + " s is over";
  if (ends(LimitKind::kForce) && metrics.force() > limits.measured.force)
    return "a force of " + numberText(metrics.force()) + " N is above the limit of " +
           numberText(limits.measured.force) + " N";
  if (ends(LimitKind::kStrain) && limits.strain_limited && metrics.strainPeak() > limits.measured.strain)
    return "a strain of " + numberText(metrics.strainPeak()) + " is above the limit of " +
           numberText(limits.measured.strain);
  if (ends(LimitKind::kForbidden) && !metrics.touched().empty())
    return "a tool was where it must not be: " + *metrics.touched().begin();
  return "";
}

std::string TaskProgress::brokenMetric(const Metrics& metrics, const RestTissue& tissue) const {
  if (task_.limits.fail.empty()) return "";
  const std::vector<MetricValue> values = metrics.values(tissue, times_.size());
  for (const FailLimit& limit : task_.limits.fail)
    for (const MetricValue& value : values) {
      if (value.name != limit.metric) continue;
      const MetricRow& row = *findMetric(value.name);
      const bool above = row.better == Better::kLower;
      if (!(above ? value.value > limit.value : value.value < limit.value)) continue;  // NaN: no
      const std::string unit = row.unit == std::string("1") ? "" : std::string(" ") + row.unit;
      return value.name + " is " + numberText(value.value, 3) + unit +
             (above ? ", above the limit of " : ", below the limit of ") + numberText(limit.value) + unit;
    }
  return "";
}

}  // namespace meshless
