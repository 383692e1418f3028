#include "meshless_surgery/training/frame.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/tools/grasp.h"

namespace meshless {
namespace {

constexpr double kSampleRate = 10.0;  // [Hz] of what costs something
constexpr double kShaft = 0.0025;     // [m] radius: instruments are 5 mm thick
constexpr int kDirections = 72;

bool isSampled(std::uint64_t step, double step_rate) {
  const auto every = static_cast<std::uint64_t>(std::max(1.0, std::round(step_rate / kSampleRate)));
  return step % every == 0;
}

Quat orientationOf(const ScissorBlades& blades) {
  Mat3 axes;
  axes << blades.x_axis, blades.y_axis, blades.x_axis.cross(blades.y_axis);
  return Quat(axes).normalized();
}

Vec3 centreOfMass(const BodyModel& model, const Points& positions) {
  Vec3 sum = Vec3::Zero();
  double mass = 0.0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    sum += model.masses[i] * positions[i];
    mass += model.masses[i];
  }
  return mass > 0.0 ? Vec3(sum / mass) : sum;
}

}  // namespace

const char* toString(Hand hand) {
  switch (hand) {
    case Hand::kPick:
      return "pick";
    case Hand::kSecondPick:
      return "pick_2";
    case Hand::kPush:
      return "push";
    case Hand::kScissors:
      return "scissors";
    case Hand::kInstrument:
      return "instrument";
    case Hand::kSecondInstrument:
      return "instrument_2";
  }
  return "unknown";
}

bool isOf(const std::string& body, const std::string& whole) {
  return body.compare(0, whole.size(), whole) == 0 && (body.size() == whole.size() || body[whole.size()] == '.');
}

namespace {

// Whether a line goes through a triangle, so far from its origin.
bool axisMeets(const Triangle& triangle, const Points& surface, const Vec3& origin, const Vec3& axis, double low,
               double high) {
  const Vec3 a = surface[triangle[0]] - origin, b = surface[triangle[1]] - origin, c = surface[triangle[2]] - origin;
  const double parts[] = {axis.dot(b.cross(c)), axis.dot(c.cross(a)), axis.dot(a.cross(b))};
  const double sum = parts[0] + parts[1] + parts[2];
  if (sum == 0.0 || parts[0] * sum < 0.0 || parts[1] * sum < 0.0 || parts[2] * sum < 0.0) return false;
  const double at = axis.dot(parts[0] * a + parts[1] * b + parts[2] * c) / sum;
  return at >= low && at <= high;
}

}  // namespace

bool isAround(const TriangleMesh& obstacle, const Points& surface, const std::vector<Triangle>& triangles) {
  if (obstacle.vertices.empty()) return false;
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : obstacle.vertices) mean += p / static_cast<double>(obstacle.vertices.size());
  Mat3 spread = Mat3::Zero();
  for (const Vec3& p : obstacle.vertices) spread += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(spread);
  const Vec3 axis = axes.eigenvectors().col(2), u = axes.eigenvectors().col(0), v = axis.cross(u);
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Vec3& p : obstacle.vertices) {
    low = std::min(low, axis.dot(p - mean));
    high = std::max(high, axis.dot(p - mean));
  }
  // Directions from the axis in which there is tissue.
  std::array<bool, kDirections> met{};
  const auto between = [&](const Vec3& p) { return axis.dot(p - mean) >= low && axis.dot(p - mean) <= high; };
  const auto direction = [&](const Vec3& p) { return std::atan2(v.dot(p - mean), u.dot(p - mean)); };
  for (const Triangle& triangle : triangles) {
    if (axisMeets(triangle, surface, mean, axis, low, high)) return false;
    for (int k = 0; k < 3; ++k) {
      const Vec3 &a = surface[triangle[k]], &b = surface[triangle[(k + 1) % 3]];
      if (!between(a) || !between(b)) continue;
      const double from = direction(a), way = std::remainder(direction(b) - from, 2.0 * M_PI);
      const double first = std::min(from, from + way) + 2.0 * M_PI, part = 2.0 * M_PI / kDirections;
      const int last = static_cast<int>((first + std::abs(way)) / part);
      for (int n = static_cast<int>(first / part); n <= last; ++n)
        met[static_cast<std::size_t>(n % kDirections)] = true;
    }
  }
  return std::all_of(met.begin(), met.end(), [](bool there) { return there; });
}

