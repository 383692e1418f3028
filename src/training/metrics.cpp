#include "meshless_surgery/training/metrics.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "meshless_surgery/geometry/query/nearest.h"

namespace meshless {
namespace {

constexpr double kBetweenStrokes = 0.5;  // [s]
constexpr double kPressing = 1e-6;       // [N] above this a tool is at work
constexpr double kLaidDown = 0.5;        // [s] that what is let go of may take to come to its obstacle

const char* const kSmooth = "Balasubramanian et al. 2012, 2015";
const char* const kUsual = "usual in skill assessment: Reiley et al. 2011";
const char* const kNeuro = "NeuroTouch: Alotaibi et al. 2015";
const char* const kOwn = "this package";

}  // namespace

const std::vector<MetricRow>& metricTable() {
  constexpr auto kLower = Better::kLower, kHigher = Better::kHigher;
  static const std::vector<MetricRow> table{
      {"time", "s", kLower, false, "simulated time since the task's start", kUsual},
      {"wall_time", "s", kLower, false, "time on the wall in which the world ran by itself, since the task's start",
       kOwn},
      {"real_time_factor", "1", kHigher, false, "simulated time over time on the wall, while the world ran by itself",
       kOwn},
      {"idle_time", "s", kLower, false, "time in which no hand moves: none gets on by 5 mm/s over 0.1 s", kUsual},
      {"stages", "1", kHigher, false, "stages of the task that were met", kOwn},
      {"path_length", "m", kLower, true, "sum of the hand's ways from step to step, while it is there", kUsual},
      {"economy", "1", kHigher, true,
       "straight distances over path length; a straight distance goes from where the hand comes to where it leaves",
       kUsual},
      {"workspace", "m^3", kLower, true,
       "volume of the evenly filled ellipsoid that has the covariance of the hand's positions", kOwn},
      {"mean_speed", "m/s", kHigher, true, "path while the hand moves over the time in which it does", kUsual},
      {"top_speed", "m/s", kLower, true, "fastest that the hand goes from one step to the next", kOwn},
      {"movements", "1", kLower, true, "times that the hand begins to move (5 mm/s over 0.1 s)", kUsual},
      {"sparc", "1", kHigher, true,
       "minus the arc length of the speed's normalised magnitude spectrum, up to 10 Hz and down to 0.05, mean over the "
       "movements by their durations; a movement is cut after 10 s",
       kSmooth},
      {"ldlj", "1", kHigher, true,
       "-ln(T^3 / v_peak^2 * integral of the squared jerk), mean over the movements by their durations", kSmooth},
      {"tremor", "m", kLower, true,
       "root of 2 times the mean square of the hand's motion from 4 to 14 Hz: the amplitude of a sine; windows of 2 s, "
       "half overlapping, of Hann, without their trend",
       kOwn},
      {"angular_path", "rad", kLower, true,
       "sum of the turns from step to step; of scissors and instruments, others have no direction", kUsual},
      {"force_mean", "N", kLower, false, "mean of the largest force of a tool, over the time in which there is one",
       kNeuro},
      {"force_peak", "N", kLower, false, "largest force of a tool in any step", kNeuro},
      {"impulse", "N s", kLower, false, "integral of the largest force of a tool over time", kNeuro},
      {"force_together_peak", "N", kLower, false, "largest sum of the forces of all tools in any step", kOwn},
      {"force_together_mean", "N", kLower, false,
       "mean of the sum of the forces of all tools, over the time in which there is one", kOwn},
      {"force_time_above", "s", kLower, false, "time in which the largest force of a tool is above the limit", kNeuro},
      {"strain_peak", "1", kLower, false,
       "most by which |stretch - 1|, the largest of the principal directions, grows in any cell or cluster beyond what "
       "it "
       "had before any tissue was touched; ten times a second",
       kOwn},
      {"strained_volume", "m^3", kLower, false,
       "largest volume at rest in which that growth is beyond the limit at a time", kOwn},
      {"volume_removed", "m^3", kLower, false,
       "volume at rest of the target's body, or without a target of any, that was removed or lies in the tray", kNeuro},
      {"healthy_share", "1", kLower, false, "share of the volume removed that is not of the target", kNeuro},
      {"target_left", "1", kLower, false, "share of the target that was not removed", kNeuro},
      {"cut_area", "m^2", kLower, false, "area at rest of one side of all cut faces", kOwn},
      {"cuts", "1", kLower, false, "times that scissors severed something; of one command once", kOwn},
      {"strokes", "1", kLower, false,
       "times that a blade opened something; of one command once; snips of scissors in a hand with less than half a "
       "second between are one",
       kOwn},
      {"plan_rms", "m", kLower, false,
       "root of the mean, by area, of the squared distance of the cut faces at rest from the plan's rectangle", kOwn},
      {"plan_hausdorff", "m", kLower, false,
       "the larger of: the farthest of the cut from the plan; the farthest of the plan within the body from the cut",
       kOwn},
      {"off_plan_area", "m^2", kLower, false,
       "area of one side of the cut that is farther from the plan than its tolerance", "LapGym: Scheikl et al. 2023"},
      {"plan_done", "1", kHigher, false,
       "share of the plan within the body that a cut has come within its tolerance of", kOwn},
      {"margin_least", "m", kHigher, false,
       "least distance at rest of the cut from the target; below 0 it goes through it", kOwn},
      {"margin_mean", "m", kHigher, false, "mean of that distance, by area", kOwn},
      {"clip_distance", "m", kLower, false,
       "distance at rest of the middle of the target from that of the jaws of the farthest clip", kOwn},
      {"drops", "1", kLower, false,
       "picks that ended because their hand's stream fell silent, tissue that slipped out of jaws, and bodies of "
       "put_on "
       "that are on no obstacle half a second after they were let go of",
       kOwn},
      {"out_of_view", "1", kLower, false,
       "times that a body that a pick or jaws have held, and that none holds any more, is outside of the task's view "
       "by "
       "its centre of mass; ten times a second",
       kOwn},
      {"grasps", "1", kLower, false, "times that a pick or jaws took hold of tissue", kOwn},
      {"picks_at_once", "1", kLower, false, "most picks that hold tissue at a time, locked ones too", kOwn},
      {"drop_height", "m", kLower, false,
       "most by which the centre of mass of a body that a pick or jaws have held sinks below where it has been since "
       "it was let "
       "go of; ten times a second",
       kOwn},
      {"undos", "1", kLower, false, "cuts that were taken back", kOwn},
      {"torn", "1", kLower, false, "events of attachments that tore", kOwn},
      {"leaks", "1", kLower, false, "filled cavities that were opened", kOwn},
      {"bleeding_time", "s", kLower, false,
       "time in which a piece of a vessel has been cut, is held or attached somewhere and bears no clip; vessels are "
       "the "
       "bodies that stages want clips on",
       kOwn},
      {"forbidden_contacts", "1", kLower, false,
       "times that a tool came to where it must not be, or that forbidden tissue was cut", kUsual},
      {"forbidden_time", "s", kLower, false, "time in which a tool is where it must not be", kUsual},
      {"instrument_crossings", "1", kLower, false,
       "times that two tools meet: the lines from their hands to where they work come nearer to each other than their "
       "radii together, in a step or on the way of it; 2.5 mm, of an instrument of 5 mm, and of the push sphere its "
       "own",
       kOwn},
      {"hands_share", "1", kHigher, false,
       "path of the second longest of the hands over the path of all: 0.5 where two do the same", kOwn},
      {"hands_overlap", "1", kHigher, false, "time in which two hands move or more, over the time in which one does",
       kOwn},
  };
  return table;
}

const std::vector<std::string>& metricNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const MetricRow& row : metricTable()) {
      if (!row.per_hand) all.push_back(row.name);
      for (std::size_t h = 0; row.per_hand && h < kHands; ++h)
        all.push_back(std::string(row.name) + "." + toString(static_cast<Hand>(h)));
    }
    return all;
  }();
  return names;
}

