// The only place where time moves.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>

#include "meshless_surgery/body/embedded_contact.h"
#include "meshless_surgery/body/face_contact.h"
#include "meshless_surgery/body/preserve.h"
#include "meshless_surgery/body/unwind.h"
#include "meshless_surgery/contact/sphere_and_ground.h"
#include "meshless_surgery/tools/grasp.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kEmbeddedFade = 0.25;       // [s] in which offsets of embedded vertices fall to 1/e
constexpr double kOffsetGone = 1e-7;         // of the spacing: then it is dropped
constexpr double kDepenetrationSpeed = 0.5;  // [m/s] at which bodies are depenetrated at the least
constexpr double kPushHopRadii = 0.25;       // longest way of the sphere before the tissue is moved out of it
constexpr int kContactPasses = 2;

class Stopwatch {
 public:
  explicit Stopwatch(double& seconds) : seconds_(seconds), start_(std::chrono::steady_clock::now()) {}
  ~Stopwatch() { seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  double& seconds_;
  std::chrono::steady_clock::time_point start_;
};

Box sweptBounds(const WorldBody& body, double h) {
  Box box;
  for (std::size_t i = 0; i < body.state.positions.size(); ++i) {
    box.extend(body.state.positions[i]);
    box.extend(body.state.positions[i] + h * body.state.velocities[i]);
  }
  return box;
}

}  // namespace

void World::step() {
  impl_->takeStep();
  // So that a replay never goes far without a record (command_log.cpp).
  const auto second = static_cast<std::uint64_t>(std::ceil(impl_->settings.step_rate));
  if (impl_->step % second == 0) recordHash();
}

void World::Impl::takeStep() {
  Impl& w = *this;
  w.report = StepReport();
  {
    const Stopwatch total(w.report.total);
    const double h_frame = 1.0 / w.settings.step_rate;
    w.closeBlades();
    w.any_elastic = std::any_of(w.bodies.begin(), w.bodies.end(), [](const auto& b) { return b->material.elastic(); });
    w.wakePushed(h_frame);
    w.listAwake();
    const bool rest_shape = w.contactMethod() == ContactMethod::kRestShape && !w.awake.empty();
    if (rest_shape) {
      const Stopwatch contact(w.report.contact);
      w.rememberGrasps();
      w.findContacts(h_frame);
    }
    if (w.contactMethod() == ContactMethod::kSurface) {
      w.stepWithSurfaces(h_frame);
      return;
    }
    w.groupBatches();
    const int substeps = w.chooseSubsteps(h_frame);
    const double h = h_frame / substeps;
    bool in_island_batches = false;
    if (rest_shape) {
      const Stopwatch contact(w.report.contact);
      w.contacts.begin(w.shape_colliders, h);
      in_island_batches = w.formIslandBatches(h);
      if (!in_island_batches) w.contacts.depenetrate(w.shape_colliders, w.report.contact_counters, w.for_each);
      w.followGrasps();
    }
    w.clearForces();
    for (WorldBody* body : w.awake) body->low_current = false;
    if (in_island_batches)
      w.stepInIslandBatches(substeps, h);
    else
      w.stepTogether(substeps, h_frame);
    for (Pick& pick : w.picks) pick.reached = pick.target;
    w.rememberGrasps();
    for (WorldBody* body : w.awake) {
      w.fadeEmbeddedOffsets(*body, h_frame);
      if (rest_shape) w.liftOutOfGround(*body, h_frame);  // after: it lifts by offsets too
    }
    w.followGrasps();
    if (rest_shape) w.last_substep = h;
    w.report.substeps = static_cast<std::size_t>(substeps);
    w.finishStep(h_frame);
  }
}

void World::Impl::stepWithSurfaces(double h_frame) {
  clearForces();
  report.substeps = static_cast<std::size_t>(settings.substeps);  // at the least
  if (!awake.empty()) {
    {
      const Stopwatch contact(report.contact);
      findSurfaceContacts(h_frame);
    }
    stepSurfaces(h_frame);
  }
  if (push.enabled) push.position += pushWay(h_frame);
  for (Pick& pick : picks) pick.reached = pick.target;
  finishStep(h_frame);
}