// Largest change of a length, over that length.
double strainOf(const Mat3& deformation) {
  const Vec3 squares = Eigen::SelfAdjointEigenSolver<Mat3>()
                           .computeDirect(deformation.transpose() * deformation, Eigen::EigenvaluesOnly)
                           .eigenvalues();
  return (squares.cwiseMax(0.0).cwiseSqrt().array() - 1.0).abs().maxCoeff();
}

Index tissueParts(const BodyModel& model) {
  return model.cells ? static_cast<Index>(model.cells->cells.size()) : model.clusters.size();
}

TissuePart tissuePart(const BodyModel& model, Index part) {
  if (!model.cells) return {model.shape.clusters[part].mass, model.shape.clusters[part].centre};
  const ElasticCell& cell = model.cells->cells[part];
  return {cell.mass, model.lattice->restPlace(model.lattice->cells[part], 0.5 * (cell.centroid + Vec3::Ones()))};
}

std::vector<double> strainsOf(const BodyModel& model, const Points& positions) {
  std::vector<double> strains(tissueParts(model), 0.0);
  if (model.cells) {
    for (Index c = 0; c < strains.size(); ++c) {
      // Of a crumb of tissue little is told by the corners of its cell.
      const LatticeCell& cell = model.lattice->cells[c];
      if (cell.samples == kNoSample || cell.isBridge(c)) continue;
      strains[c] = strainOf(gradientOf(model.cells->cells[c], model.cells->half_edge, positions));
    }
    return strains;
  }
  std::vector<ClusterPose> poses(model.clusters.size());
  fitClusters(matchInput(model), positions, poses);
  for (Index c = 0; c < strains.size(); ++c)
    if (model.shape.clusters[c].linear_rank) strains[c] = strainOf(poses[c].deformation);
  return strains;
}

// The obstacles that a body is around.
std::vector<std::string> aroundWhat(const WorldSnapshot& shot, const BodySnapshot& body) {
  std::vector<std::string> names;
  const Box box = boundsOf(body.surface);
  for (const auto& obstacle : shot.obstacles)
    if (boundsOf(obstacle->mesh.vertices).overlaps(box) &&
        isAround(obstacle->mesh, body.surface, body.model->surface.triangles))
      names.push_back(obstacle->name);
  return names;
}

// Where a body is in the picture of an endoscope.
TrainingFrame::Shown shownBy(const Instrument& endoscope, const BodySnapshot& body, const WorldSnapshot& shot) {
  TrainingFrame::Shown shown;
  shown.body = body.name;
  const Pose sight = sightOf(endoscope.def, endoscope.pose);
  const Box box = boundsOf(body.surface);
  const Vec3 middle = 0.5 * (box.min + box.max), way = middle - sight.translation;
  double radius = 0.0;
  for (const Vec3& p : body.surface) radius = std::max(radius, (p - middle).norm());
  const double distance = way.norm(), half = 0.5 * endoscope.def.field_of_view;
  const Vec3 along = sight.rotation * Vec3::UnitX();
  shown.off_centre = std::atan2(along.cross(way).norm(), along.dot(way)) / half;
  shown.fills = distance > radius ? std::asin(radius / distance) / half : std::numeric_limits<double>::infinity();
  const auto meets = [&](const Points& vertices, const std::vector<Triangle>& triangles) {
    const RayHit hit = castRay(vertices, triangles, sight.translation, way);
    return hit.hit && hit.distance < distance;
  };
  shown.hidden =
      std::any_of(shot.bodies.begin(), shot.bodies.end(),
                  [&](const BodySnapshot& other) {
                    return other.number != body.number && meets(other.surface, other.model->surface.triangles);
                  }) ||
      std::any_of(shot.obstacles.begin(), shot.obstacles.end(),
                  [&](const auto& obstacle) { return meets(obstacle->mesh.vertices, obstacle->mesh.triangles); });
  return shown;
}

