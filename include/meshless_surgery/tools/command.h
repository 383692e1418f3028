// What a user can do, as a closed variant: the same values come from services, topics, rviz and a command log. Poses
// are in the world frame.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <variant>

#include "meshless_surgery/base/ids.h"
#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/geometry/query/blade.h"
#include "meshless_surgery/geometry/query/region.h"
#include "meshless_surgery/tools/instrument.h"

namespace meshless {

struct PickCommand {
  Vec3 point = Vec3::Zero();      // [m]
  Vec3 direction = Vec3::Zero();  // zero: nearest particle to point; else the ray from point
  std::string body;               // empty: any
  double max_distance = 0.0;      // [m] >= 0; 0: the default
  double stiffness = 0.0;         // [N/m] >= 0; 0: the default
};
struct MovePickCommand {
  PickId pick = 0;
  Vec3 target = Vec3::Zero();  // [m]; takes a locked pick up again
};
struct LockCommand {
  PickId pick = 0;
  std::optional<Vec3> target;  // [m]; empty: where the free end is
};
struct ReleaseCommand {
  PickId pick = 0;
};
struct ClearPicksCommand {};
struct PushCommand {
  bool enable = true;
  double radius = 0.0;           // [m] >= 0; 0: the default
  Vec3 position = Vec3::Zero();  // [m] of the centre
  double speed = 0.0;            // [m/s] >= 0; 0: placed there at once
  bool streamed = false;         // by a stream, whose silence lifts it
};
/// A pair of scissors' blades, in the plane of the cut: origin + s * x_axis + t * y_axis with 0 <= s <= length,
/// |t| <= width / 2. They cut the whole plane of what they meet.
struct ScissorBlades {
  Vec3 origin = Vec3::Zero();
  Vec3 x_axis = Vec3::UnitX();  // unit
  Vec3 y_axis = Vec3::UnitY();  // unit, normal to x_axis
  double length = 0.0;          // [m]; 0: unbounded
  double width = 0.0;           // [m]; 0: unbounded