const MetricRow* findMetric(const std::string& name) {
  if (std::find(metricNames().begin(), metricNames().end(), name) == metricNames().end()) return nullptr;
  const std::string row_name = name.substr(0, name.find('.'));
  for (const MetricRow& row : metricTable())
    if (row_name == row.name) return &row;
  return nullptr;
}

void Metrics::end() {
  for (HandMotion& hand : hands_) hand.end(dt_);
}

void Metrics::feed(const TrainingFrame& frame) {
  dt_ = frame.dt;
  time_ += frame.dt;
  watch(frame, wall_, watched_);
  feedHands(frame);
  force_ = 0.0;
  double together = 0.0;
  std::size_t picks = 0;
  for (const TrainingFrame::Tool& tool : frame.tools) {
    picks += tool.kind == ToolKind::kPick;
    force_ = std::max(force_, tool.force);
    together += tool.force;
  }
  picks_at_once_ = std::max(picks_at_once_, picks);
  if (force_ > kPressing) {
    force_peak_ = std::max(force_peak_, force_);
    together_peak_ = std::max(together_peak_, together);
    together_sum_ += together * frame.dt;
    force_sum_ += force_ * frame.dt;
    force_for_ += frame.dt;
    if (force_ > limits_.force) force_above_ += frame.dt;
  }
  findStrokes(frame);
  feedEvents(frame);
  feedStrain(frame);
  feedDrops(frame);
  feedLaidDown(frame);
  feedView(frame);
  crossings_.feed(frame.tools);
  if (bleeds(frame)) bled_for_ += frame.dt;
  if (!limits_.forbidden.empty()) feedForbidden(frame);
}

