#include "meshless_surgery/tools/instrument.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/mesh/add_part.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kSides = 10;  // of a shaft
constexpr int kEdgePoints = 6;
constexpr double kJawSpeed = 10.0;     // [rad/s] of a hand
constexpr double kTurnSpeed = 50.0;    // [rad/s] likewise
constexpr double kJawTime = 0.01;      // [s] in which a jaw gives way to what it cannot hold
constexpr double kPivot = 1e-3;        // [m] of the tip from a trocar: nearer it has no direction
constexpr double kFarthestPose = 1e6;  // [m]
constexpr double kNoUp = 1e-6;         // [rad] of a line of sight from the vertical
constexpr double kMostPoints = 20000.0;
constexpr double kJawYield = 0.05;  // [rad] by which the hand closes more than the jaws for all of their grip

/// A capsule along x from `from` to 0: rings of kSides vertices.
TriangleMesh capsule(double from, double radius) {
  TriangleMesh mesh;
  std::vector<std::array<double, 2>> rings;  // x, radius
  constexpr int kCap = 3;
  for (int k = 1; k <= kCap; ++k)
    rings.push_back({from + radius * (1.0 - std::cos(0.5 * kPi * k / kCap)), radius * std::sin(0.5 * kPi * k / kCap)});
  const double length = -from - 2.0 * radius;
  const int pieces = std::max(1, static_cast<int>(std::ceil(length / (2.0 * radius))));
  for (int k = 1; k <= pieces; ++k) rings.push_back({from + radius + length * k / pieces, radius});
  for (int k = 1; k < kCap; ++k)
    rings.push_back({-radius + radius * std::sin(0.5 * kPi * k / kCap), radius * std::cos(0.5 * kPi * k / kCap)});
  mesh.vertices.push_back({from, 0.0, 0.0});
  for (const auto& [x, r] : rings)
    for (int s = 0; s < kSides; ++s) {
      const double angle = 2.0 * kPi * s / kSides;
      mesh.vertices.push_back({x, r * std::cos(angle), r * std::sin(angle)});
    }
  mesh.vertices.push_back({0.0, 0.0, 0.0});
  const Index last = static_cast<Index>(mesh.vertices.size() - 1);
  const auto at = [](std::size_t ring, int side) { return static_cast<Index>(1 + ring * kSides + side % kSides); };
  for (int s = 0; s < kSides; ++s) {
    mesh.triangles.push_back({0, at(0, s + 1), at(0, s)});
    mesh.triangles.push_back({last, at(rings.size() - 1, s), at(rings.size() - 1, s + 1)});
    for (std::size_t r = 0; r + 1 < rings.size(); ++r) {
      mesh.triangles.push_back({at(r, s), at(r, s + 1), at(r + 1, s + 1)});
      mesh.triangles.push_back({at(r, s), at(r + 1, s + 1), at(r + 1, s)});
    }
  }
  return mesh;
}

TriangleMesh moved(TriangleMesh mesh, const Pose& by) {
  for (Vec3& p : mesh.vertices) p = by * p;
  return mesh;
}

Pose byTurn(double about_z, const Vec3& shift) { return {Quat(Eigen::AngleAxisd(about_z, Vec3::UnitZ())), shift}; }

Quat turnOf(const Vec3& turn) {
  const double angle = turn.norm();
  return angle > 0.0 ? Quat(Eigen::AngleAxisd(angle, turn / angle)) : Quat::Identity();
}
/// [rad] the shorter way.
Vec3 turnVector(const Quat& turn) {
  const Eigen::AngleAxisd by(turn.w() < 0.0 ? Quat(-turn.coeffs()) : turn);
  return by.angle() * by.axis();
}

/// What a hand draws, as a mass on a spring and a damper with the hand at their other end.
struct Drawn {
  double stiffness, damping, most;  // most: of the force of the hand

