// Contact in present space: what bodies show of themselves, and how islands of them go through the substeps of a frame.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>

#include "meshless_surgery/dynamics/extent.h"
#include "meshless_surgery/tools/grasp.h"
#include "shape_colliders.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr int kContactSubsteps = 4;   // at least, where something may meet: in longer ones stacks of stiff bodies rock
constexpr double kSlowedMass = 0.05;  // of an island, at most: slivers are slowed, instead of all taking their substeps

// Bodies without a surface meet others by their particles.
ContactSurface surfaceOf(const BodyModel& model) {
  if (model.surface.vertices.empty()) return {TriangleMesh(), ownSupports(static_cast<Index>(model.rest.size()))};
  const SurfaceBinding& binding = model.collision ? model.collision->binding : model.binding;
  const TriangleMesh& mesh = model.collision ? model.collision->mesh : model.surface;
  const Index count = static_cast<Index>(mesh.vertices.size());
  VertexSupports supports;
  std::vector<Index> embedded(count, kNoIndex);
  for (Index r = 0; r < binding.embedded.size(); ++r) embedded[binding.embedded[r]] = r;
  supports.offsets.push_back(0);
  for (Index v = 0; v < count; ++v) {
    if (embedded[v] == kNoIndex) {
      supports.particles.push_back(binding.particle[v]);
      supports.weights.push_back(1.0);
    } else {
      for (Index k = binding.offsets[embedded[v]]; k < binding.offsets[embedded[v] + 1]; ++k) {
        supports.particles.push_back(binding.carriers[k]);
        supports.weights.push_back(binding.weights[k]);
      }
    }
    supports.offsets.push_back(static_cast<Index>(supports.particles.size()));
  }
  return {mesh, std::move(supports)};
}

// [m] of what meets others beyond the bounds of the particles, at most.
double contactReachOf(const BodyModel& model) {
  return embeddedReachOf(model) + (model.collision ? model.collision->distance : 0.0);
}

double secondsSince(std::chrono::steady_clock::time_point& last) {
  const auto now = std::chrono::steady_clock::now();
  const double seconds = std::chrono::duration<double>(now - last).count();
  last = now;
  return seconds;
}

Collider colliderOf(const WorldObstacle& obstacle, std::size_t number) {
  Collider collider;
  collider.key = kObstacleKey + number;
  collider.bounds = obstacle.bounds;
  collider.edge_length = obstacle.surface.edge_length;
  collider.surface = &obstacle.surface;
  collider.vertices = collider.positions = obstacle.def->mesh.vertices.data();
  collider.inverse_masses = obstacle.inverse_masses.data();
  collider.particles = obstacle.surface.vertices();
  collider.friction = obstacle.def->friction;
  collider.obstacle = true;
  collider.moves = false;
  return collider;
}

}  // namespace

SurfaceModel::SurfaceModel(BodyModelPtr of_model) : model(std::move(of_model)), surface(surfaceOf(*model)) {
  for (std::size_t i = 0; i < model->masses.size(); ++i)
    inverse_masses.push_back(model->fixed[i] ? 0.0 : 1.0 / model->masses[i]);
  if (!(model->specific_stiffness > 0.0) && !model->isHeld()) {
    groups = std::make_unique<RigidGroups>(model->clusters.offsets, model->clusters.members, model->clusters.weights,
                                           model->masses);
  } else if (!model->isHeld()) {
    std::vector<Index> all(model->masses.size());
    std::iota(all.begin(), all.end(), Index{0});
    groups = std::make_unique<RigidGroups>(std::vector<Index>{0, static_cast<Index>(all.size())}, all,
                                           std::vector<double>(all.size(), 1.0), model->masses);
  }
  reach = contactReachOf(*model);
}

std::size_t SurfaceModel::bytes() const {
  return sizeof *this + surface.bytes() + bytesOf(inverse_masses) + (groups ? groups->bytes() : 0);
}

const SurfaceModel& World::Impl::surfaceModel(WorldBody& body) {
  if (body.surface_model && body.surface_model->model == body.model) return *body.surface_model;
  for (const auto& other : bodies)
    if (other->surface_model && other->surface_model->model == body.model) {
      body.surface_model = other->surface_model;
      return *body.surface_model;
    }
  body.surface_model = std::make_shared<SurfaceModel>(body.model);
  ++report.contact_shapes;
  return *body.surface_model;
}