void World::Impl::clearForces() {
  for (Pick& pick : picks)
    if (const WorldBody* body = find(pick.body); !body || !body->asleep)  // a body at rest is held as before
      pick.force.setZero();
  bool pressed = false, moved = false;  // what sleeps under the sphere is pressed as before
  for (const auto& body : bodies) {
    if (!body->touched_by_push) continue;
    pressed = true;
    moved = moved || !body->asleep;
  }
  if (pressed && !moved) return;
  push.force.setZero();
  push.touching = false;
}

void World::Impl::finishStep(double h_frame) {
  mendFaults();
  findWound();
  for (Pick& pick : picks)
    if (const WorldBody* body = find(pick.body)) pick.position = graspMean(pick, body->state.positions) + pick.offset;
  fallAsleep(h_frame);
  contacts_current = !awake.empty() || contacts_current;
  ++step;
  report.bodies = bodies.size();
  for (const auto& body : bodies) report.asleep += body->asleep;
  report.tetrahedralizations = tetrahedralizations;
}

// All bodies take each substep before any takes the next.
void World::Impl::stepTogether(int substeps, double h_frame) {
  const double h = h_frame / substeps;
  const bool rest_shape = contactMethod() == ContactMethod::kRestShape && !awake.empty();
  // What an elastic material needs beyond the scene's substeps is not needed by contacts between bodies.
  const int stride = std::max(1, substeps / settings.substeps);
  const std::vector<WorldBody*> near = bodiesInContact(h_frame);
  for (int substep = 0; substep < substeps; ++substep) {
    {
      const Stopwatch match(report.match);
      matchBatches(h);
      for (WorldBody* body : awake)
        if (body->batch == kNoIndex) matchAlone(*body, h, report.match_counters);
    }
    {
      const Stopwatch tools(report.tools);
      pullSprings(substep, substeps, h_frame);
    }
    {
      const Stopwatch contact(report.contact);
      for (WorldBody* body : awake) {
        body->scratch.touched.clear();
        if (push.enabled || (settings.ground && (!rest_shape || body->model->surface.vertices.empty())))
          body->scratch.before_contact = body->state.positions;
      }
      if (rest_shape)
        solveContacts(h);
      else if ((substep + 1) % stride == 0 || substep + 1 == substeps)
        contactBodies(near, h, stride);
      movePush(h, h_frame);
    }
    pullSprings(substep, substeps, h_frame, true);
    finishSubstep(h);
  }
}

void World::Impl::matchAlone(WorldBody& body, double h, MatchCounters& counters) const {
  if (body.state.unwinding)
    unwind(*body.model, settings.gravity, h, body.state, body.scratch);
  else
    matchAndMove(*body.model, body.material, settings.gravity, h, body.state, body.scratch, counters);
}

void World::Impl::keepSize(WorldBody& body, PreserveCounters& counters) const {
  if (!body.material.volume.points.empty() || !body.material.area.points.empty() || body.state.swelling != 1.0)
    preserve(*body.model, body.material, body.state, body.scratch, counters);
  body.surface_current = false;
}

void World::Impl::finishSubstep(double h) {
  for (WorldBody* body : awake) keepSize(*body, report.preserve_counters);
  forNumbers(awake.size(),
             [&](std::size_t b) { velocitiesFromPositions(*awake[b]->model, h, awake[b]->state, awake[b]->scratch); });
  // Being pushed out does not throw: the tool does not report the force that the tissue does not get.
  if (push.touching)
    for (const WorldBody* body : awake) push.force += body->scratch.unreported * settings.step_rate;
}

// As many as the stiffest body needs, within the budget and what contacts of a heap leave; what these take from a body
// is said once.
int World::Impl::substepsNeeded(double h_frame) const {
  double needed = 1.0;
  for (const auto& body : bodies)  // not `awake`: a cut asks between steps
    if (!body->asleep) needed = std::max(needed, std::ceil(h_frame * highestFrequencyNow(*body->model, body->state)));
  if (contactMethod() == ContactMethod::kRestShape && !awake.empty()) {
    const double most = contacts.affordableSubsteps();
    if (!(needed < most)) needed = most;
    needed = std::max(needed, static_cast<double>(contacts.neededSubsteps()));
  }
  if (needed < settings.substeps) needed = settings.substeps;
  const int most = std::max(settings.substeps, settings.max_substeps);
  return needed < most ? static_cast<int>(needed) : most;  // NaN: most
}