  /// The way in h [s] of what has `mass`, went with `speed`, bears `load`, is `behind` the hand, which goes by `way`.
  Vec3 step(double mass, const Vec3& speed, const Vec3& load, const Vec3& behind, const Vec3& way, double h,
            double& answers) const {
    const double inert = mass / (h * h), damped = damping / h;
    const Vec3 thrown = inert * h * speed + load;  // [N]
    const Vec3 go = (thrown + stiffness * (behind + way) + damped * way) / (inert + damped + stiffness);
    const Vec3 drawn = stiffness * (behind + way - go) + damped * (way - go);
    const double force = drawn.norm();
    answers = inert + damped + (force <= most ? stiffness : 0.0);
    if (force <= most) return go;
    return (thrown + most / force * drawn) / (inert + damped);  // gives way, as slowly as it is damped
  }
  /// What would hold it where it is [N], of the same.
  Vec3 toHold(double mass, const Vec3& speed, const Vec3& load, const Vec3& behind, const Vec3& way, double h) const {
    const Vec3 drawn = stiffness * (behind + way) + damping / h * way;
    const double force = drawn.norm();
    return -(mass / h * speed + load + (force > most ? most / force : 1.0) * drawn);
  }
};

/// Turns what is there, as little as it takes, so that its shaft goes through a point.
void aimFrom(const Vec3& centre, Pose& pose) {
  const Vec3 along = pose.translation - centre;
  if (!(along.norm() > kPivot)) return;
  pose.rotation = (Quat::FromTwoVectors(pose.rotation * Vec3::UnitX(), along) * pose.rotation).normalized();
}

}  // namespace

const std::array<InstrumentNumber, 17> kInstrumentNumbers{
    {{"shaft_radius", &InstrumentDef::shaft_radius, 1e-4, 0.1, "m"},
     {"shaft_length", &InstrumentDef::shaft_length, 1e-3, 10.0, "m"},
     {"jaw_length", &InstrumentDef::jaw_length, 1e-3, 1.0, "m"},
     {"jaw_width", &InstrumentDef::jaw_width, 1e-4, 0.5, "m"},
     {"jaw_thickness", &InstrumentDef::jaw_thickness, 1e-4, 0.5, "m"},
     {"friction", &InstrumentDef::friction, 0.0, 10.0, ""},
     {"stiffness", &InstrumentDef::stiffness, 1.0, 1e6, "N/m"},
     {"damping", &InstrumentDef::damping, 0.1, 1e5, "N s/m"},
     {"angular_stiffness", &InstrumentDef::angular_stiffness, 1e-3, 1e5, "N m/rad"},
     {"angular_damping", &InstrumentDef::angular_damping, 1e-4, 1e4, "N m s/rad"},
     {"max_force", &InstrumentDef::max_force, 0.01, 1e4, "N"},
     {"max_torque", &InstrumentDef::max_torque, 1e-4, 1e3, "N m"},
     {"max_speed", &InstrumentDef::max_speed, 1e-3, 5.0, "m/s"},
     {"grip", &InstrumentDef::grip, 0.01, 1e3, "N"},
     {"sharpness", &InstrumentDef::sharpness, 0.01, 1.0, ""},
     {"view_angle", &InstrumentDef::view_angle, 0.0, 1.57, "rad"},
     {"field_of_view", &InstrumentDef::field_of_view, 0.1, 2.6, "rad"}}};

const char* toString(InstrumentType type) {
  switch (type) {
    case InstrumentType::kProbe:
      return "probe";
    case InstrumentType::kGrasper:
      return "grasper";
    case InstrumentType::kHook:
      return "hook";
    case InstrumentType::kScissors:
      return "scissors";
    case InstrumentType::kClipApplier:
      return "clip_applier";
    case InstrumentType::kScalpel:
      return "scalpel";
    case InstrumentType::kEndoscope:
      return "endoscope";
  }
  return "unknown";
}

bool isInstrumentName(const std::string& name) {
  const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  for (const char* taken : {"pick", "push", "scissors", "pick_cursor", "push_sphere", "world"})
    if (name == taken) return false;
  return !name.empty() && name.size() <= 40 && letter(name[0]) &&
         std::all_of(name.begin(), name.end(), [&](char c) { return letter(c) || (c >= '0' && c <= '9') || c == '_'; });
}

double InstrumentDef::jawEdge() const {
  return 0.7 * std::min(jaw_thickness, type == InstrumentType::kScissors ? 0.5 * jaw_width : jaw_width);
}

