// The world: owns the bodies and tools, and is the only place where time moves. Not thread-safe: one thread owns it.
#pragma once

#include <functional>
#include <map>
#include <set>

#include "meshless_surgery/body/body_load.h"
#include "meshless_surgery/body/preserve.h"
#include "meshless_surgery/contact/deformable.h"
#include "meshless_surgery/tools/attachment.h"
#include "meshless_surgery/tools/tools.h"

namespace meshless {

/// What bodies meet: the ground and the push sphere always; kSurface: each other and obstacles, by their surfaces
/// (contact/surface_contacts.h); kTextbook: each other, in pairs that are found as the paper does (contact/textbook.h),
/// for comparison.
enum class ContactMethod { kNone, kTextbook, kSurface };

struct WorldSettings {
  Vec3 gravity{0.0, 0.0, -9.81};       // [m/s^2]
  std::optional<double> ground = 0.0;  // [m] height along z
  double ground_friction = 0.5;
  double step_rate = 120.0;  // [Hz] 1..10,000
  int substeps = 1;          // 1..1,000, at the least; an elastic body can need more
  int max_substeps = 64;  // 1..1,000; beyond it elastic bodies deform more slowly than their material, and it is said
  ContactMethod contact = ContactMethod::kSurface;
  int threads = 1;                  // 1..64; results do not depend on it to the bit
  bool sleep = true;                // what holds still for half a second costs nothing
  double pick_max_distance = 0.05;  // [m]
  double pick_stiffness = 500.0;    // [N/m]
  double pick_radius = 0.0;         // [m] of the grasp along the body; 0: four particle spacings
  double push_radius = 0.02;        // [m]

  Status validate() const;
};

/// A closed surface that never moves: a table, a tray.
struct ObstacleDef {
  std::string name;
  TriangleMesh mesh;  // [m] world frame
  double friction = 0.5;
  Color color{0.55f, 0.58f, 0.62f, 1.0f};
};

/// What a scene file says.
struct SceneDef {
  std::string name;
  WorldSettings world;
  std::map<std::string, Material> materials;
  std::vector<BodyDef> bodies;
  std::vector<ObstacleDef> obstacles;
  std::vector<AttachCommand> attachments;
  std::vector<InstrumentDef> instruments;
  std::vector<std::string> warnings;  // of what is not as it is written
};

enum class EventType {
  kPicked,
  kLocked,
  kReleased,
  kCut,
  kIncised,
  kTouched,
  kAsleep,
  kAwake,
  kOverBudget,
  kSpawned,
  kRemoved,
  kReset,
  kFault,
  kUndone,
  kLifted,
  kLoaded,
  kAttached,
  kDetached,
  kTorn,
  kLeak,
  kClipped,
  kCollapsed,
  kMaterial,
  kClampMoved,
  kInstrument,
  kGrasped,
  kDropped,
  kGravity,
  kPlaced,
  kRestored,
  kForce,
  kMisfired,
  kTask
};
constexpr EventType kLastEvent = EventType::kTask;
const char* toString(EventType type);

/// That somebody begins or ends a task, for who reads a log.
struct TaskNote {
  bool begins = true;
  std::string task;                // a name of config/tasks, or a path
  std::string trainee;             // may be empty
  std::vector<std::string> allow;  // beside what the task does
};

struct Event {
  EventType type = EventType::kFault;
  std::uint64_t step = 0;
  double sim_time = 0.0;  // [s]
  std::string body;
  PickId pick = 0;
  std::string text;             // a sentence
  std::uint32_t cavity = 0;     // of kLeak: the patch of its faces, which all pieces share that have a part of it
  BodyModelPtr removed = {};    // of kRemoved: the body that is no more, which may have come in the same step
  Pose placed = {};             // of it, as BodySnapshot::placed
  bool taken_apart = false;     // of kDetached: by a command that is for it, and no clip
  std::string instrument = {};  // of kGrasped, kDropped, kMisfired, kReleased by jaws, kIncised by blades, kClipped
  double force = 0.0;           // [N] of kGrasped; of kForce, that begins to act
  std::uint64_t command = 0;    // how many commands the world was given before: those of one have the same
  std::shared_ptr<const TaskNote> task = {};  // of kTask
};

/// Times [s] and work of one step; counters that a scene does not use stay at zero.
struct StepReport {
  double total = 0, match = 0, tools = 0, contact = 0, surface = 0;
  std::size_t bodies = 0;
  std::size_t asleep = 0;  // of them
  std::size_t woken = 0;
  std::size_t substeps = 0;
  MatchCounters match_counters;
  ContactCounters contact_counters;
  PreserveCounters preserve_counters;
  std::size_t tetrahedralizations = 0;  // since the start
  std::size_t contact_shapes = 0;       // surfaces prepared for contact in this step
  std::size_t ground_contacts = 0;
  std::size_t push_contacts = 0;
  std::size_t fibres = 0;  // solved in a substep, over all of them
  std::size_t torn = 0;    // fibres
  std::size_t mended = 0;  // bodies whose coordinates were not finite, and that start anew from rest
};

/// Memory that a world holds [bytes]; what several bodies share counts once.
struct MemoryUse {
  std::size_t models = 0;   // rest shapes, clusters, surfaces and their binding
  std::size_t states = 0;   // positions, velocities, poses, and what a step needs beside them
  std::size_t contact = 0;  // surfaces as contact sees them, rows and their solver
  std::size_t kept = 0;     // for reset and undo
  std::size_t particles = 0;