double World::Impl::substepNow() const { return 1.0 / settings.step_rate / substepsNeeded(1.0 / settings.step_rate); }

int World::Impl::chooseSubsteps(double h_frame) {
  const int substeps = substepsNeeded(h_frame);
  for (WorldBody* body : awake) {
    const double factor = stiffnessFactor(*body->model, body->state, h_frame / substeps);
    if (factor < 1.0 && !(body->stiffness_factor < 1.0)) {
      std::ostringstream text;
      text << body->name << " needs " << std::ceil(h_frame * highestFrequencyNow(*body->model, body->state))
           << " substeps for its material; with " << substeps
           << (substeps < settings.max_substeps ? " (the contacts of a heap leave no more)" : " (max_substeps)")
           << " it deforms " << 1.0 / std::sqrt(factor) << " times as slowly, and contacts and picks deform it "
           << 1.0 / factor << " times as much";
      say(EventType::kOverBudget, body->name, 0, text.str());
    }
    body->stiffness_factor = factor;
  }
  return substeps;
}

std::vector<WorldBody*> World::Impl::bodiesInContact(double h) {
  std::vector<WorldBody*> near;
  if (contactMethod() != ContactMethod::kTextbook || bodies.size() < 2) return near;
  const Stopwatch contact(report.contact);
  // Sweep along x: sorted by their lower ends, a pair can overlap only until the next one begins beyond.
  struct Entry {
    Box box;
    WorldBody* body;
    bool near;
  };
  std::vector<Entry> order;
  for (auto& body : bodies) order.push_back({sweptBounds(*body, h), body.get(), false});
  std::stable_sort(order.begin(), order.end(),
                   [](const Entry& a, const Entry& b) { return a.box.min.x() < b.box.min.x(); });
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1; j < order.size() && order[j].box.min.x() <= order[i].box.max.x(); ++j)
      if (order[i].box.overlaps(order[j].box)) order[i].near = order[j].near = true;
  std::set<const WorldBody*> chosen;
  for (const Entry& e : order)
    if (e.near) chosen.insert(e.body);
  for (auto& body : bodies)
    if (chosen.count(body.get())) {
      needContactMesh(*body);
      near.push_back(body.get());
    }
  return near;
}

namespace {

// Contacts move some tissue without a velocity, as in depenetration. A spring would answer that with a velocity,
// substep after substep. `impulse` [kg m]: what the grasp has given after the contacts; `motion` [m]: of its mean in
// this substep before that. Only so much of the impulse becomes velocity as adds no kinetic energy.
void keepStill(const BodyModel& model, const Pick& pick, const Vec3& motion, const Vec3& impulse,
               StepScratch& scratch) {
  const double most = impulse.squaredNorm() * graspInverseMass(model, pick);
  if (!(most > 0.0)) return;
  const double share = std::clamp(-2.0 * impulse.dot(motion) / most, 0.0, 1.0);
  const bool compared = scratch.before_contact.size() == scratch.previous.size();
  for (std::size_t k = 0; k < pick.patch.size(); ++k) {
    const Index i = pick.patch[k];
    if (model.fixed[i]) continue;
    const Vec3 moved = (1.0 - share) * pick.weights[k] / model.masses[i] * impulse;
    scratch.previous[i] += moved;
    if (compared) scratch.before_contact[i] += moved;
  }
}

}  // namespace

// A target that jumps is followed evenly over the step: within the first of many substeps it would throw the tissue.
// Again after contacts: what they have moved a stiff spring by they have no energy for, and the next substep would
// throw the tissue back with it.
void World::Impl::pullSprings(int substep, int substeps, double h_frame, bool again) {
  pulls.resize(picks.size(), Vec3::Zero());
  const double h = h_frame / substeps;
  for (std::size_t n = 0; n < picks.size(); ++n) {
    Pick& pick = picks[n];
    WorldBody* const body = find(pick.body);
    if (!body || body->asleep) continue;
    const int left = substeps - substep - 1;
    const Vec3 end = pick.target - left * (pick.target - pick.reached) / substeps;
    const Vec3 given = again ? pulls[n] : Vec3(Vec3::Zero());
    const Vec3 motion = again ? Vec3(graspMean(pick, body->state.positions) - graspMean(pick, body->scratch.previous))
                              : Vec3(Vec3::Zero());
    pulls[n] = pullGrasp(*body->model, pick, end, h, body->state.positions, given);
    pick.force += pulls[n] / substeps;
    if (again) keepStill(*body->model, pick, motion, h * h * pulls[n], body->scratch);
  }
}

