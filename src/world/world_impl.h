// What the world holds; shared by the files that implement it.
#pragma once

#include <map>
#include <mutex>
#include <set>
#include <unordered_map>

#include "instrument_body.h"
#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/contact/textbook.h"
#include "meshless_surgery/dynamics/match_batch.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/world/world.h"
#include "shown_surface.h"
#include "surface_model.h"

namespace meshless {

/// Of a body, by its name.
struct MaterialChange {
  std::string body;
  Material material;
};

/// A surface that never moves, as contact sees it.
struct WorldObstacle {
  explicit WorldObstacle(ObstacleDef of_def);
  std::shared_ptr<ObstacleDef> def;
  std::vector<double> inverse_masses;  // [1/kg] 0, one a vertex
  ContactSurface surface;
  SolidQuery solid;
  Box bounds;
  double thickness = 0.0;  // [m] of a plate of its volume and area
};

/// Of a body: what is kept from step to step, and in saved states.
struct KeptBody {
  BodyId id;
  std::uint32_t number = 0;
  std::string name;
  std::string root;  // the name under which it came, whole
  Material material;
  BodyModelPtr model;
  BodyState state;
  bool surface_current = true;  // state.surface fits state.positions
  bool touched_by_push = false;
  double stiffness_factor = 1.0;
  Box bounds;  // [m] of particles and surface, at the start of the last frame in which it was awake
  bool asleep = false;
  double still_for = 0.0;         // [s] that it has been near rest_from
  Points rest_from;               // [m]
  std::uint32_t sleep_group = 0;  // those that fell asleep together wake together
};

struct WorldBody : KeptBody {
  std::shared_ptr<const ContactMesh> mesh;            // made when something first comes near
  std::shared_ptr<const SurfaceModel> surface_model;  // made when something first comes near
  BodyModelPtr measured;                              // the model that these two are of
  double edge_length = 0.0;                           // [m] mean, of the surface
  double surface_reach = 0.0;                         // [m] how far the surface is beyond the particles, at most
  double fastest = 0.0;                               // [m/s] no particle is faster, as bounds
  std::optional<std::uint64_t> slowed_at;             // the last step in which stiffness_factor was below 1
  bool collapsed = false;                             // as was said; not saved: of a loaded body it is said again
  Index batch = kNoIndex;                             // matched with others of its kind: one of World::Impl::batches
  StepScratch scratch;
};

/// Room for some bodies of a batch side by side.
struct BatchLanes {
  /// As they stand, of no matter which models of the batch.
  void step(const std::vector<WorldBody*>& some, const BatchStep& step, MatchCounters& counters);