void Metrics::feedHands(const TrainingFrame& frame) {
  std::array<const TrainingFrame::Tool*, kHands> tools{};
  // Who moves a locked pick has it in the hand.
  const auto stays = [&](const TrainingFrame::Tool& tool) {
    const auto before = pick_places_.find(tool.pick);
    return tool.locked && (before == pick_places_.end() || before->second == tool.position);
  };
  // A pick stays in its hand; a new one comes into the first that is empty.
  for (PickId& held : picks_) {
    const auto still = std::find_if(frame.tools.begin(), frame.tools.end(), [&](const TrainingFrame::Tool& tool) {
      return tool.kind == ToolKind::kPick && !stays(tool) && tool.pick == held;
    });
    if (still == frame.tools.end()) held = 0;
  }
  for (const TrainingFrame::Tool& tool : frame.tools) {
    if (tool.kind == ToolKind::kPush) tools[static_cast<std::size_t>(Hand::kPush)] = &tool;
    if (tool.kind == ToolKind::kScissors) tools[static_cast<std::size_t>(Hand::kScissors)] = &tool;
    if (tool.kind == ToolKind::kInstrument) {
      const auto rest = rests_.emplace(tool.pick, tool.position).first;
      auto held = std::find(instruments_.begin(), instruments_.end(), tool.pick);
      if (held == instruments_.end() && rest->second != tool.position)
        held = std::find(instruments_.begin(), instruments_.end(), std::nullopt);
      if (held == instruments_.end()) continue;
      *held = tool.pick;
      tools[static_cast<std::size_t>(Hand::kInstrument) + static_cast<std::size_t>(held - instruments_.begin())] =
          &tool;
    }
    if (tool.kind != ToolKind::kPick || stays(tool)) continue;
    auto hand = std::find(picks_.begin(), picks_.end(), tool.pick);
    if (hand == picks_.end()) hand = std::find(picks_.begin(), picks_.end(), PickId{0});
    if (hand == picks_.end()) continue;  // a third one
    if (*hand == 0) hands_[static_cast<std::size_t>(hand - picks_.begin())].leave(frame.dt);
    *hand = tool.pick;
    tools[static_cast<std::size_t>(hand - picks_.begin())] = &tool;
  }
  pick_places_.clear();
  for (const TrainingFrame::Tool& tool : frame.tools)
    if (tool.kind == ToolKind::kPick) pick_places_[tool.pick] = tool.position;
  std::size_t moving = 0;
  for (std::size_t h = 0; h < kHands; ++h) {
    places_[h] = tools[h] ? std::optional<Vec3>(tools[h]->position) : std::nullopt;
    hands_[h].feed(places_[h], tools[h] ? tools[h]->turned : std::nullopt, frame.dt);
    moving += hands_[h].moves();
  }
  (moving == 0 ? idle_ : any_moves_) += frame.dt;
  if (moving > 1) both_move_ += frame.dt;
}

