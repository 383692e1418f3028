// Lifetime of bodies, snapshots. The whole state and its hash are in saved_world.cpp. Commands are in
// world_commands.cpp, cuts in world_cut.cpp, time in world_step.cpp.
#include "meshless_surgery/world/world.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <sstream>

#include "meshless_surgery/body/cavities.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/tetrahedralize.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/tools/grasp.h"
#include "meshless_surgery/world/in_ground.h"
#include "world_impl.h"

namespace meshless {

Error outOfRange(const std::string& name, double value, const std::string& accepted) {
  std::ostringstream text;
  text << name << " is " << value << "; accepted: " << accepted;
  return {ErrorCode::kInvalidArgument, text.str()};
}

Error notFinite(const std::string& name) {
  return {ErrorCode::kInvalidArgument, name + " is not finite; accepted: finite numbers"};
}

const char* toString(EventType type) {
  switch (type) {
    case EventType::kPicked:
      return "picked";
    case EventType::kLocked:
      return "locked";
    case EventType::kReleased:
      return "released";
    case EventType::kCut:
      return "cut";
    case EventType::kIncised:
      return "incised";
    case EventType::kTouched:
      return "touched";
    case EventType::kAsleep:
      return "asleep";
    case EventType::kAwake:
      return "awake";
    case EventType::kOverBudget:
      return "over budget";
    case EventType::kSpawned:
      return "spawned";
    case EventType::kRemoved:
      return "removed";
    case EventType::kReset:
      return "reset";
    case EventType::kFault:
      return "fault";
    case EventType::kUndone:
      return "undone";
    case EventType::kLifted:
      return "lifted";
    case EventType::kLoaded:
      return "loaded";
    case EventType::kAttached:
      return "attached";
    case EventType::kDetached:
      return "detached";
    case EventType::kTorn:
      return "torn";
    case EventType::kLeak:
      return "leak";
    case EventType::kClipped:
      return "clipped";
    case EventType::kCollapsed:
      return "collapsed";
    case EventType::kMaterial:
      return "material";
    case EventType::kClampMoved:
      return "clamp moved";
    case EventType::kInstrument:
      return "instrument";
    case EventType::kGrasped:
      return "grasped";
    case EventType::kDropped:
      return "dropped";
    case EventType::kGravity:
      return "gravity";
    case EventType::kPlaced:
      return "placed";
    case EventType::kRestored:
      return "restored";
    case EventType::kForce:
      return "force";
    case EventType::kMisfired:
      return "misfired";
    case EventType::kTask:
      return "task";
  }
  return "unknown";
}

Status WorldSettings::validate() const {
  if (!(gravity.norm() <= 1e4)) return outOfRange("the length of gravity", gravity.norm(), "0 to 1e4 m/s^2");
  if (ground && !(std::abs(*ground) <= 1e6)) return outOfRange("ground", *ground, "-1e6 to 1e6 m, or none");
  if (!(ground_friction >= 0.0 && ground_friction <= 10.0))
    return outOfRange("ground_friction", ground_friction, "0 to 10");
  if (!(step_rate >= 1.0 && step_rate <= 10000.0)) return outOfRange("step_rate", step_rate, "1 to 10000 Hz");
  if (!(substeps >= 1 && substeps <= 1000)) return outOfRange("substeps", substeps, "1 to 1000");
  if (!(max_substeps >= 1 && max_substeps <= 1000)) return outOfRange("max_substeps", max_substeps, "1 to 1000");
  if (!(threads >= 1 && threads <= 64)) return outOfRange("threads", threads, "1 to 64");
  if (!(pick_max_distance > 0.0 && pick_max_distance <= 1e6))
    return outOfRange("pick_max_distance", pick_max_distance, "above 0 to 1e6 m");
  if (!(pick_stiffness > 0.0 && pick_stiffness <= 1e12))
    return outOfRange("pick_stiffness", pick_stiffness, "above 0 to 1e12 N/m");
  if (!(pick_radius >= 0.0 && pick_radius <= 1e6)) return outOfRange("pick_radius", pick_radius, "0 to 1e6 m");
  if (!(push_radius > 0.0 && push_radius <= 1e6)) return outOfRange("push_radius", push_radius, "above 0 to 1e6 m");
  return Done{};
}

// --- Impl: bodies

WorldBody* World::Impl::find(const std::string& name) {
  for (auto& body : bodies)
    if (body->name == name) return body.get();
  return nullptr;
}

WorldBody* World::Impl::find(const BodyId& id) {
  for (auto& body : bodies)
    if (body->id == id) return body.get();
  return nullptr;
}

Pick* World::Impl::findPick(PickId id) {
  for (Pick& pick : picks)
    if (pick.id == id && !pick.latch) return &pick;
  return nullptr;
}

void World::Impl::say(EventType type, const std::string& body, PickId pick, const std::string& text) {
  events.push_back({type, step, static_cast<double>(step) / settings.step_rate, body, pick, text});
  events.back().command = commands;
}

std::string World::Impl::knownBodies() const {
  constexpr std::size_t kMost = 20;
  std::string list;
  for (std::size_t i = 0; i < bodies.size() && i < kMost; ++i) list += (i ? ", " : "") + bodies[i]->name;
  if (bodies.size() > kMost) list += " and " + std::to_string(bodies.size() - kMost) + " more";
  return list.empty() ? "there are no bodies" : "bodies are: " + list;
}

WorldBody& World::Impl::admit(std::string name, Material material, BodyModelPtr model, BodyState state) {
  auto body = std::make_unique<WorldBody>();
  if (free_slots.empty()) {
    body->id.slot = static_cast<std::uint32_t>(generations.size());
    generations.push_back(0);
  } else {
    body->id.slot = free_slots.back();
    free_slots.pop_back();
  }
  body->id.generation = generations[body->id.slot];
  body->number = next_number++;
  used_names.insert(name);
  body->name = body->root = std::move(name);
  body->material = std::move(material);
  body->model = std::move(model);
  body->state = std::move(state);
  body->bounds = boundsOf(body->state.surface);
  bodies.push_back(std::move(body));
  batches_current = contacts_current = false;
  return *bodies.back();
}

void World::Impl::retire(const BodyId& id) {
  for (auto it = bodies.begin(); it != bodies.end(); ++it)
    if ((*it)->id == id) {
      surface_contacts.forget((*it)->number);  // else the hash has it until the next search
      ++generations[id.slot];
      free_slots.push_back(id.slot);
      bodies.erase(it);
      batches.clear();
      batches_current = contacts_current = false;
      return;
    }
}

Result<SpawnReply> World::Impl::spawn(const PreparedBody& body) {
  const std::string& name = body.def.name;
  if (name.empty()) return Error{ErrorCode::kInvalidArgument, "a body needs a name"};
  if (used_names.count(name))
    return Error{ErrorCode::kDuplicateName,
                 "the name '" + name + "' is in use or was retired in this run; " + knownBodies()};
  if (Status apart = liesApart(body); !apart) return apart.error();
  WorldBody& admitted = admit(name, body.def.material, body.model, body.state);
  std::string text = "spawned " + name;
  for (const std::string& warning : body.def.warnings) text += "; " + warning;
  if (const std::string in_ground = warnOfGround(body, settings.ground); !in_ground.empty()) text += "; " + in_ground;
  say(EventType::kSpawned, name, 0, text);
  return SpawnReply{admitted.id, name, admitted.model->rest.size(), admitted.model->surface.triangles.size(),
                    admitted.model->groups()};
}

void World::Impl::refreshSurface(WorldBody& body) {
  if (body.surface_current) return;
  updateSurface(*body.model, body.state);
  body.surface_current = true;
}

Points World::Impl::shownSurface(const WorldBody& body) const {
  Points shown = body.state.surface;
  if (!push.enabled || !body.model->elastic_batch) return shown;
  for (Vec3& p : shown) {
    const Vec3 way = p - push.position;
    const double distance = way.norm();  // contact lets it in by a third of the radius
    if (distance < push.radius && distance > 0.5 * push.radius) p = push.position + push.radius / distance * way;
  }
  return shown;
}

void World::Impl::needContactMesh(WorldBody& body) {
  if (body.mesh) return;
  auto mesh = std::make_shared<ContactMesh>();
  if (body.model->solid && body.model->rest.size() >= 4) {
    mesh->tetrahedra = tetrahedralize(body.model->rest, SolidQuery(body.model->surface));
    mesh->faces = boundaryFaces(mesh->tetrahedra);
    mesh->edges = tetrahedronEdges(mesh->tetrahedra);
    ++tetrahedralizations;
  }
  body.mesh = std::move(mesh);
}

// --- World

World::World(WorldSettings settings) : impl_(std::make_unique<Impl>()) {
  impl_->settings = std::move(settings);
  impl_->scene_gravity = impl_->settings.gravity;
  impl_->for_each = makeForEach(impl_->settings.threads);
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

const WorldSettings& World::settings() const { return impl_->settings; }
std::uint64_t World::stepCount() const { return impl_->step; }
double World::simTime() const { return static_cast<double>(impl_->step) / impl_->settings.step_rate; }
std::size_t World::bodyCount() const { return impl_->bodies.size(); }
bool World::nameUsed(const std::string& name) const { return impl_->used_names.count(name) > 0; }
const PushSphere& World::push() const { return impl_->push; }
std::uint32_t World::run() const { return impl_->run; }
const Scissors& World::scissors() const { return impl_->scissors; }
double World::wallTime() const { return impl_->wall_time; }

Result<Reply> World::apply(const Command& command) {
  impl_->record(command);
  ++impl_->commands;
  Result<Reply> reply = std::visit([this](const auto& c) { return impl_->apply(c); }, command);
  if (!reply.ok()) --impl_->commands;  // a material's change that is refused is not in the log
  return reply;
}

Result<SpawnReply> World::addSceneBody(std::shared_ptr<const PreparedBody> body) {
  Result<SpawnReply> reply = impl_->spawn(*body);
  if (reply) impl_->scene.push_back(std::move(body));
  return reply;
}

Status checkObstacle(const ObstacleDef& obstacle) {
  if (obstacle.name.empty()) return Error{ErrorCode::kInvalidArgument, "an obstacle needs a name"};
  if (!(obstacle.friction >= 0.0 && obstacle.friction <= 10.0))
    return outOfRange("friction of obstacle '" + obstacle.name + "'", obstacle.friction, "0 to 10");
  for (const Vec3& p : obstacle.mesh.vertices)
    if (!p.allFinite()) return notFinite("a vertex of obstacle '" + obstacle.name + "'");
  const double volume = obstacle.mesh.empty() ? 0.0 : signedVolume(obstacle.mesh);
  if (!(volume > 0.0))
    return Error{ErrorCode::kUnsuitableShape,
                 "obstacle '" + obstacle.name + "' encloses a volume of " + std::to_string(volume) +
                     " m^3; accepted: a closed surface, counter-clockwise seen from outside"};
  return Done{};
}

Status World::addObstacle(ObstacleDef obstacle) {
  Impl& w = *impl_;
  for (const auto& other : w.obstacles)
    if (other->def->name == obstacle.name)
      return Error{ErrorCode::kDuplicateName, "there is an obstacle '" + obstacle.name + "' already"};
  if (Status status = checkObstacle(obstacle); !status) return status.error();
  auto made = std::make_shared<WorldObstacle>(std::move(obstacle));
  if (Status apart = w.liesApart(*made); !apart) return apart.error();
  w.obstacles.push_back(std::move(made));
  w.wakeWithin(w.obstacles.back()->bounds);
  return Done{};
}

void World::reset() {
  Impl& w = *impl_;
  w.recordReset();
  for (const ClosingCut& c : w.closing)
    w.finished.emplace(c.ticket, Error{ErrorCode::kFailed, "the world was reset before the blades met"});
  w.closing.clear();
  while (!w.bodies.empty()) w.retire(w.bodies.back()->id);
  w.used_names.clear();
  w.picks.clear();
  w.attachments.clear();
  w.used_attachments.clear();
  w.surface_contacts.clear();
  w.next_sleep_group = 1;
  w.undo.clear();
  w.forces.clear();
  w.settings.gravity = w.scene_gravity;
  w.push = PushSphere();
  w.scissors = Scissors();
  w.instruments.clear();
  w.instrument_bodies.clear();
  w.step = 0;
  w.report = StepReport();
  ++w.run;
  w.say(EventType::kReset, "", 0, "back to the scene's start");
  for (const auto& body : w.scene) w.admit(body->def.name, body->def.material, body->model, body->state);
  for (const AttachCommand& attachment : w.scene_attachments)
    if (const auto made = w.attach(attachment); !made) w.say(EventType::kFault, "", 0, made.error().detail);
  for (const InstrumentDef& def : w.scene_instruments)
    if (const auto made = w.apply(AttachInstrumentCommand{def}); !made)
      w.say(EventType::kFault, "", 0, made.error().detail);
}

WorldSnapshot World::snapshot(const SnapshotWants& wants) {
  Impl& w = *impl_;
  WorldSnapshot shot;
  shot.step = w.step;
  shot.sim_time = simTime();
  shot.run = w.run;
  const double shortest = 1.0 / w.settings.step_rate / std::max(w.settings.substeps, w.settings.max_substeps);  // [s]
  for (auto& body : w.bodies) {
    BodySnapshot b;
    b.id = body->id;
    b.number = body->number;
    b.name = body->name;
    b.material = body->material;
    b.model = body->model;
    if (wants.surfaces || wants.measures) w.refreshSurface(*body);
    if (wants.surfaces) b.surface = w.shownSurface(*body);
    if (wants.particles) b.particles = body->state.positions;
    if (wants.measures) b.measures = measureBody(*body->model, body->state);
    b.placed = body->state.placed;
    // Of its last step, or of one that is still to come.
    b.stiffness_factor = std::min(body->stiffness_factor, stiffnessFactor(*body->model, body->state, shortest));
    b.asleep = body->asleep;
    b.tetrahedra = body->mesh ? body->mesh->tetrahedra.size() : 0;
    shot.bodies.push_back(std::move(b));
  }
  for (const auto& obstacle : w.obstacles) shot.obstacles.push_back(obstacle->def);
  const auto named = [&](Index collider) -> std::string {
    const std::size_t bodies = w.bodies.size(), fixed = bodies + w.obstacles.size();
    if (collider < bodies) return w.bodies[collider]->name;
    if (collider < fixed) return w.obstacles[collider - bodies]->def->name;
    return collider < fixed + w.instruments.size() ? w.instruments[collider - fixed].def.name : kGroundName;
  };
  if (wants.contacts && w.contacts_current) {
    std::vector<SurfaceContacts::Point> points;
    w.surface_contacts.points(w.colliders, points);
    for (const SurfaceContacts::Point& p : points)
      shot.contacts.push_back({named(p.on), p.by_sphere ? kPushName : named(p.by), p.position, p.normal, p.force});
  }
  if (wants.touches && w.contacts_current) {
    std::vector<std::pair<Index, Index>> pairs;
    w.surface_contacts.loadedSurfaces(pairs);
    for (const auto& [a, b] : pairs) {
      if (a == b) continue;
      if (a < shot.bodies.size()) shot.bodies[a].touches.push_back(named(b));
      if (b < shot.bodies.size()) shot.bodies[b].touches.push_back(named(a));
    }
  }
  std::copy_if(w.picks.begin(), w.picks.end(), std::back_inserter(shot.picks), [](const Pick& p) { return !p.latch; });
  for (const Pick& pick : shot.picks)
    if (const WorldBody* body = w.find(pick.body)) shot.pick_bodies[pick.id] = body->name;
  w.showAttachments(wants, shot.attachments);
  shot.push = w.push;
  shot.scissors = w.scissors;
  shot.instruments = w.instruments;
  for (const auto& body : w.instrument_bodies) shot.instrument_shapes.push_back(body->shape);
  shot.report = w.report;
  return shot;
}

Result<BodySnapshot> World::inspect(const std::string& name, bool rest) {
  Impl& w = *impl_;
  WorldBody* body = w.find(name);
  if (!body) return Error{ErrorCode::kUnknownName, "there is no body '" + name + "'; " + w.knownBodies()};
  w.needContactMesh(*body);
  w.refreshSurface(*body);
  BodySnapshot b;
  b.id = body->id;
  b.number = body->number;
  b.name = body->name;
  b.material = body->material;
  b.model = body->model;
  b.surface = w.shownSurface(*body);
  b.particles = body->state.positions;
  b.measures = measureBody(*body->model, body->state);
  b.placed = body->state.placed;
  if (rest) {  // where it was put: the model's frame may be another one
    const Pose& placed = body->state.placed;
    b.surface = body->model->surface.vertices;
    b.particles = body->model->rest;
    for (Points* points : {&b.surface, &b.particles})
      for (Vec3& p : *points) p = placed * p;
    b.measures.volume = body->model->rest_volume;
    b.measures.area = surfaceArea(body->model->surface);
    b.measures.cavities = measureCavities(*body->model, body->state.cavities, body->model->rest);
  }
  b.tetrahedra = body->mesh->tetrahedra.size();
  return b;
}

std::vector<Event> World::takeEvents() { return std::exchange(impl_->events, {}); }

void World::setScissors(const ScissorBlades& blades, double angle) {
  impl_->scissors.shown = true;
  impl_->scissors.blades = blades;
  impl_->scissors.angle = angle;
  impl_->recordScissors();
}

void World::hideScissors() {
  impl_->scissors.shown = false;
  impl_->recordScissors();
}

std::optional<Pick> World::heldPick() const {
  for (auto it = impl_->picks.rbegin(); it != impl_->picks.rend(); ++it)
    if (!it->locked) return *it;
  return std::nullopt;
}

double World::heldStiffness() const {
  const auto held = heldPick();
  const WorldBody* body = held ? impl_->find(held->body) : nullptr;
  return body ? graspStiffness(*body->model, *held, 1.0 / impl_->settings.step_rate) : 0.0;
}

}  // namespace meshless
