#include "meshless_surgery/training/rest_tissue.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/nearest_on_triangle.h"
#include "volume_within.h"

namespace meshless {
namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
constexpr double kFinest = 0.001;  // [m] between points
constexpr double kMostPoints = 20000.0;
constexpr std::size_t kCandidates = 8;
constexpr int kMostSplits = 64;          // of an edge of a triangle
constexpr double kOutlineParts = 200.0;  // of a body's diagonal

double spacingFor(double area) { return std::max(kFinest, std::sqrt(area / kMostPoints)); }

double cutAreaOf(const TriangleMesh& mesh) {
  std::vector<Triangle> cut;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (isCutPatch(mesh.patchOf(t))) cut.push_back(mesh.triangles[t]);
  return surfaceArea(mesh.vertices, cut);
}

/// [m] from a region, below 0 inside. The height of a box is less than that beside its edges.
double marginOf(const Region& region, const Vec3& p) {
  const double height = region.height(p);
  if (region.kind != Region::Kind::kBox || height <= 0.0) return height;
  return (region.box.min - p).cwiseMax(p - region.box.max).cwiseMax(0.0).norm();
}

/// Of the plan's rectangle what is within the solid's bounds, so that a plan without end has as many points: from s0 to
/// s1 along it, from t0 to t1 out of it.
std::array<double, 4> rectangleWithin(const CutPlan& plan, const TriangleMesh& solid) {
  double s0 = plan.length, s1 = 0.0, t0 = 0.0, t1 = -plan.depth;
  for (const Vec3& p : solid.vertices) {
    s0 = std::min(s0, (p - plan.origin).dot(plan.along));
    s1 = std::max(s1, (p - plan.origin).dot(plan.along));
    t0 = std::min(t0, (p - plan.origin).dot(plan.out));
    t1 = std::max(t1, (p - plan.origin).dot(plan.out));
  }
  return {std::max(s0, 0.0), std::min(s1, plan.length), std::max(t0, -plan.depth), std::min(t1, 0.0)};
}

}  // namespace

Vec3 Target::middle() const {
  if (region.kind == Region::Kind::kSphere) return region.centre;
  if (region.kind == Region::Kind::kBox) return 0.5 * (region.box.min + region.box.max);
  return region.plane.point;
}

std::vector<CutPlan> CutPlan::parts() const {
  if (line.empty()) return {*this};
  std::vector<CutPlan> all;
  for (std::size_t k = 0; k + 1 < line.size(); ++k) {
    CutPlan part = *this;
    part.line.clear();
    part.origin = line[k];
    part.length = (line[k + 1] - line[k]).norm();
    part.along = (line[k + 1] - line[k]) / part.length;
    part.out = (out - out.dot(part.along) * part.along).normalized();
    all.push_back(std::move(part));
  }
  return all;
}

double CutPlan::distance(const Vec3& p) const {
  const Vec3 from = p - origin;
  const double s = from.dot(along), t = from.dot(out);
  const Vec3 nearest = std::clamp(s, 0.0, length) * along + std::clamp(t, -depth, 0.0) * out;
  return (from - nearest).norm();
}

double RestTissue::planDistance(const Vec3& p) const {
  double least = std::numeric_limits<double>::infinity();
  for (const CutPlan& rectangle : rectangles_) least = std::min(least, rectangle.distance(p));
  return least;
}

Points planPointsIn(const CutPlan& plan, const TriangleMesh& solid) {
  Points inside;
  if (!plan.line.empty()) {
    for (const CutPlan& part : plan.parts()) {
      const Points points = planPointsIn(part, solid);
      inside.insert(inside.end(), points.begin(), points.end());
    }
    return inside;
  }
  if (solid.empty()) return inside;
  const auto [s0, s1, t0, t1] = rectangleWithin(plan, solid);
  if (!(s1 > s0 && t1 > t0)) return inside;
  const double spacing = std::max(kFinest, std::sqrt((s1 - s0) * (t1 - t0) / 4000.0));
  const int ns = std::max(1, static_cast<int>(std::ceil((s1 - s0) / spacing)));
  const int nt = std::max(1, static_cast<int>(std::ceil((t1 - t0) / spacing)));
  const SolidQuery query(solid);
  for (int i = 0; i < ns; ++i)
    for (int j = 0; j < nt; ++j) {
      const Vec3 p =
          plan.origin + (s0 + (s1 - s0) * (i + 0.5) / ns) * plan.along + (t0 + (t1 - t0) * (j + 0.5) / nt) * plan.out;
      if (query.contains(p)) inside.push_back(p);
    }
  return inside;
}