bool World::Impl::isHeld(const WorldBody& body) const {
  return std::any_of(picks.begin(), picks.end(), [&](const Pick& pick) { return pick.body == body.id; });
}

void World::Impl::rememberGrasps() {
  grasped.resize(picks.size());
  for (std::size_t n = 0; n < picks.size(); ++n)
    if (const WorldBody* body = find(picks[n].body)) grasped[n] = graspMean(picks[n], body->state.positions);
}

// Springs follow tissue that is depenetrated or lifted off the ground evenly over the step. Otherwise a stiff pick
// would pull it back within the first of many substeps, and throw it.
void World::Impl::followGrasps() {
  for (std::size_t n = 0; n < picks.size(); ++n)
    if (const WorldBody* body = find(picks[n].body))
      picks[n].reached += graspMean(picks[n], body->state.positions) - grasped[n];
}

void World::Impl::contactBodies(const std::vector<WorldBody*>& near, double h, int stride) {
  if (near.size() < 2) return;
  std::vector<ContactBody> views;
  std::vector<std::vector<double>> inverse_masses(near.size());
  double fastest = 0.0;
  for (std::size_t b = 0; b < near.size(); ++b) {
    WorldBody& body = *near[b];
    for (std::size_t i = 0; i < body.model->masses.size(); ++i) {
      inverse_masses[b].push_back(body.model->fixed[i] ? 0.0 : 1.0 / body.model->masses[i]);
      fastest = std::max(fastest, body.state.velocities[i].norm());
    }
    ContactBody view;
    view.mesh = body.mesh.get();
    view.positions = &body.state.positions;
    view.previous = &body.scratch.previous;
    view.inverse_masses = &inverse_masses[b];
    view.friction = body.material.friction;
    for (const Vec3& p : body.state.positions) view.bounds.extend(p);
    views.push_back(view);
  }
  const std::vector<Penetration> found = findPenetrations(views, report.contact_counters);
  if (found.empty()) return;
  std::vector<Points> before;
  if (stride > 1)
    for (const WorldBody* body : near) before.push_back(body->state.positions);
  resolvePenetrations(found, views, stride * h * std::max(kDepenetrationSpeed, 2.0 * fastest), report.contact_counters);
  // The way of several substeps in one is not the speed of one.
  for (std::size_t b = 0; b < before.size(); ++b)
    for (std::size_t i = 0; i < before[b].size(); ++i)
      near[b]->scratch.previous[i] += (1.0 - 1.0 / stride) * (near[b]->state.positions[i] - before[b][i]);
}

// Whom the sphere meets on its way in this frame.
void World::Impl::wakePushed(double h_frame) {
  if (!push.enabled || push.position == push.target) return;
  Box way;
  way.extend(push.position);
  const Vec3 to = push.target - push.position;
  const double length = std::min(to.norm(), push.speed * h_frame);
  way.extend(push.position + length * to.normalized());
  way.min.array() -= push.radius;
  way.max.array() += push.radius;
  wakeWithin(way);
}

// The sphere goes its way in hops, so that a fast one does not jump over tissue.
void World::Impl::movePush(double h, double h_frame) {
  int hops = 1;
  Vec3 velocity = Vec3::Zero();
  if (push.enabled) {
    const Vec3 way = push.target - push.position;
    const double length = std::min(way.norm(), push.speed > 0.0 ? push.speed * h : 0.0);
    if (length > 0.0) {
      velocity = way.normalized() * (length / h);
      hops = static_cast<int>(std::min(1000.0, std::ceil(length / (kPushHopRadii * push.radius))));
    }
  }
  for (int hop = 0; hop < hops; ++hop) {
    if (push.enabled) push.position += velocity * (h / hops);
    for (WorldBody* body : awake) contactGroundAndPush(*body, h, h_frame, velocity);
  }
}