  BodyBatch batch;
  std::vector<const BodyModel*> models;  // whose rest shapes the lanes hold
  std::vector<BatchBody> states;
};

/// Bodies that are matched side by side.
struct WorldBatch {
  std::vector<WorldBody*> bodies;
  std::vector<std::unique_ptr<BatchLanes>> spare;  // that no thread has borrowed
};

/// Islands of contact that take the same substeps, one after another on one thread, and what they did in a frame.
struct SurfaceWork {
  struct Member {
    Index island = 0;                // of the contacts
    std::size_t begin = 0, end = 0;  // of bodies
    std::vector<Vec3*> previous;     // [m] one a body
    std::vector<Pick*> picks;
    std::vector<SpringRow> springs;  // one a pick
    std::vector<Fibre*> fibres;
    std::vector<FibreRow> fibre_rows;  // one a fibre
  };
  std::vector<Member> members;
  std::size_t member_count = 0;                       // of them in use
  std::vector<WorldBody*> bodies, alone;              // all of them, and those matched one by one
  std::vector<std::vector<WorldBody*>> side_by_side;  // the others, by batches
  std::vector<std::unique_ptr<BatchLanes>> lanes;     // one a batch, borrowed
  std::size_t particles = 0;
  int substeps = 1;
  SolverScratch solver_scratch;
  std::vector<MatchCounters> each_counters;
  MatchCounters match_counters;
  PreserveCounters preserve_counters;
  SolverCounters solver_counters;
  Vec3 push_force = Vec3::Zero();     // [N] of the push sphere on the tissue
  bool touched = false;               // by it
  double match = 0.0, contact = 0.0;  // [s]
};

/// Blades on their way together.
struct ClosingCut {
  std::uint32_t ticket = 0;
  CutCommand command;
  std::uint64_t done_at = 0;  // step
  double start_angle = 0.5;   // [rad]
  std::uint64_t started_at = 0;
};

/// What contact calls obstacles: the first has this key, beyond the numbers of bodies.
inline constexpr std::uint64_t kObstacleKey = std::uint64_t{1} << 40;
/// Likewise with the number of an instrument.
inline constexpr std::uint64_t kInstrumentKey = std::uint64_t{1} << 41;

/// A loop on so many threads.
ForEach makeForEach(int threads);

/// The state before a cut or an incision. Models are shared, so that this is the states alone.
struct CutUndo {
  struct Body {
    BodyId id;
    std::string name, root;
    std::uint32_t number = 0;
    Material material;
    BodyModelPtr model;
    BodyState state;
    bool surface_current = true;
  };
  std::vector<Body> bodies;  // all of them, in their order
  std::vector<Pick> picks;
  std::vector<std::string> pick_bodies;  // one a pick
  std::vector<Attachment> attachments;
  std::vector<std::string> cut;     // bodies that were cut or opened
  std::vector<std::string> pieces;  // what they came apart into
  std::uint64_t stroke = 0;         // of blades in a hand; 0: of a command
};

/// What is drawn out or thrown apart without measure is matched in double.
bool fitsFloat(const WorldBody& body, double h);

/// Hashes of what is shared and does not change, models and obstacles: taken once.
class ContentHashes {
 public:
  template <class T>
  std::uint64_t of(const std::shared_ptr<const T>& content);
  /// Forgets those that nobody holds any more: another may come to lie where they were.
  void tidy();

