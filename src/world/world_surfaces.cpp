// Contact in present space: what bodies show of themselves, and how islands of them go through the substeps of a frame.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <sstream>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/body/preserve.h"
#include "meshless_surgery/dynamics/extent.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/tools/grasp.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr int kContactSubsteps = 4;   // at least, where something may meet: in longer ones stacks of stiff bodies rock
// Edges, between two searches: as far as half of what is thinnest near, within these.
constexpr double kNearest = 0.5, kFarthest = 1.0;
constexpr double kMostSearches = 64;  // of a frame
constexpr std::size_t kSharedParticles = 4000;  // of a body: less is done before another thread has begun
constexpr std::size_t kWorkParticles = 512;  // of small islands together: what they read stays in the cache
constexpr double kSlowedMass = 0.05;  // of an island, at most: slivers are slowed, instead of all taking their substeps

// Bodies without a surface meet others by their particles.
ContactSurface surfaceOf(const BodyModel& model) {
  if (model.surface.vertices.empty()) return {TriangleMesh(), ownSupports(static_cast<Index>(model.rest.size()))};
  SurfaceBinding binding = model.collision ? model.collision->binding : model.binding;
  if (model.lattice && !model.elastic_batch)
    binding = cornerCarriers(binding, *model.lattice, model.rest);
  else if (model.collision)
    binding = fewerCarriers(binding, model.rest, model.spacing);
  const TriangleMesh& mesh = model.collision ? model.collision->mesh : model.surface;
  VertexSupports supports;
  supports.offsets = std::move(binding.offsets);
  supports.particles = std::move(binding.carriers);
  supports.weights = std::move(binding.weights);
  return {mesh, std::move(supports)};
}

// [m] how far vertices may be beyond the bounds of the particles that they follow. Two spacings, or less for crumbs,
// whose whole surface is nearer to their few particles. Otherwise, where many crumbs lie together, each would be next
// to all.
double embeddedReachOf(const BodyModel& model) {
  const SurfaceBinding& binding = model.binding;
  double farthest = 0.0;  // squared, of a vertex from its nearest carrier
  for (Index v = 0; v < binding.size(); ++v) {
    double nearest = std::numeric_limits<double>::infinity();
    for (Index k = binding.offsets[v]; k < binding.offsets[v + 1]; ++k)
      nearest = std::min(nearest, (model.surface.vertices[v] - model.rest[binding.carriers[k]]).squaredNorm());
    farthest = std::max(farthest, nearest);
  }
  return 2.0 * std::min(std::sqrt(farthest), model.spacing);
}