void World::Impl::fillCollider(WorldBody& body, double h_frame, Collider& collider) {
  collider = Collider();
  collider.key = body.number;
  collider.moves = !body.asleep;
  collider.friction = body.material.friction;
  collider.restitution = body.material.restitution;
  collider.edge_length = body.edge_length;
  collider.positions = body.state.positions.data();
  collider.velocities = body.state.velocities.data();
  collider.particles = static_cast<Index>(body.state.positions.size());
  collider.held = body.model->isHeld();
  if (body.asleep) {
    collider.bounds = body.bounds;
    return;
  }
  body.bounds = extentOf(body.state.positions);
  double fastest = 0.0;
  for (const Vec3& v : body.state.velocities) fastest = std::max(fastest, v.squaredNorm());
  body.fastest = std::sqrt(fastest);
  const Vec3 by = Vec3::Constant(body.surface_reach + h_frame * body.fastest);
  body.bounds.min -= by;
  body.bounds.max += by;
  collider.bounds = body.bounds;
  const SelfContact wanted = body.material.self_contact;
  if (!body.material.bends() || wanted == SelfContact::kNone) return;
  if (wanted == SelfContact::kAll) collider.self = PairSearch::Self::kAll;
  if (wanted == SelfContact::kWoundFaces && body.model->incised) collider.self = PairSearch::Self::kCuts;
}

// Once a model; a body's key figures are needed before anybody is near.
void World::Impl::measureSurface(WorldBody& body) {
  if (body.measured == body.model) return;
  body.measured = body.model;
  body.surface_reach = contactReachOf(*body.model);
  double sum = 0.0;
  std::size_t count = 0;
  const TriangleMesh& surface = body.model->collision ? body.model->collision->mesh : body.model->surface;
  for (const Triangle& t : surface.triangles)
    for (int k = 0; k < 3; ++k, ++count) sum += (surface.vertices[t[k]] - surface.vertices[t[(k + 1) % 3]]).norm();
  body.edge_length = count > 0 ? sum / static_cast<double>(count) : body.model->spacing;
  // A surface bends no more finely than its cells.
  if (body.model->lattice) body.edge_length = std::max(body.edge_length, body.model->spacing);
}

// Rows of the frame. A body that is reached wakes, and then all is found again with its neighbours.
void World::Impl::findSurfaceContacts(double h_frame) {
  SurfaceScene& scene = surface_scene;
  scene = SurfaceScene();
  scene.ground = settings.ground;
  scene.ground_friction = settings.ground_friction;
  scene.gravity = settings.gravity.norm();
  scene.h = h_frame;
  if (push.enabled) scene.sphere = SurfaceScene::Sphere{push.position, pushWay(h_frame), push.radius};
  for (;;) {
    colliders.resize(bodies.size() + obstacles.size());
    forNumbers(bodies.size(), [&](std::size_t b) {
      measureSurface(*bodies[b]);
      fillCollider(*bodies[b], h_frame, colliders[b]);
    });
    for (std::size_t o = 0; o < obstacles.size(); ++o) colliders[bodies.size() + o] = colliderOf(*obstacles[o], o);
    for (const Pick& pick : picks)
      for (std::size_t b = 0; b < bodies.size(); ++b)
        if (bodies[b]->id == pick.body) colliders[b].grasped = true;
    surface_contacts.findPairs(scene, colliders, report.contact_counters);
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      if (!surface_contacts.needed()[b]) continue;
      const SurfaceModel& model = surfaceModel(*bodies[b]);
      colliders[b].surface = &model.surface;
      colliders[b].inverse_masses = model.inverse_masses.data();
    }
    surface_contacts.findMoved(scene, colliders);
    forNumbers(bodies.size(), [&](std::size_t b) {
      if (!surface_contacts.moved()[b]) return;
      if (bodies[b]->model->surface.vertices.empty()) {
        colliders[b].vertices = bodies[b]->state.positions.data();
        return;
      }
      if (!bodies[b]->model->collision) {
        refreshSurface(*bodies[b]);
        colliders[b].vertices = bodies[b]->state.surface.data();
        return;
      }
      const ContactSurface& surface = *colliders[b].surface;
      Points& places = bodies[b]->collision;
      places.resize(surface.vertices());
      for (Index v = 0; v < places.size(); ++v) places[v] = surface.supports.sum(v, bodies[b]->state.positions.data());
      colliders[b].vertices = places.data();
    });
    surface_contacts.find(scene, colliders, report.contact_counters, for_each);
    bool woken = false;
    for (const Index c : surface_contacts.reached()) {
      woken = woken || bodies[c]->asleep;
      wake(*bodies[c]);
    }
    if (!woken) return;
    listAwake();
  }
}