 private:
  struct Known {
    std::weak_ptr<const void> owner;
    std::uint64_t hash = 0;
  };
  std::unordered_map<const void*, Known> known_;
};

/// What is kept from step to step, and in saved states: beside bodies, obstacles and what contact remembers.
struct KeptWorld {
  WorldSettings settings;
  Vec3 scene_gravity = Vec3::Zero();  // [m/s^2] to which a reset goes back
  std::uint64_t step = 0;
  bool batches_current = false;            // false: bodies or materials have changed
  std::vector<std::uint32_t> generations;  // one a slot
  std::vector<std::uint32_t> free_slots;
  std::uint32_t next_number = 1;
  std::set<std::string> used_names;  // living and retired of this run
  std::vector<std::shared_ptr<const PreparedBody>> scene;
  std::vector<Pick> picks;
  PickId next_pick = 1;
  std::vector<Attachment> attachments;     // in the order in which they came
  std::set<std::string> used_attachments;  // names of this run
  std::vector<AttachCommand> scene_attachments;
  std::vector<AppliedForce> forces;
  PushSphere push;
  Scissors scissors;
  std::vector<Instrument> instruments;
  std::uint32_t next_instrument = 1;
  std::vector<InstrumentDef> scene_instruments;
  std::vector<ClosingCut> closing;
  std::uint32_t next_ticket = 1;
  std::uint32_t next_sleep_group = 1;
  std::uint64_t tetrahedralizations = 0;
};

struct World::Impl : KeptWorld {
  ContentHashes content_hashes;
  ForEach for_each = oneAfterAnother;
  /// work(n) for n below count, shared out over the threads.
  template <class Work>
  void forNumbers(std::size_t count, const Work& work) const {
    constexpr std::size_t kTask = 128;
    runEach(for_each, (count + kTask - 1) / kTask, [&](std::size_t task) {
      for (std::size_t n = task * kTask; n < std::min(count, (task + 1) * kTask); ++n) work(n);
    });
  }
  std::uint32_t run = 1;
  std::vector<std::unique_ptr<WorldBody>> bodies;  // in the order in which they came
  std::vector<std::shared_ptr<WorldObstacle>> obstacles;
  std::vector<std::shared_ptr<InstrumentBody>> instrument_bodies;  // one each of instruments
  struct AttachedFibre {
    Fibre* fibre = nullptr;
    double stiffness = 0.0;     // [N/m]
    Index a = 0, b = kNoIndex;  // bodies
  };
  struct AttachedFibres {  // of a step, by their first bodies
    std::vector<AttachedFibre> all;
    std::vector<Index> offsets, of_body;  // compressed rows, one a body; empty where there are none
  };
  AttachedFibres attached;
  std::map<std::uint32_t, Result<CutReply>> finished;
  std::vector<Event> events;
  std::uint64_t commands = 0;                                   // that came, since the start of the process
  double wall_time = std::numeric_limits<double>::quiet_NaN();  // [s] since 1970
  std::vector<CutUndo> undo;                                    // the last is the next to be undone
  StepReport report;
  std::vector<WorldBody*> awake;  // of this frame, in the order of bodies
  std::vector<char> faulty;       // one each: its coordinates are no numbers
  struct Sleepers {               // in fallAsleep(), one a body
    UnionFind joined;
    std::vector<char> held, ready, whole;  // of an island's root
    std::vector<double> size;              // [m] of an island's largest
    std::vector<std::uint32_t> group;
  };
  Sleepers sleepers;
  std::vector<WorldBatch> batches;
  std::mutex lanes_mutex;                       // of the batches' spare lanes
  std::vector<std::pair<Index, Index>> loaded;  // in listLoaded()
  bool contacts_current = false;                // bodies are those of the last step
  SurfaceContacts surface_contacts;
  SurfaceScene surface_scene;       // of this step
  std::vector<Collider> colliders;  // bodies in their order, then obstacles, then instruments
  std::vector<SurfaceWork> surface_work;
  std::size_t work_count = 0;       // of it in use
  std::vector<WorldBody*> members;  // of an island: in stepSurfaces()
  std::vector<char> pushed;
  RecordSink record_sink;

  WorldBody* find(const std::string& name);
  WorldBody* find(const BodyId& id);
  Pick* findPick(PickId id);  // no latch
  void say(EventType type, const std::string& body, PickId pick, const std::string& text);
  WorldBody& admit(std::string name, Material material, BodyModelPtr model, BodyState state);
  void retire(const BodyId& id);
  Result<SpawnReply> spawn(const PreparedBody& body);
  static void refreshSurface(WorldBody& body);
  /// As it is shown: with what of the push sphere's dent cells are too coarse to carry.
  Points shownSurface(const WorldBody& body) const;
  void needContactMesh(WorldBody& body);
  std::string knownBodies() const;