double InstrumentDef::bladeOverlap() const {
  return type == InstrumentType::kScissors ? std::min(0.1 * jaw_length, 0.5 * jaw_thickness) : 0.0;
}

double InstrumentDef::bladeReach() const { return bladeOverlap() + 0.5 * jaw_thickness; }

Status InstrumentDef::validate() const {
  for (const auto& [key, member, least, most, unit] : kInstrumentNumbers)
    if (!(this->*member >= least && this->*member <= most))
      return Error{ErrorCode::kInvalidArgument, std::string(key) + " of instrument '" + name + "' is " +
                                                    numberText(this->*member) + "; accepted: " + numberText(least) +
                                                    " to " + numberText(most) + (*unit ? " " : "") + unit};
  if (!(shaft_length >= 4.0 * shaft_radius))
    return Error{ErrorCode::kInvalidArgument, "shaft_length of instrument '" + name + "' is " +
                                                  numberText(shaft_length) +
                                                  " m; accepted: at least four shaft_radius"};
  const double edge = jawEdge(), l = jaw_length, w = jaw_width, t = jaw_thickness;
  const double points = kSides * (0.5 * (shaft_length + (type == InstrumentType::kHook ? l : 0.0)) / shaft_radius) +
                        (hasJaws() ? 4.0 * (l * w + w * t + t * l) / (edge * edge) : 0.0);
  if (!(points <= kMostPoints))
    return Error{ErrorCode::kInvalidArgument, "instrument '" + name + "' is so long and thin that it has " +
                                                  numberText(points, 3) + " points; accepted: up to " +
                                                  numberText(kMostPoints)};
  if (latch && type != InstrumentType::kGrasper)
    return Error{ErrorCode::kInvalidArgument,
                 "grasp of instrument '" + name + "', a " + toString(type) + ", is latch; accepted: of graspers alone"};
  if (type == InstrumentType::kHook && !(jaw_length >= 2.0 * shaft_radius))
    return Error{ErrorCode::kInvalidArgument, "jaw_length of instrument '" + name + "' is " + numberText(jaw_length) +
                                                  " m; accepted: of a hook, at least two shaft_radius"};
  if (!(pose.translation.norm() <= kFarthestHand) || !(std::abs(pose.rotation.norm() - 1.0) <= 1e-3))
    return Error{ErrorCode::kInvalidArgument,
                 "pose of instrument '" + name + "' is " + numberText(pose.translation.norm()) +
                     " m from the origin, with a quaternion of length " + numberText(pose.rotation.norm()) +
                     "; accepted: up to " + numberText(kFarthestHand) + " m, a length of 1"};
  if (remote_centre && !(remote_centre->norm() <= kFarthestHand))
    return Error{ErrorCode::kInvalidArgument, "remote_centre of instrument '" + name + "' is none; accepted: within " +
                                                  numberText(kFarthestHand) + " m"};
  return Done{};
}

void InstrumentShape::place(const Pose& pose, double jaw, Points& vertices) const {
  const Mat3 turn = pose.rotation.toRotationMatrix();
  const Mat3 half = Eigen::AngleAxisd(0.5 * jaw, Vec3::UnitZ()).toRotationMatrix();
  const Mat3 of_part[] = {turn, turn * half, turn * half.transpose()};
  const Vec3 at_hinge = pose * hinge;
  const Index count = static_cast<Index>(mesh.vertices.size());
  vertices.resize(count + edge.size());
  for (Index v = 0; v < count; ++v) vertices[v] = at_hinge + of_part[parts[v]] * (mesh.vertices[v] - hinge);
  for (Index k = 0; k < edge.size(); ++k) vertices[count + k] = pose * edge[k];
}