namespace {

/// Of one rectangle; with its edges in the depth, where the line begins and ends.
Points outlineOf(const CutPlan& plan, const TriangleMesh& solid, bool begins, bool ends_here) {
  Points ends;
  if (solid.empty()) return ends;
  const Vec3 normal = plan.along.cross(plan.out);
  const double spacing = std::max(kFinest, boundsOf(solid.vertices).diagonal() / kOutlineParts);
  const auto add = [&](const Vec3& from, const Vec3& to, const auto& wanted) {
    const int parts = std::max(1, static_cast<int>(std::ceil((to - from).norm() / spacing)));
    for (int k = 0; k < parts; ++k) {
      const Vec3 a = from + k * (to - from) / parts, b = from + (k + 1) * (to - from) / parts;
      if (!wanted(a) || !wanted(b)) continue;
      ends.push_back(a);
      ends.push_back(b);
    }
  };
  // On the surface. An edge in the plan is the upper side of one of its faces only.
  for (const Triangle& triangle : solid.triangles) {
    Points crossed;
    for (int k = 0; k < 3; ++k) {
      const Vec3 &a = solid.vertices[triangle[k]], &b = solid.vertices[triangle[(k + 1) % 3]];
      const double of_a = normal.dot(a - plan.origin), of_b = normal.dot(b - plan.origin);
      if ((of_a >= 0.0) != (of_b >= 0.0)) crossed.push_back(a + of_a / (of_a - of_b) * (b - a));
    }
    if (crossed.size() != 2) continue;
    double first = 0.0, last = 1.0;
    const Vec3 way = crossed[1] - crossed[0];
    const auto keepBelow = [&](double at, double slope, double most) {
      if (at > most && !(slope < 0.0)) last = -1.0;
      if (slope > 0.0) last = std::min(last, (most - at) / slope);
      if (slope < 0.0) first = std::max(first, (most - at) / slope);
    };
    const double s = (crossed[0] - plan.origin).dot(plan.along), t = (crossed[0] - plan.origin).dot(plan.out);
    keepBelow(s, way.dot(plan.along), plan.length);
    keepBelow(-s, -way.dot(plan.along), 0.0);
    keepBelow(t, way.dot(plan.out), plan.tolerance);
    keepBelow(-t, -way.dot(plan.out), plan.depth);
    if (last > first) add(crossed[0] + first * way, crossed[0] + last * way, [](const Vec3&) { return true; });
  }
  // Inside of it.
  const auto [s0, s1, t0, t1] = rectangleWithin(plan, solid);
  const SolidQuery query(solid);
  const auto at = [&](double s, double t) -> Vec3 { return plan.origin + s * plan.along + t * plan.out; };
  const auto inside = [&](const Vec3& p) { return query.contains(p); };
  if (begins && t1 > t0) add(at(0.0, t0), at(0.0, t1), inside);
  if (ends_here && t1 > t0) add(at(plan.length, t0), at(plan.length, t1), inside);
  for (const double t : {0.0, -plan.depth})
    if (s1 > s0) add(at(s0, t), at(s1, t), inside);
  return ends;
}

}  // namespace

Points planOutlineOn(const CutPlan& plan, const TriangleMesh& solid) {
  if (plan.line.empty()) return outlineOf(plan, solid, true, true);
  Points ends;
  const std::vector<CutPlan> parts = plan.parts();
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const Points lines = outlineOf(parts[k], solid, k == 0 && !plan.closed(), k + 1 == parts.size() && !plan.closed());
    ends.insert(ends.end(), lines.begin(), lines.end());
  }
  return ends;
}

void CutPoints::add(const CutPoints& other) {
  const auto first = static_cast<Index>(corners.size());
  points.insert(points.end(), other.points.begin(), other.points.end());
  areas.insert(areas.end(), other.areas.begin(), other.areas.end());
  for (const Index face : other.faces) faces.push_back(first + face);
  corners.insert(corners.end(), other.corners.begin(), other.corners.end());
}

