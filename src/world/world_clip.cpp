// Clips: two jaws that close what is hollow between them. Their fibres join opposite walls and draw them together.
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include "line_search.h"
#include "meshless_surgery/base/number_text.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr int kAcross = 30;             // fibres, where a lumen is as wide as the jaws open
constexpr int kMostRows = 300;          // of fibres along the vessel
constexpr double kJawSpeed = 0.02;      // [m/s] at which they close, so that no energy jumps in
constexpr double kShut = 0.03;          // of the lumen's width stays, so that contact within does not fight the jaws
constexpr double kStiffness = 20.0;     // of the jaws, in that of tissue as thick as the lumen is wide
constexpr double kTissue = 1e5;         // [Pa] what counts for the modulus of an appearance material
constexpr double kAlong = 0.8;          // cosine: jaws that close so nearly along the vessel are not across it
constexpr double kBesideJaws = 2.5e-4;  // [m] that their lines are drawn beside the tissue

std::string metres(double value) { return numberText(value, 3); }

Status check(const ClipCommand& command) {
  if (!command.point.allFinite()) return notFinite("point");
  if (!command.direction.allFinite()) return notFinite("direction");
  if (!(command.direction.norm() > 0.0 && command.direction.norm() <= 1e6))
    return outOfRange("the length of direction", command.direction.norm(), "above 0 to 1e6");
  if (!(command.opening > 0.0 && command.opening <= 1000.0))
    return outOfRange("opening", command.opening, "above 0 to 1000 m");
  const double most = command.opening * kMostRows / kAcross;
  if (!(command.width > 0.0 && command.width <= most))
    return outOfRange("width", command.width, "above 0 to " + metres(most) + " m, ten times the opening");
  return Done{};
}

/// Across the vessel, whose way is the one along which its surface is turned least; x is zero where it is none.
LineFrame jawsAt(const ShownSurface& shown, const Vec3& at, const Vec3& direction, double reach) {
  LineFrame jaws;
  Mat3 turns = Mat3::Zero();
  Vec3 middle = Vec3::Zero();
  double area = 0.0;
  for (Index face = 0; face < shown.surface->triangles.size(); ++face) {
    const Vec3 centre = shown.at(face, Vec3::Constant(1.0 / 3.0)), normal = shown.areaOf(face);
    if (!((centre - at).norm() <= reach) || !(normal.norm() > 0.0)) continue;
    turns += normal * normal.transpose() / normal.norm();
    middle += normal.norm() * centre;
    area += normal.norm();
  }
  jaws.axes[2] = direction.normalized();
  const Vec3 along = Eigen::SelfAdjointEigenSolver<Mat3>(turns).eigenvectors().col(0);
  if (!(area > 0.0) || !(std::abs(along.dot(jaws.axes[2])) < kAlong)) {
    jaws.axes[0].setZero();
    return jaws;
  }
  jaws.axes[0] = (along - along.dot(jaws.axes[2]) * jaws.axes[2]).normalized();
  jaws.axes[1] = jaws.axes[2].cross(jaws.axes[0]);
  middle /= area;
  jaws.centre = middle + (at - middle).dot(jaws.axes[0]) * jaws.axes[0];
  for (const int k : {2, 1}) {  // of what was near, to the middle of the whole
    const LineFrame turned{jaws.centre, {jaws.axes[(k + 1) % 3], jaws.axes[(k + 2) % 3], jaws.axes[k]}};
    LineSearch line(shown, turned, 0.0, 0.0);
    Box met;
    for (const Crossing& crossing : line.through(0.0, 0.0))
      if (std::abs(crossing.at) <= 2.0 * reach) met.extend(Vec3::Constant(crossing.at));
    if (!met.empty()) jaws.centre += 0.5 * (met.min.x() + met.max.x()) * jaws.axes[k];
  }
  return jaws;
}

}  // namespace