void Metrics::feedEvents(const TrainingFrame& frame) {
  const auto once = [](std::size_t& count, std::optional<Deed>& last, const Event& event) {
    const Deed deed(event.step, event.command);
    count += last != deed;
    last = deed;
  };
  for (const Event& event : frame.events) switch (event.type) {
      case EventType::kCut:
        once(cuts_, last_cut_, event);
        break;
      case EventType::kIncised:
        if (!goes_on_[static_cast<std::size_t>(&event - frame.events.data())]) once(strokes_, last_stroke_, event);
        break;
      case EventType::kUndone:
        once(undos_, last_undo_, event);
        break;
      case EventType::kPicked:
      case EventType::kGrasped:
        ++grasps_;
        break;
      case EventType::kTorn:
        ++torn_;
        break;
      case EventType::kLeak:
        // Pieces of one body, NAME.1 and NAME.2, each have a part of the same cavity.
        if (event.text.find(" is open") != std::string::npos)
          opened_.emplace(event.step, event.body.substr(0, event.body.rfind('.')), event.cavity);
        break;
      case EventType::kLifted:
        drops_ += event.pick != 0;
        break;
      case EventType::kDropped:
        ++drops_;
        break;
      default:
        break;
    }
}

void Metrics::findStrokes(const TrainingFrame& frame) {
  goes_on_.clear();
  for (const Event& event : frame.events) {
    const bool blades = event.type == EventType::kIncised && !event.instrument.empty();
    const auto before = blades ? snipped_.find(event.instrument) : snipped_.end();
    goes_on_.push_back(before != snipped_.end() && event.sim_time < before->second + kBetweenStrokes);
    if (blades) snipped_[event.instrument] = event.sim_time;
  }
}

void Metrics::watch(const TrainingFrame& frame, double& wall, double& watched) {
  if (frame.wall >= wall_before_) wall += frame.wall - wall_before_;  // NaN: nobody watches
  if (std::isfinite(frame.wall)) watched += frame.dt;
  wall_before_ = frame.wall;
}

void Metrics::settle(const TrainingFrame& frame) {
  watch(frame, settle_wall_, settle_watched_);
  feedStrain(frame);
}

void Metrics::feedDrops(const TrainingFrame& frame) {
  if (!frame.centres) return;
  centres_known_ = true;
  for (const TrainingFrame::Body& body : frame.bodies) {
    const double height = -frame.down.dot(body.centre);
    const bool held = std::any_of(frame.tools.begin(), frame.tools.end(), [&](const TrainingFrame::Tool& tool) {
      return !tool.body.empty() && tool.body == body.name;
    });
    const auto found = held ? heights_.try_emplace(body.number).first : heights_.find(body.number);
    if (found == heights_.end()) continue;
    double& was = found->second;
    was = held ? height : std::max(was, height);
    dropped_ = std::max(dropped_, was - height);
  }
}

void Metrics::feedLaidDown(const TrainingFrame& frame) {
  for (const std::string& name : limits_.placed) {
    LaidDown& down = laid_down_[name];
    const bool held = std::any_of(frame.tools.begin(), frame.tools.end(),
                                  [&](const TrainingFrame::Tool& tool) { return tool.body == name; });
    for (const Event& event : frame.events)
      if (event.body == name && (event.type == EventType::kDropped || (event.type == EventType::kLifted && event.pick)))
        down.slipped = true;
    if (held) {
      down.since.reset();
      if (!down.held) down.slipped = false;
    } else if (down.held && !down.slipped) {
      down.since = time_;
    }
    down.held = held;
    if (!down.since || !frame.places) continue;
    const auto body = std::find_if(frame.bodies.begin(), frame.bodies.end(),
                                   [&](const TrainingFrame::Body& one) { return one.name == name; });
    const bool on = body != frame.bodies.end() && !body->around.empty();
    const bool late = time_ > *down.since + kLaidDown - 1e-9;
    if (!on && late) ++drops_;
    if (on || late) down.since.reset();
  }
}

void Metrics::feedView(const TrainingFrame& frame) {
  if (!limits_.view || !frame.centres) return;
  for (const TrainingFrame::Body& body : frame.bodies) {
    const bool held = std::any_of(frame.tools.begin(), frame.tools.end(),
                                  [&](const TrainingFrame::Tool& tool) { return tool.body == body.name; });
    const auto found = held ? seen_.try_emplace(body.number, true).first : seen_.find(body.number);
    if (found == seen_.end()) continue;
    const bool seen = held || limits_.view->contains(body.centre);
    out_of_view_ += found->second && !seen;
    found->second = seen;
  }
}