CutPoints cutPointsOf(const TriangleMesh& mesh, double spacing) {
  CutPoints cut;
  for (std::size_t k = 0; k < mesh.triangles.size(); ++k) {
    if (!isCutPatch(mesh.patchOf(k))) continue;
    const Triangle& t = mesh.triangles[k];
    const Vec3 &a = mesh.vertices[t[0]], ab = mesh.vertices[t[1]] - a, ac = mesh.vertices[t[2]] - a;
    const double area = 0.5 * ab.cross(ac).norm();
    if (!(area > 0.0)) continue;
    const double longest = std::max({ab.norm(), ac.norm(), (ac - ab).norm()});
    const int n = std::clamp(static_cast<int>(std::ceil(longest / spacing)), 1, kMostSplits);
    const auto face = static_cast<Index>(cut.corners.size());
    cut.corners.push_back({a, a + ab, a + ac});
    // n * n equal triangles, by their middles.
    for (int i = 0; i < n; ++i)
      for (int j = 0; i + j < n; ++j)
        for (int half = 0; half < (i + j + 1 < n ? 2 : 1); ++half) {
          const double u = (i + (half ? 2.0 : 1.0) / 3.0) / n, v = (j + (half ? 2.0 : 1.0) / 3.0) / n;
          cut.points.push_back(a + u * ab + v * ac);
          cut.areas.push_back(area / (static_cast<double>(n) * n));
          cut.faces.push_back(face);
        }
  }
  return cut;
}

TriangleMesh RestTissue::Piece::rest() const {
  TriangleMesh mesh = model->surface;
  for (Vec3& p : mesh.vertices) p = placed * p;
  return mesh;
}

void RestTissue::feed(const TrainingFrame& frame) {
  if (!begun_) begin(frame);
  bool changed = pieces_.size() != frame.bodies.size();
  for (std::size_t k = 0; k < pieces_.size() && !changed; ++k)
    changed = pieces_[k].number != frame.bodies[k].number || pieces_[k].model != frame.bodies[k].model;
  if (changed) {
    for (const Event& event : frame.events) {
      if (event.removed) gone_.push_back({event.body, 0, event.removed, event.placed});
      if (event.type == EventType::kUndone || event.type == EventType::kRestored)  // it is whole again
        gone_.erase(std::remove_if(gone_.begin(), gone_.end(),
                                   [&](const Piece& piece) { return isOf(piece.name, event.body); }),
                    gone_.end());
    }
    pieces_.clear();
    for (const TrainingFrame::Body& body : frame.bodies)
      pieces_.push_back({body.name, body.number, body.model, body.placed});
    measureCut();
  }
  bool moved = changed;
  if (tray_ && frame.sampled) {
    std::vector<Piece> lying;
    for (std::size_t k = 0; k < frame.bodies.size(); ++k)
      if (tray_->contains(frame.bodies[k].centre)) lying.push_back(pieces_[k]);
    moved = moved || lying.size() != in_tray_.size();
    for (std::size_t k = 0; k < lying.size() && !moved; ++k) moved = lying[k].number != in_tray_[k].number;
    in_tray_ = std::move(lying);
  }
  if (moved) measureRemoved();
  clip_distance_ = kNothing;
  for (const TrainingFrame::Joint& joint : frame.joints)
    if (target_ && joint.clip) {
      const double away = (*joint.clip - target_->middle()).norm();
      clip_distance_ = std::isnan(clip_distance_) ? away : std::max(clip_distance_, away);
    }
}

void RestTissue::begin(const TrainingFrame& frame) {
  begun_ = true;
  for (const TrainingFrame::Body& body : frame.bodies) {
    const Piece piece{body.name, body.number, body.model, body.placed};
    if (plan_ && isOf(body.name, plan_->body)) {
      const Points inside = planPointsIn(*plan_, piece.rest());
      plan_points_.insert(plan_points_.end(), inside.begin(), inside.end());
      const Points outline = planOutlineOn(*plan_, piece.rest());
      plan_outline_.insert(plan_outline_.end(), outline.begin(), outline.end());
    }
    if (target_ && isOf(body.name, target_->body)) whole_target_ += targetIn(piece);
  }
}