  Blade blade() const {
    const double side = width > 0.0 ? 0.5 * width : Blade::kUnbounded;
    return {origin, x_axis, y_axis, length > 0.0 ? length : Blade::kUnbounded, side, side, 0.0};
  }
};

struct CutCommand {
  ScissorBlades blades;
  double close_time = 0.0;          // [s] >= 0 of simulated time
  double roughness = 0.0;           // [m] amplitude of the fractal displacement of the cut
  std::vector<std::string> bodies;  // empty: all that the blades meet
};
/// Opens the scissors: cuts whose blades are closing are called off.
struct OpenScissorsCommand {};
/// Opens the blades of one cut: it is called off, and the others go on.
struct OpenBladesCommand {
  std::uint32_t ticket = 0;  // of its CutStarted
};
enum class ToolKind { kPick, kPush, kScissors, kInstrument };  // the last: any of those with names
/// Takes a tool off the tissue: the pick in hand is released, the sphere removed, the scissors hidden (blades that a
/// service closes go on). An event says why.
struct LiftCommand {
  ToolKind tool = ToolKind::kScissors;
  bool streamed_only = false;  // not what a service has placed or locked
  std::string why;             // a sentence; empty: the user wished so, no event
};
/// Back to the state before the last cut or incision; time goes on.
struct UndoCutCommand {};
struct InciseCommand {
  Blade blade;
  std::vector<std::string> bodies;  // empty: all that the blade meets
};
struct SetMaterialCommand {
  std::string body;                                         // empty: all
  std::function<Result<Material>(const Material&)> change;  // the new material from the present one
};
struct SpawnCommand {
  std::shared_ptr<const PreparedBody> body;
};
struct RemoveCommand {
  std::string body;
};
/// Joins two bodies where their surfaces face each other, or a body and an obstacle, or fixes a body's surface where it
/// is ("world").
struct AttachCommand {
  std::string name;                // empty: one is chosen
  std::string body, other;         // one of them may be an obstacle or "world"
  double distance = 0.0;           // [m] > 0: how far from each other they are joined; of no matter for the world
  double stiffness = 0.0;          // [N/m^3] > 0: per area
  std::optional<double> strength;  // [Pa] > 0; empty: it does not tear
  std::optional<Region> region;    // of the first body's surface, in the world frame; no mesh
};
struct DetachCommand {
  std::string name;
  std::optional<Region> region;  // in which one of its ends is; empty: all of it
};

/// Closes what is hollow between two jaws, and holds it closed.
struct ClipCommand {
  std::string name;                // empty: one is chosen
  std::string body;                // empty: the nearest
  Vec3 point = Vec3::Zero();       // [m] on the vessel
  Vec3 direction = Vec3::UnitZ();  // in which the jaws close, across the vessel; of any length above 0
  double width = 0.005;            // [m] > 0 of the jaws, along the vessel
  double opening = 0.02;           // [m] > 0 of the jaws, and their length across
};

constexpr double kMaxClampTime = 3600.0;  // [s]
/// Moves what holds a body: an entry of `fixed`, evenly. Both are counted from where it was put.
struct MoveClampCommand {
  std::string body;
  std::uint32_t clamp = 0;       // the entry, from 0 on
  Vec3 shift = Vec3::Zero();     // [m] of the middle of what it holds
  Quat turn = Quat::Identity();  // unit, about that middle
  double time = 0.0;             // [s] 0..kMaxClampTime that it takes; less than a step is one
  // By a stream: of all that a body of the scene has become, where there is any, shift and turn of the world about its
  // origin, at up to kFollowSpeed, and no event tells of it.
  bool streamed = false;
};
constexpr double kFollowSpeed = 1.0;  // [m/s]
constexpr double kFollowTurn = 5.0;   // [rad/s]

/// Until the next, or a reset.
struct SetGravityCommand {
  Vec3 gravity = Vec3::Zero();  // [m/s^2] of a length up to 1e4
};
/// Puts a body elsewhere, at rest and in its rest shape, with its cuts: where its own frame (its file's) goes. What
/// holds it goes along, its picks are let go of.
struct PlaceBodyCommand {
  std::string body;
  Pose pose;
};
/// Bodies as the scene began, in place of what has become of them.
struct ResetBodiesCommand {
  std::vector<std::string> bodies;  // of the scene; empty: all of them
};
/// A force that acts on a patch of a body's surface for a while, spread evenly over its area. It stays on its tissue.
/// Zero: ends all that act on the body.
struct ApplyForceCommand {
  std::string body;
  std::optional<Region> region;  // in the world frame, no mesh; empty: all of the surface
  Vec3 force = Vec3::Zero();     // [N] up to kMostForce
  double time = 0.0;             // [s] above 0 to kLongestForce; not asked for where the force is zero
};
constexpr double kMostForce = 1e4;        // [N]
constexpr double kLongestForce = 3600.0;  // [s]
constexpr std::size_t kMostForces = 100;

/// Takes an instrument into the scene, outside of tissue.
struct AttachInstrumentCommand {
  InstrumentDef def;
};
struct DetachInstrumentCommand {
  std::string name;
};
/// Where the hand of an instrument is wanted.
struct LeadInstrumentCommand {
  std::string name;
  std::optional<Pose> pose;   // of the tip
  std::optional<double> jaw;  // [rad] 0..kWidestJaw
};

using Command =
    std::variant<PickCommand, MovePickCommand, LockCommand, ReleaseCommand, ClearPicksCommand, PushCommand, CutCommand,
                 OpenScissorsCommand, InciseCommand, SetMaterialCommand, SpawnCommand, RemoveCommand, LiftCommand,
                 UndoCutCommand, OpenBladesCommand, AttachCommand, DetachCommand, ClipCommand, MoveClampCommand,
                 AttachInstrumentCommand, DetachInstrumentCommand, LeadInstrumentCommand, SetGravityCommand,
                 PlaceBodyCommand, ResetBodiesCommand, ApplyForceCommand>;

struct PickReply {
  PickId pick = 0;
  std::string body;
  Index particle = 0;
  Vec3 position = Vec3::Zero();  // [m] where the tissue was grabbed
};
struct CutReply {
  std::vector<std::string> cut_bodies;  // retired
  std::vector<std::string> new_bodies;
  double cap_area = 0.0;           // [m^2] of one side, over all bodies cut
  CutWork work;                    // over all bodies cut
  double duration = 0.0;           // [s] wall time
  std::vector<std::string> notes;  // bodies that the blades met and that could not be cut, and why
};
/// The blades are closing; World::finishedCut answers with the ticket once they met.
struct CutStarted {
  std::uint32_t ticket = 0;
};
struct InciseReply {
  std::vector<std::string> cut_bodies;  // opened; one that came apart is retired
  std::vector<std::string> new_bodies;
  double opened_area = 0.0;        // [m^2] of one wound face, over all bodies
  CutWork work;                    // over all bodies
  double duration = 0.0;           // [s] wall time
  std::vector<std::string> notes;  // bodies that the blade met and that could not be opened, and why
};
struct SpawnReply {
  BodyId id;
  std::string name;
  std::size_t particles = 0, triangles = 0, clusters = 0;
};

struct UndoCutReply {
  std::vector<std::string> bodies;  // that were cut, and are whole again
};

struct AttachReply {
  std::string name;
  std::size_t fibres = 0;
  double area = 0.0;  // [m^2] that they stand for
  /// Of the surface, that hang together, the largest first.
  struct Patch {
    double area = 0.0;           // [m^2]
    Vec3 middle = Vec3::Zero();  // [m]
  };
  std::vector<Patch> patches;
  std::string text() const;  // for users
};
struct DetachReply {
  std::size_t gone = 0, left = 0;  // fibres
};
struct ClipReply {
  std::string name, body;
  std::size_t fibres = 0;
  double lumen = 0.0;  // [m] its widest, which the jaws close
};

struct MoveClampReply {
  Vec3 middle = Vec3::Zero();  // [m] where the middle of what it holds will be
};

struct ResetBodiesReply {
  std::vector<std::string> bodies;  // that are as the scene began
  std::vector<std::string> notes;   // attachments of the scene that could not be made again, and why
};
struct ApplyForceReply {
  double area = 0.0;           // [m^2] of the patch
  Vec3 middle = Vec3::Zero();  // [m] of it
};

using Reply = std::variant<Done, PickReply, CutReply, CutStarted, InciseReply, SpawnReply, UndoCutReply, AttachReply,
                           DetachReply, ClipReply, MoveClampReply, ResetBodiesReply, ApplyForceReply>;

}  // namespace meshless