void Metrics::feedStrain(const TrainingFrame& frame) {
  touched_any_ = touched_any_ || force_ > kPressing ||
                 std::any_of(frame.events.begin(), frame.events.end(), [](const Event& event) {
                   return event.type == EventType::kPicked || event.type == EventType::kTouched ||
                          event.type == EventType::kGrasped || event.type == EventType::kCut ||
                          event.type == EventType::kIncised || event.type == EventType::kClipped ||
                          event.type == EventType::kDetached;
                 });
  double strained = 0.0;
  for (const TrainingFrame::Body& body : frame.bodies) {
    if (body.strains.empty()) continue;
    strain_known_ = true;
    OwnStrain& own = own_strains_[body.number];
    if (own.model != body.model) own = ownStrainOf(body);
    double all = 0.0, beyond = 0.0;
    for (std::size_t c = 0; c < body.strains.size(); ++c) {
      if (!touched_any_) own.most[c] = std::max(own.most[c], body.strains[c]);
      const double more = body.strains[c] - own.most[c], mass = tissuePart(*body.model, static_cast<Index>(c)).mass;
      strain_peak_ = std::max(strain_peak_, more);
      all += mass;
      if (more > limits_.strain) beyond += mass;
    }
    if (all > 0.0) strained += beyond / all * body.model->rest_volume;
  }
  strained_ = std::max(strained_, strained);
}

Metrics::OwnStrain Metrics::ownStrainOf(const TrainingFrame::Body& body) const {
  OwnStrain own{body.name, body.model, {}, std::vector<double>(body.strains.size(), 0.0)};
  for (Index c = 0; c < tissueParts(*body.model); ++c)
    own.centres.push_back(body.placed * tissuePart(*body.model, c).centre);
  // The nearest of its parents.
  const OwnStrain* parent = nullptr;
  for (const auto& [number, other] : own_strains_)
    if (other.model && isOf(body.name, other.body) && (!parent || other.body.size() > parent->body.size()))
      parent = &other;
  if (!parent) return own;
  const NearestPoints nearest(parent->centres);
  for (std::size_t c = 0; c < own.centres.size(); ++c) own.most[c] = parent->most[nearest.nearest(own.centres[c])];
  return own;
}

void Metrics::feedForbidden(const TrainingFrame& frame) {
  std::set<std::string> touched, cut;
  for (const Forbidden& forbidden : limits_.forbidden) {
    const bool there = std::any_of(frame.tools.begin(), frame.tools.end(), [&](const TrainingFrame::Tool& tool) {
      return forbidden.body.empty() ? forbidden.region.contains(tool.position) : isOf(tool.body, forbidden.body);
    });
    if (there && touched.insert(forbidden.name).second) forbidden_ += !touched_.count(forbidden.name);
    if (forbidden.body.empty()) continue;
    for (const Event& event : frame.events) {
      if (event.type != EventType::kCut && event.type != EventType::kIncised) continue;
      if (!isOf(event.body, forbidden.body)) continue;
      forbidden_ += !goes_on_[static_cast<std::size_t>(&event - frame.events.data())];
      cut.insert(forbidden.name);
    }
  }
  if (!touched.empty()) forbidden_for_ += frame.dt;
  touched.insert(cut.begin(), cut.end());
  touched_ = std::move(touched);
}

bool Metrics::bleeds(const TrainingFrame& frame) const {
  const auto isVessel = [&](const TrainingFrame::Body& body) {
    return std::any_of(limits_.vessels.begin(), limits_.vessels.end(),
                       [&](const std::string& vessel) { return isOf(body.name, vessel); });
  };
  const auto isClipped = [&](const TrainingFrame::Body& body) {
    return std::any_of(frame.joints.begin(), frame.joints.end(), [&](const TrainingFrame::Joint& joint) {
      return joint.clip && std::find(joint.ends.begin(), joint.ends.end(), body.name) != joint.ends.end();
    });
  };
  // What nothing holds any more, as what was cut out between two clips, is supplied by nothing.
  const auto isSupplied = [&](const TrainingFrame::Body& body) {
    return body.model->isHeld() ||
           std::any_of(frame.joints.begin(), frame.joints.end(), [&](const TrainingFrame::Joint& joint) {
             return !joint.clip && joint.fibres > 0 &&
                    std::find(joint.ends.begin(), joint.ends.end(), body.name) != joint.ends.end();
           });
  };
  if (limits_.vessels.empty()) return false;
  return std::any_of(frame.bodies.begin(), frame.bodies.end(), [&](const TrainingFrame::Body& body) {
    return body.model->next_patch > 1 && isVessel(body) && isSupplied(body) && !isClipped(body);
  });
}