Result<Reply> World::Impl::apply(const ClipCommand& command) {
  if (Status status = check(command); !status) return status.error();
  if (!command.body.empty() && !find(command.body))
    return Error{ErrorCode::kUnknownName, "there is no body '" + command.body + "'; " + knownBodies()};
  const double half = 0.5 * command.opening;
  WorldBody* body = nullptr;
  ShownSurface shown;
  double nearest = std::numeric_limits<double>::infinity();
  Vec3 at = Vec3::Zero();
  for (const auto& some : bodies) {
    if (!command.body.empty() && some->name != command.body) continue;
    ShownSurface of_some = shownNow(*some);
    if (of_some.surface->triangles.empty()) continue;
    const NearestFace there = FaceSearch(of_some).nearest(command.point, nearest);
    if (there.face == kNoIndex || !(there.distance < nearest)) continue;
    nearest = there.distance;
    at = of_some.at(there.face, there.shares);
    body = some.get();
    shown = std::move(of_some);
  }
  if (!body) return Error{ErrorCode::kMissed, "there is no tissue to clip"};
  if (!(nearest <= half))
    return Error{ErrorCode::kMissed, "no tissue within " + metres(half) +
                                         " m of the point, half of opening; the nearest, '" + body->name + "', is " +
                                         metres(nearest) + " m away"};
  if (!body->model->solid)
    return Error{ErrorCode::kUnsuitableShape, "'" + body->name + "' cannot be clipped: its surface is open"};
  const LineFrame jaws = jawsAt(shown, at, command.direction, half);
  if (jaws.axes[0].isZero(0.0))
    return Error{ErrorCode::kInvalidArgument,
                 "direction lies along '" + body->name + "'; accepted: across it, for the jaws to close on it"};

  const double step = command.opening / kAcross;
  const int rows = std::clamp(static_cast<int>(std::ceil(command.width / step)), 2, kMostRows);
  Clip clip;
  Attachment made;
  double thickest = 0.0;
  LineSearch lines(shown, jaws, 0.5 * command.width, half);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < kAcross; ++column) {
      const double x = ((row + 0.5) / rows - 0.5) * command.width, y = (column + 0.5) * step - half;
      const std::vector<Crossing>& met = lines.through(x, y);
      double tissue = 0.0, low = half, high = -half;  // of what is not between the jaws alone
      bool within = true, hollow = false;
      for (std::size_t n = 0; n + 1 < met.size(); ++n) {
        if (met[n].in == met[n + 1].in) continue;
        const double length = met[n + 1].at - met[n].at;
        const bool between = met[n].at >= -half && met[n + 1].at <= half;
        const bool touches = met[n].at < half && met[n + 1].at > -half;
        if (met[n].in) {
          if (!touches) continue;
          tissue += length;
          low = std::min(low, met[n].at);
          high = std::max(high, met[n + 1].at);
          within = within && between;
          continue;
        }
        if (!between) continue;
        hollow = true;
        Fibre fibre;
        fibre.a = fibre.b = body->id;
        fibre.at_a = pointOn(*shown.surface, met[n].face);
        fibre.at_b = pointOn(*shown.surface, met[n + 1].face);
        fibre.area = command.width / rows * step;
        const double wide = (fibre.at_a.of(body->state.positions) - fibre.at_b.of(body->state.positions)).norm();
        fibre.rest = wide;
        clip.jaws = std::max(clip.jaws, fibre.rest);
        made.fibres.push_back(std::move(fibre));
      }
      if (met.size() > 1) thickest = std::max(thickest, met.back().at - met.front().at);
      if (hollow && !within)
        return Error{ErrorCode::kMissed, "'" + body->name + "' reaches " + metres(std::max(high, -low)) +
                                             " m from the middle of the jaws: it is " + metres(high - low) +
                                             " m thick there, and its middle " + metres(0.5 * std::abs(high + low)) +
                                             " m beside theirs; accepted: up to " + metres(half) +
                                             " m, half of opening, with direction across the vessel"};
      if (hollow && (column == 0 || column + 1 == kAcross))
        return Error{ErrorCode::kMissed, "'" + body->name + "' is wider there than the jaws, which reach across " +
                                             metres(command.opening) + " m"};
      if (hollow) clip.tissue = std::max(clip.tissue, tissue);
    }
  if (made.fibres.empty())
    return Error{ErrorCode::kMissed, "nothing hollow is between the jaws: '" + body->name + "' is " + metres(thickest) +
                                         " m thick there, and they open to " + metres(command.opening) + " m"};
  Result<std::string> name = newAttachmentName(command.name, body->name + "-clip");
  if (!name) return name.error();

  // From here nothing fails.
  made.name = *name;
  made.made = static_cast<std::uint32_t>(made.fibres.size());
  clip.closed = std::max(kShut * clip.jaws, kSkin * body->edge_length);
  made.stiffness = kStiffness * (body->material.elastic() ? body->material.youngs_modulus : kTissue) / clip.jaws;
  made.clip = clip;
  ClipReply reply{made.name, body->name, made.fibres.size(), clip.jaws};
  wake(*body);
  say(EventType::kClipped, body->name, 0,
      "'" + made.name + "' closes a lumen of " + body->name + " that is " + metres(clip.jaws) + " m wide");
  keepAttachment(std::move(made));
  return Reply(reply);
}

void World::Impl::closeClips(double h_frame) {
  for (Attachment& attachment : attachments) {
    if (!attachment.clip || !(attachment.clip->jaws > attachment.clip->closed)) continue;
    double& jaws = attachment.clip->jaws;
    jaws = std::max(attachment.clip->closed, jaws - kJawSpeed * h_frame);
    for (Fibre& fibre : attachment.fibres) fibre.rest = std::min(fibre.rest, jaws);
  }
}

std::vector<std::array<Vec3, 2>> World::Impl::jawLines(const Attachment& clip) {
  std::vector<std::array<Vec3, 2>> lines;
  if (clip.fibres.empty()) return lines;
  Points middles;
  Vec3 mean = Vec3::Zero();
  for (const Fibre& fibre : clip.fibres) {
    const Points ends = fibreEnds(fibre);
    middles.push_back(0.5 * (ends[0] + ends[1]));
    mean += middles.back() / static_cast<double>(clip.fibres.size());
  }
  Mat3 spread = Mat3::Zero();
  for (const Vec3& p : middles) spread += (p - mean) * (p - mean).transpose();
  const Vec3 normal = Eigen::SelfAdjointEigenSolver<Mat3>(spread).eigenvectors().col(0);
  const double row = 2.5 * std::sqrt(clip.fibres.front().area);  // neighbours of a row are no farther apart
  for (const double side : {-1.0, 1.0}) {
    const Vec3 beside = side * (0.5 * (clip.clip->tissue + clip.clip->jaws) + kBesideJaws) * normal;
    for (std::size_t n = 0; n + 1 < middles.size(); ++n)
      if ((middles[n + 1] - middles[n]).norm() < row) lines.push_back({middles[n] + beside, middles[n + 1] + beside});
  }
  return lines;
}

}  // namespace meshless