  std::size_t total() const { return models + states + contact + kept; }
  double perParticle() const { return particles ? static_cast<double>(total()) / static_cast<double>(particles) : 0.0; }
};

/// What to put into a snapshot; nothing is copied that was not asked for.
struct SnapshotWants {
  bool surfaces = false;
  bool particles = false;
  bool measures = false;
  bool contacts = false;  // of the last step; none after a change of bodies
  bool touches = false;   // likewise
};

constexpr const char *kGroundName = "ground", *kPushName = "push";

/// A point of a body's surface that carries load, in the last substep; none of a body with itself.
struct ContactPoint {
  std::string body;              // on which the force is
  std::string other;             // body, obstacle, instrument, kGroundName or kPushName
  Vec3 position = Vec3::Zero();  // [m]
  Vec3 normal = Vec3::UnitZ();   // unit, out of the other
  Vec3 force = Vec3::Zero();     // [N] along it, and of friction
  double pressed() const { return normal.dot(force); }  // [N]
};

struct BodySnapshot {
  BodyId id;
  std::uint32_t number = 0;  // stable for the body, never used again in a run
  std::string name;
  Material material;
  BodyModelPtr model;
  Points surface;              // where wanted
  Points particles;            // where wanted
  BodyMeasures measures;       // where wanted
  std::size_t tetrahedra = 0;  // 0 until something needs them
  bool asleep = false;
  double stiffness_factor = 1.0;  // (substeps given / needed)^2 of an elastic material, at most 1
  Pose placed;                    // from the model's frame to where the rest shape was put
  // Where wanted: the names of other bodies, of obstacles and of instruments that press on it, and kGroundName.
  std::vector<std::string> touches;
};

struct AttachmentSnapshot {
  std::string name;
  std::vector<std::string> ends;           // bodies that its fibres join, then the obstacle or "world" if it is one
  std::size_t fibres = 0, made = 0;        // whole, and at the start
  double area = 0.0;                       // [m^2] of those that are whole
  double force = 0.0;                      // [N] sum of their tensions
  Vec3 middle = Vec3::Zero();              // [m] of its fibres, where they are now; zero where none is left
  std::optional<double> jaws;              // [m] of a clip: how wide it still may be between them
  Vec3 rest_place = Vec3::Zero();          // [m] of a clip: the middle of its jaws in the rest shape, where it was put
  std::vector<std::array<Vec3, 2>> lines;  // [m] ends of fibres, of a clip lines on its jaws; where surfaces are wanted
};

struct WorldSnapshot {
  std::uint64_t step = 0;
  double sim_time = 0.0;
  std::uint32_t run = 0;  // grows with each reset: messages of an older run are void
  std::vector<BodySnapshot> bodies;
  std::vector<std::shared_ptr<const ObstacleDef>> obstacles;
  std::vector<ContactPoint> contacts;  // where wanted
  std::vector<Pick> picks;
  std::map<PickId, std::string> pick_bodies;
  std::vector<AttachmentSnapshot> attachments;
  PushSphere push;
  Scissors scissors;
  std::vector<Instrument> instruments;
  std::vector<std::shared_ptr<const InstrumentShape>> instrument_shapes;  // one each
  StepReport report;
};

/// What a ray met.
struct ProbeReply {
  std::string body;
  Vec3 position = Vec3::Zero();  // [m]
  Vec3 normal = Vec3::UnitZ();   // unit, out of the tissue
};

struct SavedWorld;

class World {
 public:
  explicit World(WorldSettings settings);
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  const WorldSettings& settings() const;
  std::uint64_t stepCount() const;
  double simTime() const;  // [s]
  std::size_t bodyCount() const;
  /// By a body that lives or was retired in this run.
  bool nameUsed(const std::string& name) const;

