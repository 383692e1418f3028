// What was cut and what was taken away, in the rest shape: there a cut stays where it was made, however the tissue
// lies.
#pragma once

#include <limits>
#include <map>
#include <memory>
#include <optional>

#include "meshless_surgery/geometry/query/nearest.h"
#include "meshless_surgery/geometry/query/region.h"
#include "meshless_surgery/training/frame.h"

namespace meshless {

/// Where a cut should go, in the rest shape where the scene puts it: the rectangle origin + s * along + t * out with
/// 0 <= s <= length, -depth <= t <= 0, as far as it is in the body. Of a line that has corners one such rectangle a
/// part.
struct CutPlan {
  std::string body;
  Vec3 origin = Vec3::Zero();  // [m]
  Vec3 along = Vec3::UnitX();  // unit
  Vec3 out = Vec3::UnitZ();    // unit, normal to along, out of the tissue
  double length = 0.0;         // [m] > 0
  double depth = 0.0;          // [m] > 0
  double tolerance = 0.002;    // [m] > 0
  Points line;                 // [m] the corners, two or more; origin, along and length are then not used

  /// The rectangles.
  std::vector<CutPlan> parts() const;
  /// [m] to the one rectangle, without a line.
  double distance(const Vec3& p) const;
  bool closed() const { return line.size() > 2 && line.front() == line.back(); }
  /// Normal to the one rectangle; zero where there are several.
  Vec3 side() const { return line.empty() ? Vec3(along.cross(out)) : Vec3(Vec3::Zero()); }
};

/// Tissue that is to be taken out: what of a body lies in a box, a sphere or below a plane, in the rest shape.
struct Target {
  std::string body;
  Region region;
  Vec3 middle() const;  // [m] of a plane: its point
};

/// Points of cut faces that stand for even areas.
struct CutPoints {
  Points points;                             // [m] in the rest shape
  std::vector<double> areas;                 // [m^2] of a face
  std::vector<Index> faces;                  // one a point: which of these it is of
  std::vector<std::array<Vec3, 3>> corners;  // [m] of the faces

  void add(const CutPoints& other);
};

class RestTissue {
 public:
  RestTissue(std::optional<CutPlan> plan, std::optional<Target> target, std::optional<Box> tray)
      : plan_(std::move(plan)), target_(std::move(target)), tray_(std::move(tray)) {
    if (plan_) rectangles_ = plan_->parts();
  }

  void feed(const TrainingFrame& frame);
  /// A frame needs centres for it: what lies in the tray counts as taken away.
  bool wantsCentres() const { return tray_.has_value(); }

  /// [m^2] of one side of all cuts.
  double cutArea() const { return 0.5 * cut_area_; }

  // Of the plan; NaN without one, or before there is a cut.
  double planRms() const;        // [m] of the cut from the plan
  double planHausdorff() const;  // [m] the farther of: the cut from the plan, the plan in the body from the cut
  double offPlanArea() const;    // [m^2] of the cut, farther from the plan than its tolerance
  /// 0..1: of the plan in the body, what a cut has come within the tolerance of. Before there is a cut: 0.
  double planDone() const;
  const Points& planPoints() const { return plan_points_; }    // [m] in the body
  const Points& planOutline() const { return plan_outline_; }  // [m] ends of lines: planOutlineOn() it
  const CutPoints& cut() const { return cut_; }

  // Of the target; NaN without one.
  double volumeRemoved() const { return removed_volume_; }  // [m^3]
  double healthyShare() const;                              // of what was removed
  double targetLeft() const;                                // share of the target
  double marginLeast() const;                               // [m] from the target to the cut; below 0: through it
  double marginMean() const;
  double clipDistance() const { return clip_distance_; }  // [m] of the farthest clip from the target's middle
  /// The piece that has the target's middle lies in the tray, or is gone.
  bool targetRemoved() const { return target_removed_; }

 private:
  struct Piece {
    std::string name;
    std::uint32_t number = 0;
    BodyModelPtr model;
    Pose placed;
    TriangleMesh rest() const;
  };
  void begin(const TrainingFrame& frame);
  void measureCut();
  void measureRemoved();
  double targetIn(const Piece& piece);
  bool hasTargetsMiddle(const Piece& piece);

  std::optional<CutPlan> plan_;
  std::vector<CutPlan> rectangles_;
  double planDistance(const Vec3& p) const;  // [m]
  std::optional<Target> target_;
  std::optional<Box> tray_;
  bool begun_ = false;
  std::vector<Piece> pieces_, gone_, in_tray_;
  Points plan_points_, plan_outline_;
  CutPoints cut_;
  double cut_area_ = 0.0, plan_squares_ = 0.0, plan_area_ = 0.0, plan_most_ = 0.0, off_plan_ = 0.0;
  double plan_done_ = 0.0, margin_least_ = 0.0, margin_sum_ = 0.0, margin_area_ = 0.0;
  double removed_volume_ = 0.0, removed_target_ = 0.0, whole_target_ = 0.0;
  bool target_removed_ = false;
  double clip_distance_ = std::numeric_limits<double>::quiet_NaN();
  std::map<const BodyModel*, std::pair<BodyModelPtr, double>> targets_;  // kept alive, so that none is another's
  std::map<const BodyModel*, std::pair<BodyModelPtr, bool>> middles_;
};

/// The plan's points [m] inside a closed surface.
Points planPointsIn(const CutPlan& plan, const TriangleMesh& solid);
/// Ends of short lines [m], two each: where the plan meets a closed surface, up to its tolerance beyond its upper edge,
/// and the plan's edges inside of it.
Points planOutlineOn(const CutPlan& plan, const TriangleMesh& solid);
/// Of the cut faces.
CutPoints cutPointsOf(const TriangleMesh& mesh, double spacing);

}  // namespace meshless