std::vector<MetricValue> Metrics::values(const RestTissue& tissue, std::size_t stages) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<MetricValue> all;
  all.reserve(metricNames().size());
  for (const std::string& name : metricNames()) all.push_back({name, kNone});
  const auto set = [&](const char* name, double value) {
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const MetricValue& metric) { return metric.name == name; });
    assert(found != all.end());
    found->value = value;
  };
  double paths = 0.0;
  std::array<double, kHands> sorted{};
  for (std::size_t h = 0; h < kHands; ++h) {
    const HandMotion& hand = hands_[h];
    sorted[h] = hand.path();
    paths += hand.path();
    if (!hand.seen()) continue;
    const auto of = [&](const char* row, double value) {
      set((std::string(row) + "." + toString(static_cast<Hand>(h))).c_str(), value);
    };
    of("path_length", hand.path());
    of("economy", hand.economy());
    of("workspace", hand.workspace());
    of("mean_speed", hand.meanSpeed());
    of("top_speed", hand.fastest());
    of("movements", static_cast<double>(hand.movements()));
    of("sparc", hand.sparc());
    of("ldlj", hand.jerk());
    of("tremor", hand.tremor());
    if (static_cast<Hand>(h) >= Hand::kScissors) of("angular_path", hand.angularPath());
  }
  std::sort(sorted.begin(), sorted.end());
  set("time", time_);
  if (wall_ > 0.0) {
    set("wall_time", wall_);
    set("real_time_factor", realTimeFactor());
  }
  set("idle_time", idle_);
  set("stages", static_cast<double>(stages));
  set("force_mean", force_for_ > 0.0 ? force_sum_ / force_for_ : kNone);
  set("force_peak", force_peak_);
  set("impulse", force_sum_);
  set("force_together_peak", together_peak_);
  set("force_together_mean", force_for_ > 0.0 ? together_sum_ / force_for_ : kNone);
  if (std::isfinite(limits_.force)) set("force_time_above", force_above_);
  if (strain_known_) {
    set("strain_peak", strain_peak_);
    set("strained_volume", strained_);
  }
  set("volume_removed", tissue.volumeRemoved());
  set("healthy_share", tissue.healthyShare());
  set("target_left", tissue.targetLeft());
  set("cut_area", tissue.cutArea());
  set("cuts", static_cast<double>(cuts_));
  set("strokes", static_cast<double>(strokes_));
  set("plan_rms", tissue.planRms());
  set("plan_hausdorff", tissue.planHausdorff());
  set("off_plan_area", tissue.offPlanArea());
  set("plan_done", tissue.planDone());
  set("margin_least", tissue.marginLeast());
  set("margin_mean", tissue.marginMean());
  set("clip_distance", tissue.clipDistance());
  set("drops", static_cast<double>(drops_));
  set("out_of_view", limits_.view && centres_known_ ? static_cast<double>(out_of_view_) : kNone);
  set("picks_at_once", static_cast<double>(picks_at_once_));
  set("grasps", static_cast<double>(grasps_));
  if (centres_known_) set("drop_height", dropped_);
  set("undos", static_cast<double>(undos_));
  set("torn", static_cast<double>(torn_));
  set("leaks", static_cast<double>(opened_.size()));
  set("bleeding_time", limits_.vessels.empty() ? kNone : bled_for_);
  set("instrument_crossings", static_cast<double>(crossings_.count()));
  set("forbidden_contacts", limits_.forbidden.empty() ? kNone : static_cast<double>(forbidden_));
  set("forbidden_time", limits_.forbidden.empty() ? kNone : forbidden_for_);
  set("hands_share", paths > 0.0 ? sorted[kHands - 2] / paths : kNone);
  set("hands_overlap", any_moves_ > 0.0 ? both_move_ / any_moves_ : kNone);
  return all;
}

}  // namespace meshless