// Thinner than the samples of its cells: both of its sides hang on the same particles, which cannot part them.
bool isFilm(const BodyModel& model) {
  return model.lattice && 2.0 * model.rest_volume * kCellSamples < model.rest_area * model.spacing;
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

WorldObstacle::WorldObstacle(ObstacleDef of_def)
    : def(std::make_shared<ObstacleDef>(std::move(of_def))),
      inverse_masses(def->mesh.vertices.size(), 0.0),
      surface(def->mesh, ownSupports(static_cast<Index>(def->mesh.vertices.size()))),
      solid(def->mesh) {
  for (const Vec3& p : def->mesh.vertices) bounds.extend(p);
  thickness = 2.0 * std::abs(signedVolume(def->mesh)) / surfaceArea(def->mesh);
}

SurfaceModel::SurfaceModel(BodyModelPtr of_model)
    : model(std::move(of_model)), surface(surfaceOf(*model)), stiffness(stiffnessOfParticles(*model)) {
  for (std::size_t i = 0; i < model->masses.size(); ++i)
    inverse_masses.push_back(model->fixed[i] ? 0.0 : 1.0 / model->masses[i]);
}

std::size_t SurfaceModel::bytes() const {
  return sizeof *this + surface.bytes() + bytesOf(inverse_masses, stiffness);
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

// [Pa] E / (1 - nu^2) of what is held for long: pressure does not relax.
static double planeModulus(const Material& material) {
  double left = 1.0;
  for (const Relaxation& branch : material.relaxation) left -= branch.share;
  const double e = material.youngs_modulus, nu = material.poissons_ratio;
  const double shear = left * e / (2.0 * (1.0 + nu)), bulk = e / (3.0 * (1.0 - 2.0 * nu));
  return 4.0 * shear * (3.0 * bulk + shear) / (3.0 * bulk + 4.0 * shear);
}

void World::Impl::fillCollider(WorldBody& body, double h_frame, Collider& collider) {
  collider = Collider();
  collider.key = body.number;
  collider.moves = !body.asleep;
  collider.friction = body.material.friction;
  // What is stepped by its cells bounces by itself: pressed on a contact, a vertex closes faster than any limit on what
  // is an impact, and would be thrown back for ever.
  collider.restitution = body.model->elastic_batch ? 0.0 : body.material.restitution;
  if (body.model->elastic_batch) collider.modulus = planeModulus(body.material);
  collider.edge_length = body.edge_length;
  collider.spacing = body.model->spacing;
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
  if (!body.material.bends() || body.model->clusters.size() == 1 || wanted == SelfContact::kNone) return;
  if (isFilm(*body.model)) return;
  if (wanted == SelfContact::kAll) collider.self = PairSearch::Self::kAll;
  if (wanted == SelfContact::kWoundFaces && body.model->incised) collider.self = PairSearch::Self::kCuts;
}

// Once a model; a body's key figures are needed before anybody is near.
void World::Impl::measureSurface(WorldBody& body) {
  if (body.measured == body.model) return;
  body.measured = body.model;
  body.surface_reach = contactReachOf(*body.model);
  const TriangleMesh& surface = body.model->collision ? body.model->collision->mesh : body.model->surface;
  body.edge_length = surface.triangles.empty() ? body.model->spacing : meanEdgeLength(surface);
  // A surface bends no more finely than its particles.
  body.edge_length = std::max(body.edge_length, body.model->spacing);
}

void World::Impl::findNear(double h, int parts_left) {
  SurfaceScene& scene = surface_scene;
  scene = SurfaceScene();
  scene.ground = settings.ground;
  scene.ground_friction = settings.ground_friction;
  scene.gravity = settings.gravity.norm();
  scene.h = h;
  if (push.enabled) scene.sphere = SurfaceScene::Sphere{push.position, pushWay(h), push.radius};
  colliders.resize(bodies.size() + obstacles.size() + instruments.size());
  forNumbers(bodies.size(), [&](std::size_t b) {
    measureSurface(*bodies[b]);
    fillCollider(*bodies[b], h, colliders[b]);
  });
  for (std::size_t o = 0; o < obstacles.size(); ++o) colliders[bodies.size() + o] = colliderOf(*obstacles[o], o);
  for (std::size_t n = 0; n < instruments.size(); ++n)
    fillInstrumentCollider(n, h, parts_left * h, colliders[bodies.size() + obstacles.size() + n]);
  for (const Pick& pick : picks)
    for (std::size_t b = 0; b < bodies.size(); ++b)
      if (bodies[b]->id == pick.body) colliders[b].grasped = true;
  for (const AttachedFibre& fibre : attached.all) {
    if (bodies[fibre.a]->asleep) continue;
    for (const Index b : {fibre.a, fibre.b})
      if (b != kNoIndex) colliders[b].grasped = true;
    if (scene.joins.empty() || scene.joins.back().a != fibre.a || scene.joins.back().b != fibre.b)
      scene.joins.push_back({fibre.a, fibre.b});
  }
  scene.surfaces = settings.contact == ContactMethod::kSurface;
  if (settings.contact == ContactMethod::kTextbook) findTextbook(h);
  surface_contacts.findPairs(scene, colliders, report.contact_counters);
}

void World::Impl::findTextbook(double h) {
  std::vector<Box> boxes;
  std::vector<char> active;
  for (const auto& body : bodies) {
    boxes.push_back(extentOf(body->state.positions));
    for (std::size_t i = 0; i < body->state.positions.size(); ++i)
      boxes.back().extend(body->state.positions[i] + h * body->state.velocities[i]);
    active.push_back(!body->asleep);
  }
  BroadPhase near;
  std::vector<ContactBody> views(bodies.size());
  for (const auto& [a, b] : near.find(boxes, active))
    for (const Index n : {a, b}) {
      needContactMesh(*bodies[n]);
      views[n].mesh = bodies[n]->mesh.get();
      views[n].positions = &bodies[n]->state.positions;
      views[n].bounds = extentOf(bodies[n]->state.positions);
    }
  for (const Penetration& penetration : findPenetrations(views, report.contact_counters)) {
    std::vector<SurfaceScene::Given>& given = surface_scene.given;
    const auto pair = std::find_if(given.begin(), given.end(), [&](const SurfaceScene::Given& g) {
      return g.a == penetration.body_a && g.b == penetration.body_b;
    });
    SurfaceScene::Given& of = pair != given.end() ? *pair : given.emplace_back();
    of.a = penetration.body_a;
    of.b = penetration.body_b;
    const double friction = bodies[of.a]->material.friction * bodies[of.b]->material.friction;
    addRow(penetration, views, std::sqrt(friction), of.set);
  }
}

/// A search finds what meets on straight ways. Between two of them nobody who may meet something, as findNear() says,
/// goes farther than that, so that who is thrown off its way is found by the next before it has passed what is thin.
int World::Impl::searchesOf(double h_frame) {
  const auto edges = [h_frame](const WorldBody& body, double fastest) { return h_frame * fastest / body.edge_length; };
  const std::vector<char>& needed = surface_contacts.needed();
  std::vector<double> led(instruments.size(), 0.0);  // [m] the farthest that a point of each goes, where it is near
  bool slow = std::none_of(awake.begin(), awake.end(), [&](WorldBody* b) { return edges(*b, b->fastest) > kNearest; });
  for (std::size_t n = 0; n < instruments.size(); ++n) {
    if (instrument_bodies[n]->still || needed[bodies.size() + obstacles.size() + n] != SurfaceContacts::kNear) continue;
    for (const Vec3& v : instrument_bodies[n]->velocities) led[n] = std::max(led[n], h_frame * v.norm());
    slow = slow && !(led[n] > kNearest * instrument_bodies[n]->surface.edge_length);
  }
  if (slow) return 1;
  double thinnest = std::numeric_limits<double>::infinity();  // [m]
  for (std::size_t c = 0; c < needed.size(); ++c) {
    if (needed[c] != SurfaceContacts::kNear) continue;
    if (c >= bodies.size() + obstacles.size())
      thinnest = std::min(thinnest, instrument_bodies[c - bodies.size() - obstacles.size()]->shape->thickness);
    else if (c >= bodies.size())
      thinnest = std::min(thinnest, obstacles[c - bodies.size()]->thickness);
    else if (const BodyModel& model = *bodies[c]->model; model.solid)
      thinnest = std::min(thinnest, 2.0 * model.rest_volume / model.rest_area);
    else
      thinnest = 0.0;
  }
  double most = 1.0;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    WorldBody& body = *bodies[b];
    if (needed[b] != SurfaceContacts::kNear || body.asleep) continue;
    const VertexSupports& supports = surfaceModel(body).surface.supports;
    double fastest = 0.0;
    for (Index v = 0; v + 1 < supports.offsets.size(); ++v)
      fastest = std::max(fastest, supports.sum(v, body.state.velocities.data()).squaredNorm());
    const double farthest = std::clamp(0.5 * thinnest / body.edge_length, kNearest, kFarthest);
    most = std::max(most, edges(body, std::sqrt(fastest)) / farthest);
  }
  for (std::size_t n = 0; n < instruments.size(); ++n) {
    const double edge = instrument_bodies[n]->surface.edge_length;
    most = std::max(most, led[n] / edge / std::clamp(0.5 * thinnest / edge, kNearest, kFarthest));
  }
  return static_cast<int>(std::min(std::ceil(most), kMostSearches));
}

// Rows of those that are near. A body that is reached wakes, and then all is found again with its neighbours.
void World::Impl::findSurfaceContacts(double h, int parts_left) {
  SurfaceScene& scene = surface_scene;
  for (;;) {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      if (!surface_contacts.needed()[b]) continue;
      const SurfaceModel& model = surfaceModel(*bodies[b]);
      colliders[b].surface = &model.surface;
      colliders[b].inverse_masses = model.inverse_masses.data();
      colliders[b].stiffness = model.stiffness.empty() ? nullptr : model.stiffness.data();
    }
    surface_contacts.findMoved(scene, colliders);
    forNumbers(bodies.size(), [&](std::size_t b) {
      if (!surface_contacts.moved()[b]) return;
      if (bodies[b]->model->surface.vertices.empty() || bodies[b]->model->collision) return;
      refreshSurface(*bodies[b]);
      colliders[b].vertices = bodies[b]->state.surface.data();
    });
    surface_contacts.find(scene, colliders, report.contact_counters, for_each);
    bool woken = false;
    for (const Index c : surface_contacts.reached()) {
      woken = woken || bodies[c]->asleep;
      wake(*bodies[c]);
    }
    woken = wakeInHands() || woken;
    if (!woken) return;
    listAwake();
    findNear(h, parts_left);
  }
}

