// The numbers that say how a task was done. Fed with frames alone: live and replayed they are equal to the bit.
#pragma once

#include <array>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "meshless_surgery/training/hand_motion.h"
#include "meshless_surgery/training/rest_tissue.h"
#include "meshless_surgery/training/tool_crossings.h"

namespace meshless {

enum class Better { kLower, kHigher };

struct MetricRow {
  const char* name;
  const char* unit;  // "1": a number
  Better better;
  bool per_hand;        // then its name is followed by a point and a hand's
  const char* formula;  // in words
  const char* source;
};
/// Every metric; docs/metrics.md shows it.
const std::vector<MetricRow>& metricTable();
/// Every name that a value has, in the table's order: those of hands for each hand.
const std::vector<std::string>& metricNames();
/// By one of those names; null without.
const MetricRow* findMetric(const std::string& name);

struct MetricValue {
  std::string name;
  double value = std::numeric_limits<double>::quiet_NaN();  // NaN: there was nothing to measure
};

/// Where tools must not be: a body's tissue, or a region of the world.
struct Forbidden {
  std::string name;
  std::string body;  // empty: the region
  Region region;
};

/// What metrics are measured against.
struct MetricLimits {
  double force = std::numeric_limits<double>::infinity();  // [N]
  double strain = 0.5;                                     // [1]
  std::vector<Forbidden> forbidden;
  std::vector<std::string> vessels;  // bodies that bleed where they are cut and bear no clip
  std::vector<std::string> placed;   // bodies that are to be put on obstacles
  std::optional<Box> view;           // [m] what can be seen
};

class Metrics {
 public:
  explicit Metrics(MetricLimits limits) : limits_(std::move(limits)) {}

  void feed(const TrainingFrame& frame);
  /// Instead of it before the task begins: what the scene does by itself.
  void settle(const TrainingFrame& frame);
  /// There are no more frames: movements that go on end here.
  void end();

  double time() const { return time_; }      // [s]
  double force() const { return force_; }    // [N] the largest of the tools' in the last step
  double wallTime() const { return wall_; }  // [s] that somebody could watch
  double realTimeFactor() const { return wall_ > 0.0 ? watched_ / wall_ : 1.0; }
  /// Whether the world, with what it did by itself before, ran slower than that over more than so many seconds.
  bool slowerThan(double factor, double for_seconds) const {
    return wall_ + settle_wall_ > for_seconds && watched_ + settle_watched_ < factor * (wall_ + settle_wall_);
  }
  double forcePeak() const { return force_peak_; }  // [N]
  double strainPeak() const { return strain_peak_; }
  /// Tools that are where they must not be, now: the names of the limits.
  const std::set<std::string>& touched() const { return touched_; }
  const HandMotion& motion(Hand hand) const { return hands_[static_cast<std::size_t>(hand)]; }
  /// Of the last step; none where there is no such hand.
  const std::optional<Vec3>& place(Hand hand) const { return places_[static_cast<std::size_t>(hand)]; }

  /// In the order of metricNames(). `stages`: how many were met.
  std::vector<MetricValue> values(const RestTissue& tissue, std::size_t stages) const;

 private:
  void watch(const TrainingFrame& frame, double& wall, double& watched);
  void feedHands(const TrainingFrame& frame);
  void findStrokes(const TrainingFrame& frame);
  void feedEvents(const TrainingFrame& frame);
  void feedForbidden(const TrainingFrame& frame);
  void feedStrain(const TrainingFrame& frame);
  void feedDrops(const TrainingFrame& frame);
  void feedLaidDown(const TrainingFrame& frame);
  void feedView(const TrainingFrame& frame);
  bool bleeds(const TrainingFrame& frame) const;

  MetricLimits limits_;
  std::array<HandMotion, kHands> hands_;
  std::array<PickId, 2> picks_{};        // in the two hands that pick
  std::map<std::uint32_t, Vec3> rests_;  // [m] where instruments were first, that have not been moved
  std::array<std::optional<std::uint32_t>, 2> instruments_;  // the first two that were
  std::map<PickId, Vec3> pick_places_;                       // [m] of all, in the frame before
  std::array<std::optional<Vec3>, kHands> places_;
  double dt_ = 1.0, time_ = 0.0, idle_ = 0.0, any_moves_ = 0.0, both_move_ = 0.0;
  double force_ = 0.0, force_peak_ = 0.0, force_sum_ = 0.0, force_for_ = 0.0, force_above_ = 0.0;
  double together_peak_ = 0.0, together_sum_ = 0.0;                               // of all tools
  double wall_ = 0.0, watched_ = 0.0, settle_wall_ = 0.0, settle_watched_ = 0.0;  // [s]
  double wall_before_ = std::numeric_limits<double>::quiet_NaN();                 // [s]
  double strain_peak_ = 0.0, strained_ = 0.0;
  bool strain_known_ = false, touched_any_ = false;  // any tissue, since the start
  /// Of a body, one a cluster: the most that it had before any tissue was touched. Pieces have those of their parents.
  struct OwnStrain {
    std::string body;
    BodyModelPtr model;
    Points centres;  // [m] of the clusters in the rest shape, where the scene puts it
    std::vector<double> most;
  };
  OwnStrain ownStrainOf(const TrainingFrame::Body& body) const;
  std::map<std::uint32_t, OwnStrain> own_strains_;  // by the numbers of bodies
  std::map<std::uint32_t, double> heights_;  // [m] of bodies that were held: the highest since they were let go of
  bool centres_known_ = false;
  double dropped_ = 0.0;  // [m]
  /// Of a body that is to be put on an obstacle.
  struct LaidDown {
    bool held = false, slipped = false;  // slipped: its drop has been counted
    std::optional<double> since;         // [s] it was let go of, and is on no obstacle yet
  };
  std::map<std::string, LaidDown> laid_down_;
  std::map<std::uint32_t, bool> seen_;  // of bodies that were held, by their numbers: in view, or in a hand
  std::size_t out_of_view_ = 0;
  std::size_t cuts_ = 0, strokes_ = 0, undos_ = 0, torn_ = 0, drops_ = 0, grasps_ = 0, picks_at_once_ = 0,
              forbidden_ = 0;
  using Deed = std::pair<std::uint64_t, std::uint64_t>;  // step and command
  std::optional<Deed> last_cut_, last_stroke_, last_undo_;
  std::map<std::string, double> snipped_;  // [s] when blades in a hand last cut, by the names of instruments
  std::vector<char> goes_on_;              // one an event of the frame: such blades go on with their stroke
  std::set<std::tuple<std::uint64_t, std::string, std::uint32_t>> opened_;  // cavities: step, body, patch
  double forbidden_for_ = 0.0, bled_for_ = 0.0;
  ToolCrossings crossings_;
  std::set<std::string> touched_;
};

}  // namespace meshless