  /// Does what the user asked for, at once; on an error nothing has changed.
  Result<Reply> apply(const Command& command);

  /// One step of 1 / step_rate seconds.
  void step();

  /// The answer to a cut that was started with a close time, once the blades met; taken out by asking.
  std::optional<Result<CutReply>> finishedCut(std::uint32_t ticket);

  /// Back to the start: only the bodies of addSceneBody, at rest; no picks, no push sphere, blades that were closing
  /// answer with an error. Time is 0 again, a new run begins.
  void reset();
  /// Like SpawnCommand, and brought back by reset.
  Result<SpawnReply> addSceneBody(std::shared_ptr<const PreparedBody> body);

  /// Stays for good. Bodies meet it with ContactMethod::kSurface alone.
  /// method. Refuses an empty or open surface, a friction outside of 0..10, and a name in use.
  Status addObstacle(ObstacleDef obstacle);
  /// Like AttachCommand, and made again by reset. Bodies and obstacles come before.
  Result<AttachReply> addSceneAttachment(const AttachCommand& attachment);

  /// Like AttachInstrumentCommand, and brought back by reset. Bodies come before.
  Status addSceneInstrument(const InstrumentDef& def);

  /// Bodies in the order in which they came.
  WorldSnapshot snapshot(const SnapshotWants& wants);
  /// One body, by name; `rest`: surface and particles in the rest shape, where the body was put. Tetrahedra are made
  /// where missing.
  Result<BodySnapshot> inspect(const std::string& name, bool rest);
  /// The first surface that the ray from `origin` meets; kMissed where it meets none. Nothing changes.
  Result<ProbeReply> probe(const Vec3& origin, const Vec3& direction);
  /// What a body of elastic material bears now, of all its cells; or, where there are points [m], of the cell whose
  /// middle is nearest to each, which is at most two spacings away (else kMissed). Nothing changes.
  Result<BodyLoad> load(const std::string& name, const Points& points);
  /// What it holds now. Reads bodies, not their particles.
  MemoryUse memory() const;
  /// Events since the last call.
  std::vector<Event> takeEvents();
  /// Of all that a later step reads of the state, settings, obstacles and models with their surfaces too. It is equal
  /// for equal histories since the start or a reset, whatever was read meanwhile and however many threads there are.
  /// Ids are left out, because they go on over resets, and so is what only undo reads.
  std::uint64_t stateHash() const;

  /// The whole state as it is now, at the cost of a copy of what changes (world/saved_world.h).
  std::shared_ptr<const SavedWorld> capture() const;
  /// Becomes that state, with its settings (but for the threads), scene and obstacles; a new run begins, what could be
  /// undone is forgotten, and blades that were closing answer with an error.
  void restore(const SavedWorld& saved);

  /// From now on hands the bytes of a log (world/command_log.h) to the sink, piece by piece: the present state first,
  /// then every command before it is done, and the hash every second of simulated time, for a replay to compare. Bodies
  /// and obstacles of the scene are to be added before. An empty sink ends it.
  using RecordSink = std::function<void(std::string bytes)>;
  void record(RecordSink sink);
  /// Puts the present hash into the log.
  void recordHash() const;
  /// Says what time it is where somebody watches, and puts it into the log: [s] since 1970, NaN: nobody does, and steps
  /// are done as fast as they can. No step depends on it, and no state has it.
  void setWallTime(double seconds);
  double wallTime() const;  // [s] as said last; NaN before
  /// Says so with an event, and puts it into the log. No step depends on it, and no state has it.
  void noteTask(TaskNote note);

  // tracked tools
  void setScissors(const ScissorBlades& blades, double angle);  // shown from now on
  void hideScissors();
  /// The pick that a stream moves: the newest one that is not locked.
  std::optional<Pick> heldPick() const;
  /// With how many N/m it answers a move of its free end within a step; 0 without one.
  double heldStiffness() const;
  const PushSphere& push() const;
  const Scissors& scissors() const;
  std::uint32_t run() const;  // see WorldSnapshot
  /// How an entry of `fixed` of a body of the scene is moved, about the world's origin.
  Pose clampMotion(const std::string& root, std::uint32_t clamp) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace meshless