  // commands
  Result<Reply> apply(const PickCommand& command);
  Result<Reply> apply(const MovePickCommand& command);
  Result<Reply> apply(const LockCommand& command);
  Result<Reply> apply(const ReleaseCommand& command);
  Result<Reply> apply(const ClearPicksCommand& command);
  Result<Reply> apply(const PushCommand& command);
  Result<Reply> apply(const CutCommand& command);
  Result<Reply> apply(const OpenScissorsCommand& command);
  Result<Reply> apply(const OpenBladesCommand& command);
  Result<Reply> apply(const LiftCommand& command);
  Result<Reply> apply(const UndoCutCommand& command);
  Result<Reply> apply(const InciseCommand& command);
  Result<Reply> apply(const SetMaterialCommand& command);
  Result<Reply> apply(const SpawnCommand& command);
  Result<Reply> apply(const RemoveCommand& command);
  Result<Reply> apply(const AttachCommand& command);
  Result<Reply> apply(const DetachCommand& command);
  Result<Reply> apply(const ClipCommand& command);
  Result<Reply> apply(const MoveClampCommand& command);
  void followClamps(const MoveClampCommand& command);
  Result<Reply> apply(const SetGravityCommand& command);
  Result<Reply> apply(const PlaceBodyCommand& command);
  Result<Reply> apply(const ResetBodiesCommand& command);
  Result<Reply> apply(const ApplyForceCommand& command);
  Result<Reply> apply(const AttachInstrumentCommand& command);
  Result<Reply> apply(const DetachInstrumentCommand& command);
  Result<Reply> apply(const LeadInstrumentCommand& command);
  /// What the command would change, or why it is refused.
  Result<std::vector<MaterialChange>> changesOf(const SetMaterialCommand& command) const;
  std::string letGo(const Pick& pick);  // one of picks; the name of its body
  /// Of picks and fibres of a body that goes; `why` follows on "released: ".
  void letGoOf(const WorldBody& body, const std::string& why);
  void wakeAtSphere();
  void liftSphere();
  Vec3 placeBeside(const Vec3& centre, double radius);  // [m] the nearest where a sphere is out of tissue
  CutUndo beforeCut() const;
  std::uint64_t stroke_of_cut = 0;  // that is made: CutUndo::stroke
  void rememberCut(CutUndo before, std::vector<std::string> cut, std::vector<std::string> pieces);
  Status checkCut(const CutCommand& command);
  Result<CutReply> cutNow(const CutCommand& command);
  /// at_rest: the blade as the one body that is named has it at rest, where it is told.
  Result<InciseReply> inciseNow(const InciseCommand& command, const Blade* at_rest = nullptr);
  /// Refuses what would leave more pieces than kMostPieces; `gone` of those there are go, `come` are made.
  Status checkPieces(std::size_t gone, std::size_t come) const;
  double graspRadius(const BodyModel& model) const;           // [m]
  std::vector<TissuePlace> picked(const BodyId& body) const;  // places of its picks, in their order
  /// Retires a body and admits its pieces in its place; their names.
  std::vector<std::string> replaceByPieces(const BodyId& parent, std::vector<BodyPiece> pieces);
  /// What becomes of a piece's particles and of places that were asked for, once the piece is a body.
  struct Descent {
    BodyId child;
    std::vector<Index> parent_particles, copied_from;
    std::vector<TissuePlace> places;
  };
  static Descent descentOf(BodyPiece& piece);
  /// Picks of a body go where the tissue goes that they hold; `before` [m]: of its particles.
  void followPieces(const BodyId& parent, const Points& before, const std::vector<Descent>& pieces);
  Index centreIn(const Descent& piece, const TissuePlace& place, Index grabbed);

  // attachments
  Result<AttachReply> attach(const AttachCommand& command);
  /// Fibres that `gone` says, with an event that says why.
  std::size_t loseFibres(Attachment& attachment, EventType type, const std::string& why,
                         const std::function<bool(const Fibre&)>& gone);
  Points fibreEnds(const Fibre& fibre);  // [m] two
  std::string firstBodyOf(const Attachment& attachment);
  void showAttachments(const SnapshotWants& wants, std::vector<AttachmentSnapshot>& shown);
  Vec3 restPlace(const Attachment& clip);
  /// Those of the bodies named (none: of all) that the blades part, which sever the bodies of those ids along their
  /// whole plane.
  std::vector<std::vector<char>> partedBy(const Blade& blade, const std::vector<std::string>& of,
                                          const std::vector<BodyId>& severed);
  static bool anyIn(const std::vector<std::vector<char>>& parted);
  /// Sentences, one an attachment.
  std::vector<std::string> partFibres(const std::vector<std::vector<char>>& parted);
  /// Of a body that was of that model, with its particles there [m], and has become these.
  void followFibres(const BodyId& parent, const BodyModel& model, const Points& before,
                    const std::vector<BodyId>& pieces);
  /// As it is now.
  ShownSurface shownNow(WorldBody& body);
  /// Of an attachment: the one that is wanted, or one that is chosen after `stem`.
  Result<std::string> newAttachmentName(const std::string& wanted, const std::string& stem) const;
  void keepAttachment(Attachment made);  // in place of one of that name that is torn off
  /// On the outside of what a clip holds.
  std::vector<std::array<Vec3, 2>> jawLines(const Attachment& clip);
  void closeClips(double h_frame);
  void listFibres();
  void wakeAttached();
  void tearFibres();