Vec3 World::Impl::pushWay(double h_frame) const {
  const Vec3 way = push.target - push.position;
  const double length = way.norm(), most = push.speed * h_frame;
  return length > most ? Vec3(way * (most / length)) : way;
}

/// Substeps that the stiffest bodies of an island and its contacts need: no body that may meet something goes farther
/// than an edge in one. Slivers are not asked, but where they are picked. What is taken from a body is said once.
int World::Impl::substepsOf(const std::vector<WorldBody*>& some, bool may_meet, double h_frame) {
  double needed = may_meet ? std::max(settings.substeps, kContactSubsteps) : settings.substeps;
  stiffest.clear();
  double mass = 0.0;
  for (std::size_t n = 0; n < some.size(); ++n) {
    const WorldBody& body = *some[n];
    double substeps = std::ceil(h_frame * highestFrequencyNow(*body.model, body.state));
    if (may_meet) substeps = std::max(substeps, std::ceil(h_frame * body.fastest / body.edge_length));
    stiffest.push_back({std::isfinite(substeps) ? -substeps : -std::numeric_limits<double>::infinity(), n});
    mass += body.model->mass;
  }
  std::sort(stiffest.begin(), stiffest.end());
  double slowed = 0.0;  // [kg]
  for (const auto& [less, n] : stiffest) {
    slowed += some[n]->model->mass;
    if (slowed <= kSlowedMass * mass && !isHeld(*some[n])) continue;
    needed = std::max(needed, -less);
    break;
  }
  const int most = std::max(settings.substeps, settings.max_substeps);
  const int substeps = needed < most ? static_cast<int>(needed) : most;  // NaN: most
  for (WorldBody* body : some) {
    const double factor = stiffnessFactor(*body->model, body->state, h_frame / substeps);
    if (factor < 1.0 && !(body->stiffness_factor < 1.0)) {
      std::ostringstream text;
      text << body->name << " needs " << std::ceil(h_frame * highestFrequencyNow(*body->model, body->state))
           << " substeps for its material; with " << substeps
           << (substeps < most ? " (as those beside it, which are heavier)" : " (max_substeps)") << " it deforms "
           << 1.0 / std::sqrt(factor) << " times as slowly, to where it would";
      say(EventType::kOverBudget, body->name, 0, text.str());
    }
    body->stiffness_factor = factor;
  }
  return substeps;
}

// Islands know nothing of each other within a frame: each takes the substeps that it needs. Where one has most of the
// particles its bodies are shared out over threads, else the islands are.
void World::Impl::stepSurfaces(double h_frame) {
  const auto& islands = surface_contacts.islands();
  surface_work.resize(islands.size());
  std::size_t largest = 0, total = 0;
  for (std::size_t n = 0; n < islands.size(); ++n) {
    SurfaceWork& work = surface_work[n];
    work.bodies.clear();
    std::size_t particles = 0;
    for (const Index b : islands[n].bodies) {
      work.bodies.push_back(bodies[b].get());
      particles += bodies[b]->state.positions.size();
    }
    total += particles;
    largest = std::max(largest, particles);
    work.substeps = substepsOf(work.bodies, !islands[n].rows.empty() || !islands[n].watched.empty(), h_frame);
    work.picks.clear();
    for (Pick& pick : picks) {
      const WorldBody* const body = find(pick.body);
      if (body && std::find(work.bodies.begin(), work.bodies.end(), body) != work.bodies.end())
        work.picks.push_back(&pick);
    }
    report.substeps = std::max(report.substeps, static_cast<std::size_t>(work.substeps));
    for (std::size_t k = 0; k < work.bodies.size(); ++k) {
      const WorldBody& body = *work.bodies[k];
      const Index b = islands[n].bodies[k];
      // As what deforms answers its own stiffness (see matchAndMove): a body that is slowed, or clusters drawn to
      // shape.
      if (!surface_contacts.needed()[b]) continue;
      if (body.material.elastic())
        surface_contacts.setRigidShare(b, body.surface_model->groups.get(), 1.0 - body.stiffness_factor);
      else if (body.surface_model->groups)
        surface_contacts.setRigidShare(b, body.surface_model->groups.get(), body.material.alpha);
    }
  }
  if (2 * largest > total) {
    for (std::size_t n = 0; n < islands.size(); ++n) stepIsland(n, h_frame, for_each);
  } else {
    runEach(for_each, islands.size(), [&](std::size_t n) { stepIsland(n, h_frame, oneAfterAnother); });
  }
  for (const SurfaceWork& work : surface_work) {
    report.match_counters += work.match_counters;
    report.preserve_counters += work.preserve_counters;
    report.contact_counters.corrected += work.solver_counters.active;
    report.ground_contacts += work.solver_counters.ground;
    report.match += work.match;
    report.contact += work.contact;
    if (!work.touched) continue;
    push.touching = true;
    push.force -= work.push_force;
  }
  if (!push.enabled) return;
  surface_contacts.pushedBySphere(pushed);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    WorldBody& body = *bodies[b];
    if (body.asleep) continue;
    if (pushed[b] && !body.touched_by_push)
      say(EventType::kTouched, body.name, 0, "the push sphere touched " + body.name);
    body.touched_by_push = pushed[b];
    report.push_contacts += pushed[b];
  }
}