InstrumentShape shapeOf(const InstrumentDef& def) {
  InstrumentShape shape;
  const auto add = [&shape](const TriangleMesh& mesh, InstrumentShape::Part part) {
    addPart(mesh, shape.mesh);
    shape.parts.resize(shape.mesh.vertices.size(), part);
  };
  shape.thickness = 2.0 * def.shaft_radius;
  if (def.type == InstrumentType::kProbe || def.type == InstrumentType::kEndoscope)
    add(capsule(-def.shaft_length, def.shaft_radius), InstrumentShape::kShaft);
  if (def.type == InstrumentType::kHook) {
    // The tip is where the hook points; its shaft ends beside it.
    const Vec3 elbow(0.0, -def.jaw_length, 0.0);
    add(moved(capsule(-def.shaft_length, def.shaft_radius), {Quat::Identity(), elbow}), InstrumentShape::kShaft);
    add(moved(capsule(-def.jaw_length, def.shaft_radius), byTurn(0.5 * kPi, Vec3(-def.shaft_radius, 0.0, 0.0))),
        InstrumentShape::kShaft);
  }
  if (def.type == InstrumentType::kScalpel) {
    const Vec3 handle(-def.jaw_length, 0.0, 0.0);
    add(moved(capsule(-def.shaft_length, def.shaft_radius), {Quat::Identity(), handle}), InstrumentShape::kShaft);
    for (int k = 0; k < kEdgePoints; ++k) shape.edge.push_back(k / (kEdgePoints - 1.0) * def.heel());
  }
  if (def.hasJaws()) {
    shape.hinge = Vec3(-def.jaw_length, 0.0, 0.0);
    const bool blades = def.type == InstrumentType::kScissors;  // beside each other along the hinge
    const double width = blades ? 0.5 * def.jaw_width : def.jaw_width;
    shape.thickness = std::min({shape.thickness, def.jaw_thickness, width});
    add(moved(capsule(-def.shaft_length, def.shaft_radius), {Quat::Identity(), shape.hinge}), InstrumentShape::kShaft);
    const Vec3 size(def.jaw_length, def.jaw_thickness, width);
    const TriangleMesh jaw = boxMesh(size, def.jawEdge());
    const Vec3 middle(-0.5 * def.jaw_length, 0.5 * def.jaw_thickness - def.bladeOverlap(), blades ? 0.5 * width : 0.0);
    add(moved(jaw, {Quat::Identity(), middle}), InstrumentShape::kUpperJaw);
    add(moved(jaw, {Quat::Identity(), Vec3(middle.x(), -middle.y(), -middle.z())}), InstrumentShape::kLowerJaw);
  }
  return shape;
}

Pose sightOf(const InstrumentDef& def, const Pose& pose) {
  Mat3 axes;
  const Vec3 along = pose.rotation * Vec3(std::cos(def.view_angle), 0.0, -std::sin(def.view_angle));
  const Vec3 left = Vec3::UnitZ().cross(along);
  axes.col(0) = along;
  axes.col(1) = left.norm() > kNoUp ? left.normalized() : Vec3(pose.rotation * Vec3::UnitY());
  axes.col(2) = along.cross(axes.col(1));
  return {Quat(axes).normalized(), pose.translation};
}

Pose Instrument::handAfter(double h) const {
  Pose then = hand;
  const Vec3 way = target.translation - hand.translation;
  const double length = way.norm(), most = def.max_speed * h;
  then.translation += length > most ? Vec3(most / length * way) : way;
  const double angle = hand.rotation.angularDistance(target.rotation);
  then.rotation = angle > kTurnSpeed * h ? hand.rotation.slerp(kTurnSpeed * h / angle, target.rotation).normalized()
                                         : target.rotation;
  return then;
}

double Instrument::jawAfter(double h) const {
  return jaw_hand + std::clamp(jaw_target - jaw_hand, -kJawSpeed * h, kJawSpeed * h);
}

bool Instrument::isFinite() const {
  return pose.translation.norm() <= kFarthestPose && pose.rotation.coeffs().allFinite() && std::isfinite(jaw) &&
         velocity.allFinite() && spin.allFinite() && std::isfinite(jaw_rate) && load.force.allFinite() &&
         load.torque.allFinite() && std::isfinite(load.jaw) && std::isfinite(load.mass) &&
         std::isfinite(load.inertia) && std::isfinite(load.jaw_inertia) && force.allFinite() && torque.allFinite() &&
         std::isfinite(jaw_torque) && std::isfinite(resists) && std::isfinite(cut_torque) && std::isfinite(cut_work) &&
         std::isfinite(owed) && cut_force.allFinite();
}