  // forces that are applied
  struct ForcedPoint {
    Vec3 force;  // [N] mean over this step
    const BodyPoint* at;
  };
  std::map<const WorldBody*, std::vector<ForcedPoint>> forced;  // of this step
  bool isForced(const BodyId& body) const;
  /// With an event for each body on which one ends.
  void forgetForces(const std::function<bool(const AppliedForce::Point&)>& gone);
  void sayForceEnds(const Vec3& force, const std::set<BodyId>& on);
  void listForces();
  /// In a substep of h [s], on bodies that have moved in it and whose velocities follow from that.
  void applyForces(const std::vector<WorldBody*>& some, double h) const;
  /// [m/s^2] The largest of a body as a whole, of those in that range.
  double forcedAcceleration(const std::vector<WorldBody*>& some, std::size_t begin, std::size_t end) const;
  void endForces(double h_frame);
  /// Of jaws that hold the body; `why` follows on "let go of it: ".
  void emptyJaws(const WorldBody& body, const std::string& why);

  // the log of commands, where there is one
  void record(const Command& command) const;
  void recordScissors() const;
  void recordReset() const;
  void recordState(const SavedWorld& saved) const;

  // instruments
  Instrument* findInstrument(const std::string& name);
  std::string knownInstruments() const;
  void makeInstrumentBodies();
  /// Else an instrument is in the tissue, or it is in one (kInvalidArgument).
  Status liesApart(const Points& tissue, const BodyModel& model, const std::string& name) const;
  static Status liesApart(const InstrumentBody& instrument, const std::string& instrument_name, const Points& tissue,
                          const Box& bounds, const BodyModel& model, const std::string& name);
  std::vector<WorldBody*> sleepersAt(std::size_t n);  // that press on an instrument
  bool wakeInHands();
  /// Blades of instruments cut what they have crossed.
  void cutByInstruments();
  /// Whether there was something to cut.
  bool snip(std::size_t n, WorldBody& body, double cuts_to, bool snips);
  void cutByEdge(std::size_t n);
  enum class EdgeIs { kOutside, kInside, kLeaving };
  /// Where the edge of a scalpel is; what it has swept opens where it cuts.
  EdgeIs sweepEdge(std::size_t n, WorldBody& body, bool cuts);
  bool cutWound(std::size_t n, WorldBody& body, BladeWound wound, const Vec2& from, const Vec2& to,
                const InciseCommand& command);
  /// [m] of what is deepest in an obstacle; zero: nothing is.
  Vec3 wayOutOfObstacles(InstrumentBody& body) const;
  void leadInstruments(double h_frame);
  /// Of a search for h [s], with h_left of the frame to come.
  void fillInstrumentCollider(std::size_t n, double h, double h_left, Collider& collider);
  /// The next of so many substeps of h [s] that are left in the frame.
  void advanceInstrument(Index collider, double h, int left);
  /// What an island presses on it after a substep of h [s], which is that share of the frame.
  void feelInstrument(Index island, Index collider, double h, double share);
  void forgetLoad(std::size_t n);
  bool anyInstrumentGoes() const;
  void stepFreeInstruments(double h, int parts, int parts_left);
  void finishInstruments(double h_frame);
  /// The spring of a latch; null where there is none any more.
  Pick* latchOf(const Instrument& instrument);
  void latch(Instrument& instrument, const WorldBody& body, const Vec3& at);
  void unlatch(Instrument& instrument);
  void addLatch(const Instrument& instrument, InstrumentLoad& load);
  /// Of a clip applier whose jaws have closed on a body.
  void putOnClip(Instrument& instrument, const std::string& body);