Vec3 World::Impl::pushWay(double h_frame) const {
  const Vec3 way = push.target - push.position;
  const double length = way.norm(), most = push.speed * h_frame;
  return length > most ? Vec3(way * (most / length)) : way;
}

/// In substeps a step, as for a scene: how many parts a frame has is nothing that a user knows.
void World::Impl::saySlowed(const WorldBody& body, int given, bool by_most, double factor) {
  const double h_frame = 1.0 / settings.step_rate;
  const double at_rest = substepsNeeded(*body.model, BodyState(), h_frame);
  const double needed = substepsNeeded(*body.model, body.state, h_frame);
  std::ostringstream text;
  text << body.name << " needs " << needed << " substeps a step for its material";
  if (needed > at_rest) text << " as it is stretched now (" << at_rest << " at rest)";
  text << "; with " << given;
  if (by_most) {
    text << " (max_substeps is " << settings.max_substeps << ")";
  } else {
    text << " (it is a sliver: at most " << 100.0 * kSlowedMass
         << " % of the mass of all that it touches or is joined to, which needs no more)";
  }
  text << " it deforms " << 1.0 / std::sqrt(factor) << " times as slowly, to where it would";
  say(EventType::kOverBudget, body.name, 0, text.str());
}

/// Substeps of one of so many parts of a frame that the stiffest bodies of an island and its contacts need. Slivers are
/// not asked, but where they are picked. That a body is slowed is said when it begins, at most once a second.
int World::Impl::substepsOf(const std::vector<WorldBody*>& some, bool may_meet, double h_frame, int parts) {
  double needed = may_meet ? std::max(settings.substeps, kContactSubsteps) : settings.substeps;
  needed = std::ceil(needed / parts);
  stiffest.clear();
  double mass = 0.0;
  for (std::size_t n = 0; n < some.size(); ++n) {
    const WorldBody& body = *some[n];
    const double substeps = substepsNeeded(*body.model, body.state, h_frame);
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
  const int most = (std::max(settings.substeps, settings.max_substeps) + parts - 1) / parts;
  const int substeps = needed < most ? static_cast<int>(needed) : most;  // NaN: most
  for (WorldBody* body : some) {
    const double factor = stiffnessFactor(*body->model, body->state, h_frame / substeps);
    if (factor < 1.0) {
      const bool anew = !body->slowed_at || static_cast<double>(step - *body->slowed_at) > settings.step_rate;
      if (anew && !(body->stiffness_factor < 1.0)) saySlowed(*body, substeps * parts, substeps == most, factor);
      body->slowed_at = step;
    }
    body->stiffness_factor = factor;
  }
  return substeps;
}

// As what deforms answers its own stiffness (see matchAndMove): a body that is slowed, or one with a single goal, whose
// particle under a contact has little mass of its own.
double World::Impl::yieldsOf(const WorldBody& body) {
  const bool drawn = !body.material.elastic() && body.model->clusters.size() == 1;
  return drawn ? 1.0 - body.state.stiffened * body.material.alpha : 1.0;
}

void World::Impl::shareAnswers(Index number) {
  const SurfaceContacts::Island& island = surface_contacts.islands()[number];
  for (const Index b : island.bodies) {
    if (!surface_contacts.needed()[b]) continue;
    const double yields = yieldsOf(*bodies[b]);
    // Attached by stiff fibres, a light body that answers as a whole by more than that gains energy.
    const double soft = island.joined ? yields : yields * yields;
    surface_contacts.setRigidShare(b, 1.0 - bodies[b]->scratch.factor * soft);
  }
}

// Islands know nothing of each other within a frame: each takes the substeps that it needs, small ones of the same
// several at a time. Where one has most of the particles its bodies are shared out over threads, else the islands are.
void World::Impl::stepSurfaces(double h_frame, int parts, int parts_left) {
  const auto& islands = surface_contacts.islands();
  work_count = 0;
  std::vector<WorldBody*>& some = members;
  for (Index n = 0; n < islands.size(); ++n) {
    some.clear();
    for (const Index b : islands[n].bodies) some.push_back(bodies[b].get());
    const int substeps = substepsOf(some, !islands[n].rows.empty() || islands[n].joined, h_frame, parts);
    addWork(n, substeps);
    report.substeps = std::max(report.substeps, static_cast<std::size_t>(substeps * parts));
  }
  std::size_t largest = 0, total = 0;
  for (std::size_t n = 0; n < work_count; ++n) {
    const SurfaceWork& work = surface_work[n];
    total += work.particles;
    largest = std::max(largest, work.particles);
  }
  if (2 * largest > total) {
    for (std::size_t n = 0; n < work_count; ++n) stepWork(surface_work[n], h_frame, parts, parts_left, for_each);
  } else {
    runEach(for_each, work_count,
            [&](std::size_t n) { stepWork(surface_work[n], h_frame, parts, parts_left, oneAfterAnother); });
  }
  for (std::size_t n = 0; n < work_count; ++n) {
    const SurfaceWork& work = surface_work[n];
    report.match_counters += work.match_counters;
    report.preserve_counters += work.preserve_counters;
    report.contact_counters.corrected += work.solver_counters.active;
    report.ground_contacts += work.solver_counters.ground;
    report.fibres += work.solver_counters.fibres;
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

void World::Impl::addWork(Index island, int substeps) {
  SurfaceWork* work = nullptr;
  for (std::size_t n = work_count; n-- > 0 && !work;)
    if (surface_work[n].substeps == substeps && surface_work[n].particles < kWorkParticles) work = &surface_work[n];
  if (!work) {
    if (work_count == surface_work.size()) surface_work.emplace_back();
    work = &surface_work[work_count++];
    work->member_count = 0;
    work->bodies.clear();
    work->alone.clear();
    work->side_by_side.resize(batches.size());
    for (std::vector<WorldBody*>& some : work->side_by_side) some.clear();
    work->lanes.resize(batches.size());
    work->particles = 0;
    work->substeps = substeps;
  }
  if (work->member_count == work->members.size()) work->members.emplace_back();
  SurfaceWork::Member& member = work->members[work->member_count++];
  member.island = island;
  member.begin = work->bodies.size();
  member.picks.clear();
  member.springs.clear();
  member.fibres.clear();
  member.fibre_rows.clear();
  const std::vector<Index>& of_island = surface_contacts.islands()[island].bodies;
  for (const Index b : of_island) {
    work->bodies.push_back(bodies[b].get());
    work->particles += bodies[b]->state.positions.size();
  }
  member.end = work->bodies.size();
  for (Pick& pick : picks)
    for (const Index b : of_island) {
      if (bodies[b]->id != pick.body) continue;
      member.picks.push_back(&pick);
      SpringRow spring;
      spring.body = b;
      spring.patch = &pick.patch;
      spring.weights = &pick.weights;
      spring.stiffness = pick.stiffness;
      member.springs.push_back(spring);
    }
  if (attached.all.empty()) return;
  for (const Index b : of_island)
    for (Index k = attached.offsets[b]; k < attached.offsets[b + 1]; ++k) {
      const AttachedFibre& fibre = attached.all[attached.of_body[k]];
      member.fibres.push_back(fibre.fibre);
      FibreRow row;
      row.a = fibre.a;
      row.b = fibre.b;
      row.at_a = &fibre.fibre->at_a;
      row.at_b = &fibre.fibre->at_b;
      row.place = fibre.fibre->place;
      row.rest = fibre.fibre->rest;
      row.stiffness = fibre.stiffness;
      row.impulse = fibre.fibre->force;
      member.fibre_rows.push_back(row);
    }
}

void World::Impl::keepSizes(SurfaceWork& work) {
  const auto keeps = [](const WorldBody& body) {
    return !body.material.volume.points.empty() || !body.material.area.points.empty() || body.state.swelling != 1.0;
  };
  for (WorldBody* body : work.bodies) {
    body->surface_current = false;
    body->scratch.touched.clear();
  }
  if (std::none_of(work.bodies.begin(), work.bodies.end(), [&](const WorldBody* body) { return keeps(*body); })) return;
  for (std::size_t n = 0; n < work.member_count; ++n)
    surface_contacts.eachPressed(work.members[n].island,
                                 [&](Index b, const RowEntry& entry, const ContactRow&, const Vec3& normal) {
                                   if (b < bodies.size() && !bodies[b]->asleep && keeps(*bodies[b]))
                                     bodies[b]->scratch.touched.push_back({entry.particle, normal});
                                 });
  for (WorldBody* body : work.bodies)
    if (keeps(*body)) preserve(*body->model, body->material, body->state, body->scratch, work.preserve_counters);
}

// The push sphere is left out: on who rolls over it, it would not feel what that costs.
void World::Impl::findLoads(const SurfaceWork& work) {
  for (std::size_t n = 0; n < work.member_count; ++n) {
    if (!surface_contacts.islands()[work.members[n].island].held) continue;
    surface_contacts.eachPressed(
        work.members[n].island, [&](Index b, const RowEntry& entry, const ContactRow& row, const Vec3&) {
          if (row.kind == FeaturePair::Kind::kSphere || b >= bodies.size() || bodies[b]->asleep) return;
          const double share = row.normal.dot(row.impulse) * std::abs(entry.coefficient);
          bodies[b]->scratch.load += share;
          bodies[b]->scratch.load_at += share * bodies[b]->state.positions[entry.particle];
        });
  }
  for (WorldBody* body : work.bodies)
    if (body->scratch.load > 0.0) body->scratch.load_at /= body->scratch.load;
}

void World::Impl::stepWork(SurfaceWork& work, double h_frame, int parts, int parts_left, const ForEach& each) {
  const int substeps = work.substeps;
  const double h = h_frame / substeps;
  work.match_counters = MatchCounters();
  work.preserve_counters = PreserveCounters();
  work.solver_counters = SolverCounters();
  work.match = work.contact = 0.0;
  work.push_force.setZero();
  work.touched = false;
  for (std::size_t n = 0; n < work.member_count; ++n) {
    SurfaceWork::Member& member = work.members[n];
    member.previous.resize(member.end - member.begin);
    for (std::size_t b = member.begin; b < member.end; ++b) {
      WorldBody& body = *work.bodies[b];
      body.state.substep = h;
      body.scratch.factor = 1.0;
      body.scratch.load = 0.0;
      body.scratch.load_at.setZero();
      if (body.batch != kNoIndex && fitsFloat(body, h))
        work.side_by_side[body.batch].push_back(&body);
      else
        work.alone.push_back(&body);
    }
  }
  findLoads(work);
  work.each_counters.resize(work.alone.size());
  for (std::size_t n = 0; n < batches.size(); ++n)
    if (!work.side_by_side[n].empty()) work.lanes[n] = borrowLanes(batches[n]);
  const Vec3 way = push.enabled ? pushWay(h_frame) : Vec3(Vec3::Zero());
  SolverStep step;
  step.h = h;
  step.frame = h_frame;
  step.sphere_radius = push.radius;
  auto last = std::chrono::steady_clock::now();
  // A large body is shared out among all threads, the others go to them one by one.
  const auto eachBody = [&each](const std::vector<WorldBody*>& some, const auto& stage) {
    const auto isLarge = [&](std::size_t b) { return some[b]->state.positions.size() >= kSharedParticles; };
    for (std::size_t b = 0; b < some.size(); ++b)
      if (isLarge(b)) stage(b, each);
    runEach(each, some.size(), [&](std::size_t b) {
      if (!isLarge(b)) stage(b, oneAfterAnother);
    });
  };
  for (int substep = 0; substep < substeps; ++substep) {
    for (std::size_t n = 0; n < batches.size(); ++n) {
      if (!work.lanes[n]) continue;
      BatchStep batch_step = batchStep(batches[n].bodies.front()->material, h);
      batch_step.gravity = settings.gravity;
      work.lanes[n]->step(work.side_by_side[n], batch_step, work.match_counters);
    }
    eachBody(work.alone, [&](std::size_t b, const ForEach& within) {
      work.each_counters[b] = MatchCounters();
      work.alone[b]->scratch.last = substep + 1 == substeps;
      matchAlone(*work.alone[b], h, work.each_counters[b], within);
    });
    for (const MatchCounters& counters : work.each_counters) work.match_counters += counters;
    applyForces(work.bodies, h);
    work.match += secondsSince(last);
    step.sphere_from = push.position + substep * way / substeps;
    step.sphere_to = push.position + (substep + 1) * way / substeps;
    for (std::size_t n = 0; n < work.member_count; ++n) {
      SurfaceWork::Member& member = work.members[n];
      shareAnswers(member.island);
      // What gravity and forces give within a frame is no approach.
      const double given = surface_scene.gravity + forcedAcceleration(work.bodies, member.begin, member.end);
      step.slow = 2.0 * given * h_frame;
      for (std::size_t b = member.begin; b < member.end; ++b)
        member.previous[b - member.begin] = work.bodies[b]->scratch.previous.data();
      for (std::size_t p = 0; p < member.picks.size(); ++p) {
        const Pick& pick = *member.picks[p];
        const Vec3 there = (pick.target - pick.reached) / parts_left;
        member.springs[p].end = pick.reached + (substep + 1) * there / substeps;
        member.springs[p].impulse.setZero();
      }
      const std::vector<Index>& led = surface_contacts.islands()[member.island].led;
      for (const Index c : led) {
        advanceInstrument(c, h, parts_left * substeps - substep);
        const InstrumentBody& instrument = *instrument_bodies[c - bodies.size() - obstacles.size()];
        surface_contacts.lead(c, instrument.before, instrument.positions);
      }
      surface_contacts.solveIsland(member.island, step, substep, colliders, member.previous, member.springs,
                                   member.fibre_rows, work.solver_scratch, work.solver_counters, each);
      for (const Index c : led) feelInstrument(member.island, c, h, 1.0 / (substeps * parts));
      for (std::size_t f = 0; f < member.fibres.size(); ++f)
        member.fibres[f]->tension += member.fibre_rows[f].impulse.norm() / (h * h * substeps * parts);
      for (std::size_t p = 0; p < member.picks.size(); ++p)
        member.picks[p]->force += member.springs[p].impulse / (h * h * substeps * parts);
      if (push.enabled) {
        const Vec3 impulse = surface_contacts.sphereImpulse(member.island);
        work.push_force += impulse / (h * h * substeps * parts);
        work.touched = work.touched || !impulse.isZero(0.0);
      }
    }
    work.contact += secondsSince(last);
    keepSizes(work);
    eachBody(work.bodies, [&](std::size_t b, const ForEach& within) {
      velocitiesFromPositions(h, work.bodies[b]->state, work.bodies[b]->scratch, within);
    });
    work.match += secondsSince(last);
  }
  for (std::size_t n = 0; n < work.member_count; ++n) {
    SurfaceWork::Member& member = work.members[n];
    surface_contacts.finishIsland(member.island, h);
    for (std::size_t f = 0; f < member.fibres.size(); ++f)
      member.fibres[f]->force = member.fibre_rows[f].impulse / (h * h);
  }
  for (std::size_t n = 0; n < batches.size(); ++n)
    if (work.lanes[n]) giveBackLanes(batches[n], std::move(work.lanes[n]));
}

}  // namespace meshless