void World::Impl::contactGroundAndPush(WorldBody& body, double h, double h_frame, const Vec3& push_velocity) {
  const BodyModel& model = *body.model;
  BodyState& state = body.state;
  const bool solved = contactMethod() == ContactMethod::kRestShape && !model.surface.vertices.empty();
  if ((!settings.ground || solved) && !push.enabled) return;  // without a surface, particles are held above the ground
  Box bounds;
  for (const Vec3& p : state.positions) bounds.extend(p);
  if (!model.binding.embedded.empty()) {  // embedded vertices reach beyond the particles
    bounds.min.array() -= 2.0 * model.spacing;
    bounds.max.array() += 2.0 * model.spacing;
  }
  const bool near_ground = !solved && settings.ground && bounds.min.z() <= *settings.ground;
  const bool near_push = push.enabled && (bounds.min.array() <= push.position.array() + push.radius).all() &&
                         (bounds.max.array() >= push.position.array() - push.radius).all();
  if (!near_ground && !near_push) {
    if (body.touched_by_push) body.touched_by_push = false;
    return;
  }
  std::vector<TouchedParticle>& touched = body.scratch.touched;
  Vec3 push_impulse = Vec3::Zero();  // [kg m] mass times displacement
  bool hit_push = false;
  const Vec3 along = push_velocity.norm() > 0.0 ? Vec3(push_velocity.normalized()) : Vec3::UnitZ();

  // Out of a sphere, and where that would be below the ground, sideways along it. lowest: how high p has to stay over
  // it.
  const auto outOf = [&](const Vec3& p, double radius, double lowest) -> Vec3 {
    const Projection out = projectOutOfSphere(p, push.position, radius, along);
    if (!out.inside) return Vec3::Zero();
    Vec3 there = p + out.depth * out.normal;
    const double floor = settings.ground ? *settings.ground + lowest : 0.0;
    if (settings.ground && there.z() < floor) {
      const double rise = push.position.z() - floor;
      if (std::abs(rise) < radius) {
        Vec3 sideways(p.x() - push.position.x(), p.y() - push.position.y(), 0.0);
        if (!(sideways.norm() > 1e-12 * radius)) sideways = Vec3::UnitX();
        there = push.position + sideways.normalized() * std::sqrt(radius * radius - rise * rise) * (1.0 + 1e-12);
        there.z() = floor;
      }
    }
    return there - p;
  };
  // At once by no more than the body is large: what a spring keeps inside would be torn away from it.
  Box at_rest;
  if (near_push)
    for (const Vec3& p : model.rest) at_rest.extend(p);
  const double longest = near_push ? std::max(at_rest.diagonal(), model.spacing) : 0.0;
  const auto bounded = [longest](const Vec3& shift) -> Vec3 {
    const double length = shift.norm();
    return length > longest ? Vec3(longest / length * shift) : shift;
  };
  const auto outOfSphere = [&](const Vec3& p) -> Vec3 { return bounded(outOf(p, push.radius, 0.0)); };

  // Whom the sphere has swallowed it puts out as a whole and as fast as it was: each particle by a way of its own would
  // go to another side of a sphere that is much larger than the body, and tear it.
  const bool held = isHeld(body);
  bool inside = false;  // still: it goes on as a whole
  const Vec3 middle = 0.5 * (bounds.min + bounds.max);
  const double half = 0.5 * bounds.diagonal();
  if (near_push && !model.any_fixed && (middle - push.position).norm() + half < push.radius) {
    Vec3 shift = outOf(middle, push.radius + half, middle.z() - bounds.min.z());
    if (held) {
      shift = bounded(shift);
      inside = true;
    }
    for (Points* points : {&state.positions, &body.scratch.previous, &body.scratch.before_contact})
      for (Vec3& p : *points) p += shift;
    push.touching = hit_push = true;
    ++report.push_contacts;
  }

  // Who can reach the ground within this frame is found once. A push can send down others, and so can a spring.
  bool few = near_ground && !near_push && !held;
  if (few && !body.low_current) findLow(body, h_frame);
  if (few) {
    const auto below = [&](const Vec3& p) { return p.z() < *settings.ground; };
    const auto listed = std::count_if(body.low_particles.begin(), body.low_particles.end(),
                                      [&](Index i) { return below(state.positions[i]); });
    few = std::count_if(state.positions.begin(), state.positions.end(), below) == listed;
  }
  const Index count = static_cast<Index>(few ? body.low_particles.size() : model.rest.size());
  for (int pass = 0; pass < kContactPasses; ++pass) {
    if (near_ground) {
      const double friction = std::sqrt(settings.ground_friction * body.material.friction);
      for (Index n = 0; n < count; ++n) {
        const Index i = few ? body.low_particles[n] : n;
        if (model.fixed[i]) continue;
        const Projection out = projectOutOfGround(state.positions[i], *settings.ground);
        if (!out.inside) continue;
        state.positions[i] += out.depth * out.normal;
        state.positions[i] +=
            frictionCorrection(state.positions[i] - body.scratch.previous[i], out.normal, out.depth, friction);
        touched.push_back({i, out.normal, 0.0, false});
        ++report.ground_contacts;
      }
      report.ground_contacts += pushEmbedded(
          model,
          [&](const Vec3& p) -> Vec3 {
            const Projection out = projectOutOfGround(p, *settings.ground);
            return out.inside ? Vec3(out.depth * out.normal) : Vec3::Zero();
          },
          state,
          [&](Index i, const Vec3&) {
            touched.push_back({i, Vec3::UnitZ(), 0.0, false});
          },
          few ? &body.low_embedded : nullptr);
    }
    if (near_push && !inside) {
      const auto isPushed = [&](Index i, const Vec3& shift) {
        hit_push = true;
        push_impulse += model.masses[i] * shift;
        const Vec3 normal = (state.positions[i] - push.position).normalized();
        touched.push_back({i, normal, normal.dot(push_velocity), true});
      };
      report.push_contacts += pushEmbedded(model, outOfSphere, state, isPushed);
      report.push_contacts += pushFaces(model, push.position, push.radius, state, isPushed);
      for (Index i = 0; i < model.rest.size(); ++i) {
        if (model.fixed[i]) continue;
        const Vec3 shift = outOfSphere(state.positions[i]);
        if (shift.isZero(0.0)) continue;
        state.positions[i] += shift;
        isPushed(i, shift);
        ++report.push_contacts;
      }
    }
  }
  if (hit_push) {
    push.touching = true;
    push.force -= push_impulse / (h * h_frame);
    if (!body.touched_by_push) say(EventType::kTouched, body.name, 0, "the push sphere touched " + body.name);
  }
  body.touched_by_push = hit_push;
}

