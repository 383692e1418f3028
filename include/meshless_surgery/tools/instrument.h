// Instruments: named tools with a shape that touches tissue, each led by a hand. Their state and their laws; World
// moves them. The frame of an instrument has its origin at the tip, x along the shaft out of the tip, and z along the
// hinge of its jaws.
#pragma once

#include <optional>

#include "meshless_surgery/base/ids.h"
#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// A rod with a round tip; two jaws on a hinge; a rod whose tip is bent aside, to +y; two blades on a hinge that slide
/// along each other, the upper one on the side of +z; two jaws that leave a clip on what they close on; a blade in the
/// plane of x and y, whose edge is on the side of -y; a rod that looks out of its tip, aside by view_angle to -z.
enum class InstrumentType { kProbe, kGrasper, kHook, kScissors, kClipApplier, kScalpel, kEndoscope };
const char* toString(InstrumentType type);

/// What a user chose. The hand is an impedance: a spring and a damper draw the instrument to where it is wanted, by no
/// more than max_force and max_torque, so that it cannot be pulled through tissue.
struct InstrumentDef {
  std::string name;
  InstrumentType type = InstrumentType::kProbe;
  Pose pose;                       // of the tip, where it begins
  double shaft_radius = 0.0025;    // [m]
  double shaft_length = 0.3;       // [m]
  double jaw_length = 0.018;       // [m] from hinge to tip, or of a blade; of a hook: how far it reaches aside
  double jaw_width = 0.004;        // [m]
  double jaw_thickness = 0.0019;   // [m] of each
  double friction = 0.5;           // Coulomb, combined with the tissue's as that of two bodies
  double stiffness = 2000.0;       // [N/m]
  double damping = 20.0;           // [N s/m]
  double angular_stiffness = 5.0;  // [N m/rad]
  double angular_damping = 0.05;   // [N m s/rad]
  double max_force = 10.0;         // [N]
  double max_torque = 0.5;         // [N m]
  double max_speed = 1.0;          // [m/s] of the hand: a pose farther away is gone to at this
  double grip = 5.0;               // [N] of each jaw, in its middle
  double sharpness = 1.0;          // of a scalpel: the tissue's toughness over what it takes [J/m^2] (a sharp one: 1)
  double view_angle = 0.0;         // [rad] of an endoscope: between its shaft and its line of sight
  double field_of_view = 1.2;      // [rad] of an endoscope: across its round picture
  bool latch = false;  // of a grasper: what its jaws have grasped stays in them, by a spring, until they open
  std::optional<Vec3> remote_centre;  // [m] of a trocar, through which the shaft goes
  Color color{0.75f, 0.78f, 0.82f, 1.0f};

  bool hasJaws() const {
    return type == InstrumentType::kGrasper || type == InstrumentType::kScissors ||
           type == InstrumentType::kClipApplier;
  }
  /// [m] of a scalpel: where its edge ends, which begins at the tip.
  Vec3 heel() const { return {-jaw_length, -0.5 * jaw_width, 0.0}; }
  Vec3 ahead() const { return Vec3(-heel().y(), heel().x(), 0.0).normalized(); }  // unit: where the edge faces
  double jawEdge() const;                                                         // [m] of the triangles of a jaw
  double bladeOverlap() const;  // [m] by which the edges of closed blades are past the middle
  double bladeReach() const;    // [m] the same of where they cut
  /// Names the value and what is accepted.
  Status validate() const;
};

/// A number of an InstrumentDef, and what is accepted.
struct InstrumentNumber {
  const char* key;
  double InstrumentDef::*value;
  double least, most;
  const char* unit;
};
extern const std::array<InstrumentNumber, 17> kInstrumentNumbers;

/// It names topics and a tf frame.
bool isInstrumentName(const std::string& name);
inline const char* const kInstrumentName =
    "a letter, then letters, digits and _, up to 40 of them, and not pick, push, scissors, pick_cursor, push_sphere or "
    "world";
constexpr std::size_t kMostInstruments = 20;
constexpr double kWidestJaw = 1.6;     // [rad] between the jaws of an instrument
constexpr double kFarthestHand = 1e3;  // [m] of a pose from the origin

/// Its surface in its own frame, jaws closed. Vertices are finer than jaws are thick.
struct InstrumentShape {
  enum Part : std::uint8_t { kShaft, kUpperJaw, kLowerJaw };  // the upper one is turned to +y
  TriangleMesh mesh;
  Points edge;                      // [m] of a scalpel: the ground and obstacles stop these, tissue does not
  std::vector<std::uint8_t> parts;  // one a vertex
  Vec3 hinge = Vec3::Zero();        // [m]
  double thickness = 0.0;           // [m] of what is thinnest

  /// Where its vertices are [m], and after them the edge, of an instrument there, open by `jaw` [rad].
  void place(const Pose& pose, double jaw, Points& vertices) const;
};
InstrumentShape shapeOf(const InstrumentDef& def);