  // stages of a step
  void listAwake();
  void groupBatches();
  void addBatch(std::vector<WorldBody*> group);
  void leadClamps(double h_frame);
  void clearForces();
  void takeStep();
  void finishStep(double h_frame);
  void matchAlone(WorldBody& body, double h, MatchCounters& counters, const ForEach& each) const;
  std::unique_ptr<BatchLanes> borrowLanes(WorldBatch& batch);
  void giveBackLanes(WorldBatch& batch, std::unique_ptr<BatchLanes> lanes);
  void findLoads(const SurfaceWork& work);
  void keepSizes(SurfaceWork& work);
  /// The body and all that fell asleep with it.
  void wake(WorldBody& body);
  void wakeWithin(const Box& box);
  void wakePushed(double h_frame);
  void fallAsleep(double h_frame);
  void mendFaults();
  void emptyCavities();
  /// Of a body that a blade has just made or opened.
  void sayLeaks(const std::string& name, const BodyModel& model, const BodyState& state);
  void findCollapsed();
  void closeBlades();
  void showBlades(const ClosingCut& cut);
  double substepNow() const;                 // [s]
  bool isHeld(const WorldBody& body) const;  // by a pick
  /// Pairs of contact: textbook, as rows.
  void findTextbook(double h);
  const SurfaceModel& surfaceModel(WorldBody& body);
  static void measureSurface(WorldBody& body);
  static void fillCollider(WorldBody& body, double h_frame, Collider& collider);
  void findNear(double h, int parts_left = 1);
  int searchesOf(double h_frame);
  void findSurfaceContacts(double h, int parts_left);
  Vec3 pushWay(double h_frame) const;                    // [m] of the push sphere in a frame
  std::vector<std::pair<double, std::size_t>> stiffest;  // of an island: less the substeps that a body needs, and which
  void saySlowed(const WorldBody& body, int given, bool by_most, double factor);
  /// Of what deforms a body, the share that it answers: the rest moves it as a whole.
  static double yieldsOf(const WorldBody& body);
  int substepsOf(const std::vector<WorldBody*>& some, bool may_meet, double h, int parts);
  /// One of so many parts of a frame, h [s] each; parts_left: with it.
  void stepSurfaces(double h, int parts, int parts_left);
  /// How bodies of an island answer contact in this substep: by how far what deforms is slowed in it.
  void shareAnswers(Index island);
  void addWork(Index island, int substeps);
  void stepWork(SurfaceWork& work, double h, int parts, int parts_left, const ForEach& each);
  /// Who presses on whom: for who sleeps, and who is wound up.
  void listLoaded();
  /// Else it or what is there lies wholly inside the other: refused (kInvalidArgument).
  Status liesApart(const PreparedBody& body, const std::vector<BodyId>& but = {});
  Status liesApart(const WorldObstacle& obstacle);
  template <class Check>
  Status eachAround(const Box& box, const std::vector<BodyId>& but, const Check& check);
};

/// Bodies that cuts have made or opened, at most: a blade through all of a heap of crumbs would double it, and each of
/// them is next to all others.
inline constexpr std::size_t kMostPieces = 1000;

/// Why it cannot be an obstacle, whatever others there are.
Status checkObstacle(const ObstacleDef& obstacle);

/// "<name> is <value>; accepted: <range>"
Error outOfRange(const std::string& name, double value, const std::string& accepted);
Error notFinite(const std::string& name);
/// No mesh, and of numbers.
Status checkRegion(const std::optional<Region>& region);

}  // namespace meshless