void World::Impl::stepIsland(std::size_t number, double h_frame, const ForEach& each) {
  SurfaceWork& work = surface_work[number];
  const std::vector<WorldBody*>& some = work.bodies;
  const int substeps = work.substeps;
  const double h = h_frame / substeps;
  work.match_counters = MatchCounters();
  work.preserve_counters = PreserveCounters();
  work.solver_counters = SolverCounters();
  work.match = work.contact = 0.0;
  work.push_force.setZero();
  work.touched = false;
  work.each_counters.resize(some.size());
  work.previous.resize(some.size());
  work.springs.clear();
  for (const Pick* pick : work.picks) {
    SpringRow spring;
    const WorldBody* const body = find(pick->body);
    spring.body = surface_contacts.islands()[number].bodies[std::find(some.begin(), some.end(), body) - some.begin()];
    spring.patch = &pick->patch;
    spring.weights = &pick->weights;
    spring.stiffness = pick->stiffness;
    work.springs.push_back(spring);
  }
  const bool held = surface_contacts.islands()[number].free.empty() && !surface_contacts.islands()[number].rows.empty();
  for (WorldBody* body : some) {
    body->scratch.touched.clear();
    body->scratch.lies = held;
  }
  const Vec3 way = push.enabled ? pushWay(h_frame) : Vec3(Vec3::Zero());
  SolverStep step;
  step.h = h;
  step.sphere_radius = push.radius;
  auto last = std::chrono::steady_clock::now();
  for (int substep = 0; substep < substeps; ++substep) {
    runEach(each, some.size(), [&](std::size_t b) {
      work.each_counters[b] = MatchCounters();
      matchAlone(*some[b], h, work.each_counters[b]);
      work.previous[b] = some[b]->scratch.previous.data();
    });
    for (const MatchCounters& counters : work.each_counters) work.match_counters += counters;
    work.match += secondsSince(last);
    // A target that jumps is followed evenly over the frame.
    const int left = substeps - substep - 1;
    for (std::size_t p = 0; p < work.picks.size(); ++p) {
      const Pick& pick = *work.picks[p];
      work.springs[p].end = pick.target - left * (pick.target - pick.reached) / substeps - pick.offset;
      work.springs[p].impulse.setZero();
    }
    step.sphere_from = push.position + substep * way / substeps;
    step.sphere_to = push.position + (substep + 1) * way / substeps;
    surface_contacts.solveIsland(static_cast<Index>(number), step, substep, surface_scene, colliders, work.previous,
                                 work.springs, work.solver_scratch, work.limit_scratch, work.solver_counters, each);
    for (std::size_t p = 0; p < work.picks.size(); ++p)
      work.picks[p]->force += work.springs[p].impulse / (h * h * substeps);
    if (push.enabled) {
      const Vec3 impulse = surface_contacts.sphereImpulse(static_cast<Index>(number));
      work.push_force += impulse / (h * h * substeps);
      work.touched = work.touched || !impulse.isZero(0.0);
    }
    work.contact += secondsSince(last);
    for (WorldBody* body : some) keepSize(*body, work.preserve_counters);
    runEach(each, some.size(),
            [&](std::size_t b) { velocitiesFromPositions(*some[b]->model, h, some[b]->state, some[b]->scratch); });
    work.match += secondsSince(last);
  }
  surface_contacts.finishIsland(static_cast<Index>(number), h);
  for (WorldBody* body : some) fadeEmbeddedOffsets(*body, h_frame);
}

}  // namespace meshless