/// Of an endoscope there: x along its line of sight, z up in its picture. The camera head is held upright: z of the
/// world is up in the picture; where the line of sight is along it, y of the instrument is to the left.
Pose sightOf(const InstrumentDef& def, const Pose& pose);

/// What contact does to an instrument in a substep. Torques are about the tip.
struct InstrumentLoad {
  Vec3 force = Vec3::Zero();   // [N]
  Vec3 torque = Vec3::Zero();  // [N m]
  double jaw = 0.0;            // [N m] that opens
  double mass = 0.0;           // [kg] of tissue that it moves
  double inertia = 0.0;        // [kg m^2] of that about the tip
  double jaw_inertia = 0.0;    // [kg m^2] of that for the angle between the jaws
};

/// A wound that blades make, snip by snip: in one plane of the body at rest. Of a scalpel: the last snip, which begins
/// where x is 0.
struct BladeWound {
  std::string body;
  Vec3 origin = Vec3::Zero();                           // [m]
  Vec3 x_axis = Vec3::UnitX(), y_axis = Vec3::UnitY();  // unit
  Vec2 least = Vec2::Zero(), most = Vec2::Zero();       // [m] along these: where it is
  std::uint32_t stroke = 0;                             // of the instrument, in which it was cut last

  Vec2 within(const Vec3& rest) const { return {x_axis.dot(rest - origin), y_axis.dot(rest - origin)}; }
  double beside(const Vec3& rest) const { return x_axis.cross(y_axis).dot(rest - origin); }
  bool has(const Vec3& rest) const {
    const Vec2 p = within(rest);
    return (p.array() > least.array()).all() && (p.array() < most.array()).all();
  }
};
constexpr std::size_t kMostWounds = 50;

struct Instrument {
  InstrumentDef def;
  std::uint32_t number = 0;                           // never used again
  Pose target;                                        // where the hand is wanted
  double jaw_target = 0.0;                            // [rad] 0..kWidestJaw
  Pose hand;                                          // where the hand has got to
  double jaw_hand = 0.0;                              // [rad]
  Pose pose;                                          // where the instrument is
  double jaw = 0.0;                                   // [rad]
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();  // [m/s, rad/s] in the last substep
  double jaw_rate = 0.0;                              // [rad/s]
  double jaw_stop = 0.0;                              // [rad] they close no further
  double cut_to = 0.0;              // [m] from the hinge to which blades have cut what is between them
  std::vector<BladeWound> wounds;   // that they may go on with, one a body
  std::uint32_t stroke = 0;         // how often they have opened, or an edge has left tissue
  bool in_tissue = false;           // the edge of a scalpel
  Pose edge_at;                     // where it has cut to
  Vec3 cut_force = Vec3::Zero();    // [N] of what it cuts on it, in the last substep
  double resists = 0.0;             // [N] of what they cut next: toughness times thickness
  double cut_torque = 0.0;          // [N m] of that on the jaws in the last substep
  double cut_work = 0.0;            // [J] of that since the last snip
  double owed = 0.0;                // [J] that snips have taken more than that came to
  double answers = 0.0;             // [N/m] of force from outside, for the way that this moved it in the last substep
  InstrumentLoad load;              // of the last substep
  Vec3 force = Vec3::Zero();        // [N] on it, mean over the last step
  Vec3 torque = Vec3::Zero();       // [N m] likewise
  double jaw_torque = 0.0;          // [N m] likewise, that opens
  std::string holds;                // the body between its jaws; empty: none
  double gripped = 0.0;             // [N] with which the jaws press it, the weaker of them, mean over the last step
  double closed_to = 0.0;           // [rad] the least that was wanted between the jaws meanwhile; of a clip applier,
                                    // between them when they put on a clip
  bool loaded = false;              // a clip applier has a clip in its jaws, from when they have opened
  double lost_for = 0.0;            // [s] that they have not
  PickId latched = 0;               // the spring that holds it; 0: none
  Vec3 latch_at = Vec3::Zero();     // [m] where that ends, in the frame of the instrument
  Vec3 latch_force = Vec3::Zero();  // [N] of it on the instrument, in the last step

  /// Where the hand goes within h [s]: no faster than it may.
  Pose handAfter(double h) const;
  double jawAfter(double h) const;  // [rad]
  bool isFinite() const;
  /// [m] from the hinge to where the edges of blades are nearer to each other than they are thick: they cut so far.
  double cutsTo() const;
  /// It is where its hand is, at rest and without load.
  void comeBack();
  /// Turns it so that its shaft goes through its trocar, where it has one.
  void aim();
  /// The next h [s], in which the hand gets there: Newton's law for the tissue that moves along, implicit in spring and
  /// damper, with the load of the last substep.
  void move(const Pose& hand_then, double jaw_then, double h);
  /// Puts it back by what is in its way, within the substep of h [s]; the force [N] of that.
  Vec3 block(const Vec3& by, double h);
};

}  // namespace meshless