double Instrument::cutsTo() const {
  const double reach = def.bladeReach(), half = std::tan(0.5 * jaw);
  return reach < def.jaw_length * half ? reach / half : def.jaw_length;
}

void Instrument::comeBack() {
  pose = hand;
  jaw = jaw_hand;
  velocity = spin = force = torque = Vec3::Zero();
  jaw_rate = jaw_torque = jaw_stop = answers = cut_torque = cut_work = owed = resists = 0.0;
  cut_to = cutsTo();
  cut_force.setZero();
  load = InstrumentLoad();
  aim();
  edge_at = pose;
}

void Instrument::aim() {
  if (def.remote_centre) aimFrom(*def.remote_centre, pose);
}

void Instrument::move(const Pose& hand_then, double jaw_then, double h) {
  const Drawn along{def.stiffness, def.damping, def.max_force};
  const Vec3 behind_hand = hand.translation - pose.translation, hand_goes = hand_then.translation - hand.translation;
  cut_force.setZero();
  bool stands = false;  // the edge does
  if (def.type == InstrumentType::kScalpel && resists > 0.0) {
    // As dry friction against the way: toughness times the area that the way opens (Atkins 2009).
    const Vec3 holds = along.toHold(load.mass, velocity, load.force, behind_hand, hand_goes, h);
    const double needed = holds.squaredNorm(), given = -resists * (pose.rotation * def.ahead()).dot(holds);
    stands = given > 0.0 && given >= needed;
    if (given > 0.0) cut_force = (stands ? 1.0 : given / needed) * holds;
  }
  Vec3 go = along.step(load.mass, velocity, load.force + cut_force, behind_hand, hand_goes, h, answers);
  if (stands) go.setZero();  // a hand at its limit draws as much wherever that is
  cut_work += std::max(0.0, -cut_force.dot(go));
  double of_turn = 0.0;
  const Drawn about{def.angular_stiffness, def.angular_damping, def.max_torque};
  const Vec3 turn = about.step(load.inertia, spin, load.torque, turnVector(hand.rotation * pose.rotation.conjugate()),
                               turnVector(hand_then.rotation * hand.rotation.conjugate()), h, of_turn);
  const Quat before = pose.rotation;
  pose.translation += go;
  pose.rotation = (turnOf(turn) * pose.rotation).normalized();
  aim();
  velocity = go / h;
  spin = turnVector(pose.rotation * before.conjugate()) / h;
  if (def.hasJaws()) {
    const double grip = 0.5 * def.grip * def.jaw_length, stiffness = grip / kJawYield;
    const Drawn jaws{stiffness, kJawTime * stiffness, grip};
    const Vec3 x = Vec3::UnitX();
    const Vec3 behind = (jaw_hand - jaw) * x, way = (jaw_then - jaw_hand) * x;
    cut_torque = 0.0;
    if (resists > 0.0 && cutsTo() < def.jaw_length) {
      const double half = std::sin(0.5 * jaw),
                   most = resists * 0.5 * def.bladeReach() / (half * half);  // work a radian
      const double holds = jaws.toHold(load.jaw_inertia, jaw_rate * x, load.jaw * x, behind, way, h).x();
      cut_torque = std::clamp(holds, 0.0, most);
    }
    const Vec3 opened = jaws.step(load.jaw_inertia, jaw_rate * x, (load.jaw + cut_torque) * x, behind, way, h, of_turn);
    const double jaw_before = jaw;
    jaw = std::clamp(jaw + opened.x(), std::min(jaw, jaw_stop), kWidestJaw);
    jaw_rate = (jaw - jaw_before) / h;
    cut_work += cut_torque * std::max(0.0, jaw_before - jaw);
  }
  hand = hand_then;
  jaw_hand = jaw_then;
}

Vec3 Instrument::block(const Vec3& by, double h) {
  pose.translation += by;
  velocity += by / h;
  const double length = by.norm();
  if (!(length > 0.0)) return Vec3::Zero();
  // The hand presses no more than it may, beside what tissue does.
  const double most = def.max_force + std::max(0.0, -load.force.dot(by) / length);
  return std::min(answers, most / length) * by;
}

}  // namespace meshless
