#include "instruments.h"

#include <algorithm>
#include <string>

#include "convert.h"

namespace meshless {
namespace {

using Part = meshless_surgery::InstrumentPart;

// [m] of the meshes
constexpr double kBladeLength = 0.06, kShaftRadius = 0.0025, kShaftLength = 0.3, kJawLength = 0.018,
                 kScalpelLength = 0.026;
constexpr double kShownReach = 0.1;  // [m] of blades without an end
constexpr double kToGrip = 0.015;    // [m] from the joint of a grasper to what its jaws hold
constexpr double kHolding = 0.15;    // [rad] between jaws that hold tissue
constexpr double kNoTurn = 1e-9;     // [rad]

Part part(const std::string& mesh, const Pose& pose, double scale = 1.0) {
  Part made;
  made.mesh = "package://meshless_surgery/media/instruments/" + mesh + ".obj";
  made.pose = toPose(pose);
  made.scale = scale;
  made.color = toColor(mesh == "shaft" ? Color{0.30f, 0.32f, 0.36f, 1.0f} : Color{0.75f, 0.78f, 0.82f, 1.0f});
  return made;
}

/// A shaft and two jaws that are open by `angle` [rad].
void addJaws(const std::string& jaw, const Pose& pose, double angle, double scale, std::vector<Part>& parts) {
  const Quat other(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  const auto turned = [&](double by) { return Quat(pose.rotation * Eigen::AngleAxisd(by, Vec3::UnitZ())); };
  parts.push_back(part("shaft", pose, scale));
  parts.push_back(part(jaw, {turned(0.5 * angle), pose.translation}, scale));
  parts.push_back(part(jaw, {turned(-0.5 * angle) * other, pose.translation}, scale));
}

Quat fromTheFront() {
  const Vec3 reach = Vec3(0.70, 0.65, -0.30).normalized(), open = Vec3::UnitZ().cross(reach).normalized();
  Mat3 axes;
  axes << reach, open, reach.cross(open);
  return Quat(axes);
}

bool saysTurn(const std::optional<Pose>& hand) {
  return hand && hand->rotation.angularDistance(Quat::Identity()) > kNoTurn;
}

}  // namespace

const Pick* pickInHand(const WorldSnapshot& snapshot) {
  const Pick* in_hand = nullptr;
  for (const Pick& pick : snapshot.picks)
    if (!pick.locked && (in_hand == nullptr || pick.id > in_hand->id)) in_hand = &pick;
  return in_hand;
}

std::vector<Part> Instruments::parts(const WorldSnapshot& snapshot, const std::optional<Pose>& pick_hand,
                                     const std::optional<Pose>& push_hand) {
  std::vector<Part> parts;
  if (snapshot.scissors.shown) {
    const ScissorBlades& blades = snapshot.scissors.blades;
    addJaws("scissors_blade", poseOf(blades), std::max(0.0, snapshot.scissors.angle),
            (blades.length > 0.0 ? blades.length : kShownReach) / kBladeLength, parts);
  }
  if (!snapshot.push.enabled) {
    probe_turn_.reset();
  } else {
    if (saysTurn(push_hand)) probe_turn_ = push_hand->rotation;
    parts.push_back(part("shaft", {probe_turn_.value_or(fromTheFront()), snapshot.push.position}));
  }
  for (const Instrument& instrument : snapshot.instruments) {
    const InstrumentDef& def = instrument.def;
    const double size = def.shaft_radius / kShaftRadius, turn = 0.5 * M_PI;
    const auto placed = [&](const Vec3& at) { return Pose{instrument.pose.rotation, instrument.pose * at}; };
    if (def.type == InstrumentType::kProbe || def.type == InstrumentType::kEndoscope)
      parts.push_back(part("shaft", instrument.pose, size));
    if (def.type == InstrumentType::kHook) {
      const Pose aside = placed(Vec3(-def.shaft_radius, 0.0, 0.0));
      parts.push_back(part("shaft", placed(Vec3(0.0, -def.jaw_length, 0.0)), size));
      parts.push_back(part("shaft", {aside.rotation * Eigen::AngleAxisd(turn, Vec3::UnitZ()), aside.translation},
                           def.jaw_length / kShaftLength));
    }
    if (def.type == InstrumentType::kScalpel)
      parts.push_back(part("scalpel", instrument.pose, def.jaw_length / kScalpelLength));
    if (!def.hasJaws()) continue;
    const std::size_t first = parts.size();
    const bool blades = def.type == InstrumentType::kScissors;
    addJaws(blades ? "scissors_blade" : "grasping_jaw", placed(Vec3(-def.jaw_length, 0.0, 0.0)), instrument.jaw,
            def.jaw_length / (blades ? kBladeLength : kJawLength), parts);
    parts[first].scale = size;
  }
  const Pick* in_hand = pickInHand(snapshot);
  std::map<PickId, Quat> turns;
  for (const Pick& pick : snapshot.picks) {
    const auto known = turns_.find(pick.id);
    Quat& turn = turns[pick.id];
    turn = &pick == in_hand && saysTurn(pick_hand) ? pick_hand->rotation
           : known != turns_.end()                 ? known->second
                                                   : fromTheFront();
    addJaws("grasping_jaw", {turn, pick.position - kToGrip * (turn * Vec3::UnitX())}, kHolding, 1.0, parts);
  }
  turns_ = std::move(turns);
  return parts;
}

}  // namespace meshless