TrainingFrame frameOf(World& world, std::vector<Event> events, const FrameWants& wants) {
  TrainingFrame frame;
  SnapshotWants parts;
  frame.sampled = wants.any() && isSampled(world.stepCount(), world.settings().step_rate);
  frame.centres = frame.sampled && wants.centres;
  frame.places = frame.sampled && !wants.placed.empty();
  parts.particles = frame.centres || (frame.sampled && wants.strains);
  frame.pictures = frame.sampled && !wants.seen.empty();
  parts.surfaces = frame.places || frame.pictures;
  parts.touches = !wants.placed.empty();
  const WorldSnapshot shot = world.snapshot(parts);
  frame.step = shot.step;
  frame.run = shot.run;
  frame.time = shot.sim_time;
  frame.dt = 1.0 / world.settings().step_rate;
  frame.wall = world.wallTime();
  if (world.settings().gravity.norm() > 0.0) frame.down = world.settings().gravity.normalized();
  frame.events = std::move(events);
  for (const Pick& pick : shot.picks) {
    const auto body = shot.pick_bodies.find(pick.id);
    const std::string held = body == shot.pick_bodies.end() ? "" : body->second;
    frame.tools.push_back({ToolKind::kPick, pick.id, pick.locked, held, pick.target, std::nullopt, pick.position,
                           kShaft, pick.force.norm(), pick.position});
  }
  if (shot.push.enabled) {
    const Vec3& force = shot.push.force;  // on the sphere
    const Vec3 foremost = force.norm() > 0.0 ? Vec3(-shot.push.radius * force.normalized()) : Vec3(Vec3::Zero());
    frame.tools.push_back({ToolKind::kPush, 0, false, "", shot.push.position, std::nullopt, shot.push.position,
                           shot.push.radius, force.norm(), shot.push.position + foremost});
  }
  if (shot.scissors.shown) {
    const ScissorBlades& blades = shot.scissors.blades;
    const Vec3 tips = blades.origin + blades.length * blades.x_axis;
    frame.tools.push_back(
        {ToolKind::kScissors, 0, false, "", blades.origin, orientationOf(blades), tips, kShaft, 0.0, tips});
  }
  for (const Instrument& of : shot.instruments) {
    const Vec3 end = of.pose * Vec3(-of.def.shaft_length - (of.def.hasJaws() ? of.def.jaw_length : 0.0), 0.0, 0.0);
    frame.tools.push_back({ToolKind::kInstrument, of.number, false, of.holds, of.pose.translation, of.pose.rotation,
                           end, of.def.shaft_radius, of.force.norm(), of.pose.translation});
    if (!frame.pictures || of.def.type != InstrumentType::kEndoscope) continue;
    for (const BodySnapshot& body : shot.bodies)
      if (std::find(wants.seen.begin(), wants.seen.end(), body.name) != wants.seen.end())
        frame.tools.back().shown.push_back(shownBy(of, body, shot));
  }
  for (const BodySnapshot& body : shot.bodies) {
    frame.bodies.push_back({body.name, body.number, body.model, body.placed, Vec3::Zero()});
    const bool placed = std::any_of(wants.placed.begin(), wants.placed.end(),
                                    [&](const std::string& whole) { return isOf(body.name, whole); });
    if (placed) {
      frame.bodies.back().supported = std::any_of(body.touches.begin(), body.touches.end(), [&](const auto& name) {
        return std::none_of(shot.instruments.begin(), shot.instruments.end(),
                            [&](const Instrument& of) { return of.def.name == name; });
      });
      if (frame.places) frame.bodies.back().around = aroundWhat(shot, body);
    }
    if (!frame.sampled) continue;
    if (wants.centres) frame.bodies.back().centre = centreOfMass(*body.model, body.particles);
    if (wants.strains) frame.bodies.back().strains = strainsOf(*body.model, body.particles);
  }
  for (const AttachmentSnapshot& joint : shot.attachments)
    frame.joints.push_back(
        {joint.name, joint.ends, joint.fibres, joint.jaws ? std::optional<Vec3>(joint.rest_place) : std::nullopt});
  return frame;
}

bool isError(EventType type) {
  return type == EventType::kLifted || type == EventType::kUndone || type == EventType::kLeak ||
         type == EventType::kTorn || type == EventType::kMisfired;
}

bool isShown(EventType type) {
  return isError(type) || type == EventType::kPicked || type == EventType::kLocked || type == EventType::kReleased ||
         type == EventType::kCut || type == EventType::kIncised || type == EventType::kRemoved ||
         type == EventType::kClipped;
}

}  // namespace meshless