// Those that would be below the ground at the end of the frame at twice their speed, and half a spacing more. One that
// is faster still is met in the next frame.
void World::Impl::findLow(WorldBody& body, double h_frame) {
  const BodyModel& model = *body.model;
  const BodyState& state = body.state;
  const double reach = *settings.ground + 0.5 * model.spacing + std::abs(settings.gravity.z()) * h_frame * h_frame;
  const auto low = [&](double height, double speed) { return height + std::min(0.0, 2.0 * h_frame * speed) < reach; };
  body.low_particles.clear();
  body.low_embedded.clear();
  for (Index i = 0; i < model.rest.size(); ++i)
    if (low(state.positions[i].z(), state.velocities[i].z())) body.low_particles.push_back(i);
  const SurfaceBinding& binding = model.binding;
  for (Index r = 0; r < binding.embedded.size(); ++r) {
    double height = state.embedded_offsets[r].z() - binding.levers[r].norm(), speed = 0.0;
    for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k) {
      height += binding.weights[k] * state.positions[binding.carriers[k]].z();
      speed += binding.weights[k] * state.velocities[binding.carriers[k]].z();
    }
    if (low(height, speed)) body.low_embedded.push_back(r);
  }
  body.low_current = true;
}

void World::Impl::fadeEmbeddedOffsets(WorldBody& body, double h) {
  const double left = std::exp(-h / kEmbeddedFade);
  const double gone = kOffsetGone * body.model->spacing;
  for (Vec3& offset : body.state.embedded_offsets) {
    offset *= left;
    if (offset.squaredNorm() < gone * gone) offset.setZero();
  }
}

}  // namespace meshless