void RestTissue::measureCut() {
  cut_ = {};
  cut_area_ = 0.0;
  double planned = 0.0;
  std::vector<const Piece*> all;
  for (const Piece& piece : pieces_) all.push_back(&piece);
  for (const Piece& piece : gone_) all.push_back(&piece);
  std::vector<const Piece*> of_plan;
  for (const Piece* piece : all) {
    if (piece->model->next_patch <= 1) continue;  // never cut
    const double area = cutAreaOf(piece->model->surface);
    cut_area_ += area;
    if ((plan_ && isOf(piece->name, plan_->body)) || (target_ && isOf(piece->name, target_->body))) {
      of_plan.push_back(piece);
      planned += area;
    }
  }
  for (const Piece* piece : of_plan) cut_.add(cutPointsOf(piece->rest(), spacingFor(planned)));
  plan_squares_ = plan_area_ = plan_most_ = off_plan_ = plan_done_ = 0.0;
  margin_sum_ = margin_area_ = 0.0;
  margin_least_ = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < cut_.points.size(); ++k) {
    const double area = cut_.areas[k];
    if (plan_) {
      const double distance = planDistance(cut_.points[k]);
      plan_squares_ += area * distance * distance;
      plan_area_ += area;
      plan_most_ = std::max(plan_most_, distance);
      if (distance > plan_->tolerance) off_plan_ += area;
    }
    if (target_) {
      const double margin = marginOf(target_->region, cut_.points[k]);
      margin_least_ = std::min(margin_least_, margin);
      margin_sum_ += area * margin;
      margin_area_ += area;
    }
  }
  if (!plan_ || cut_.points.empty() || plan_points_.empty()) return;
  const NearestPoints nearest(cut_.points);
  std::size_t done = 0;
  for (const Vec3& p : plan_points_) {
    // Of the faces that the nearest points are of: the points themselves lie beside the place.
    double distance = std::numeric_limits<double>::infinity();
    for (const Index k : nearest.nearest(p, kCandidates)) {
      const auto& [a, b, c] = cut_.corners[cut_.faces[k]];
      distance = std::min(distance, (nearestOnTriangle(p, a, b, c) - p).norm());
    }
    plan_most_ = std::max(plan_most_, distance);
    done += distance <= plan_->tolerance;
  }
  plan_done_ = static_cast<double>(done) / static_cast<double>(plan_points_.size());
}

double RestTissue::targetIn(const Piece& piece) {
  const auto [found, is_new] = targets_.try_emplace(piece.model.get(), piece.model, 0.0);
  if (is_new) found->second.second = volumeWithin(piece.rest(), target_->region);
  return found->second.second;
}

bool RestTissue::hasTargetsMiddle(const Piece& piece) {
  const auto [found, is_new] = middles_.try_emplace(piece.model.get(), piece.model, false);
  if (is_new) found->second.second = SolidQuery(piece.rest()).contains(target_->middle());
  return found->second.second;
}

void RestTissue::measureRemoved() {
  removed_volume_ = removed_target_ = 0.0;
  target_removed_ = false;
  for (const std::vector<Piece>* pieces : {&gone_, &in_tray_})
    for (const Piece& piece : *pieces) {
      if (target_ && !isOf(piece.name, target_->body)) continue;
      removed_volume_ += piece.model->rest_volume;
      if (!target_) continue;
      removed_target_ += targetIn(piece);
      target_removed_ = target_removed_ || hasTargetsMiddle(piece);
    }
}

double RestTissue::planRms() const { return plan_area_ > 0.0 ? std::sqrt(plan_squares_ / plan_area_) : kNothing; }
double RestTissue::planHausdorff() const { return plan_area_ > 0.0 ? plan_most_ : kNothing; }
double RestTissue::planDone() const { return plan_ ? plan_done_ : kNothing; }
double RestTissue::offPlanArea() const { return plan_ ? 0.5 * off_plan_ : kNothing; }
double RestTissue::marginLeast() const { return margin_area_ > 0.0 ? margin_least_ : kNothing; }
double RestTissue::marginMean() const { return margin_area_ > 0.0 ? margin_sum_ / margin_area_ : kNothing; }

double RestTissue::healthyShare() const {
  if (!target_ || !(removed_volume_ > 0.0)) return kNothing;
  return std::max(0.0, 1.0 - removed_target_ / removed_volume_);
}

double RestTissue::targetLeft() const {
  if (!target_ || !(whole_target_ > 0.0)) return kNothing;
  return std::clamp(1.0 - removed_target_ / whole_target_, 0.0, 1.0);
}

}  // namespace meshless
