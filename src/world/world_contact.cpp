// Contact by rest shapes: what bodies show of themselves, and what comes back.
#include <algorithm>
#include <cmath>
#include <future>
#include <limits>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/dynamics/extent.h"
#include "shape_colliders.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr std::size_t kWorthAThread = 1000;  // vertices
constexpr std::size_t kKeptModels = 64;      // more than this many dead entries are cleared away
constexpr double kHeldLift = 0.5;            // of the spacing, a step

SurfaceRows rowsOf(const BodyModel& model) {
  const SurfaceBinding& b = model.binding;
  return {&b.particle, &b.embedded, &b.offsets, &b.carriers, &b.weights};
}

double speedOf(const WorldBody& body) {
  double fastest = 0.0;
  for (const Vec3& v : body.state.velocities) fastest = std::max(fastest, v.squaredNorm());
  return std::sqrt(fastest);
}

void fitMaps(WorldBody& body) { fitMaps(*body.model, body.material, body.state, body.maps, body.quadratic_maps); }

}  // namespace

WorldObstacle::WorldObstacle(ObstacleDef of_def)
    : def(std::make_shared<ObstacleDef>(std::move(of_def))),
      masses(def->mesh.vertices.size(), 0.0),
      inverse_masses(def->mesh.vertices.size(), 0.0),
      maps(1),
      shape(def->mesh, {&own, nullptr, nullptr, nullptr, nullptr}, 0.0),
      surface(def->mesh, ownSupports(static_cast<Index>(def->mesh.vertices.size()))) {
  for (Index v = 0; v < def->mesh.vertices.size(); ++v) {
    own.push_back(v);
    bounds.extend(def->mesh.vertices[v]);
  }
}

ContactModel::ContactModel(BodyModelPtr of_model)
    : model(std::move(of_model)), shape(model->surface, rowsOf(*model), model->spacing) {
  for (std::size_t i = 0; i < model->masses.size(); ++i)
    inverse_masses.push_back(model->fixed[i] ? 0.0 : 1.0 / model->masses[i]);
}

const SelfContactSet& ContactModel::self(bool cuts_alone) const {
  std::unique_ptr<const SelfContactSet>& set = self_[cuts_alone];
  if (!set) set = std::make_unique<SelfContactSet>(selfContactSet(shape, cuts_alone, model->spacing));
  return *set;
}

const ContactModel& World::Impl::contactModel(WorldBody& body) {
  if (body.contact && body.contact->model == body.model) return *body.contact;
  std::weak_ptr<const ContactModel>& known = contact_models[body.model.get()];
  std::shared_ptr<const ContactModel> contact = known.lock();
  if (!contact || contact->model != body.model) {
    if (body.coming_contact.valid()) contact = body.coming_contact.get();
    if (!contact || contact->model != body.model) contact = std::make_shared<ContactModel>(body.model);
    known = contact;
    ++report.contact_shapes;
    if (contact_models.size() > 2 * bodies.size() + kKeptModels)
      for (auto it = contact_models.begin(); it != contact_models.end();)
        it = it->second.expired() ? contact_models.erase(it) : std::next(it);
  }
  body.coming_contact = {};
  body.contact = std::move(contact);
  return *body.contact;
}

// The pieces of a cut lie on each other: their shapes are made while the cut is answered.
void World::Impl::foreseeContact(WorldBody& body) {
  if (contactMethod() != ContactMethod::kRestShape || body.model->surface.vertices.size() < kWorthAThread) return;
  body.coming_contact = std::async(std::launch::async, [model = body.model]() -> std::shared_ptr<const ContactModel> {
    return std::make_shared<ContactModel>(model);
  });
}

// Finds where the bodies are, which pairs can touch, and their contacts. What contact needs of a body is made only
// where something is near. A body that is reached wakes, and then all is found again with its neighbours.
void World::Impl::findContacts(double h_frame) {
  ContactScene scene;
  scene.ground = settings.ground;
  scene.ground_friction = settings.ground_friction;
  scene.gravity = settings.gravity;
  expectMeetings();
  for (;;) {
    fillShapeColliders();
    contacts.findPairs(scene, shape_colliders, h_frame, report.contact_counters);
    for (std::size_t b = 0; b < bodies.size(); ++b)
      if (contacts.needed()[b]) equipShapeCollider(*bodies[b], shape_colliders[b]);
    forNumbers(bodies.size(), [this](std::size_t b) {
      if (!(contacts.needed()[b] & 1)) return;
      fitMaps(*bodies[b]);
      shape_colliders[b].maps = bodies[b]->maps.data();
      shape_colliders[b].map_count = static_cast<Index>(bodies[b]->maps.size());
    });
    contacts.make(shape_colliders, h_frame, report.contact_counters, for_each);
    bool woken = false;
    for (Index p : contacts.reached()) {
      woken = woken || bodies[p]->asleep;
      wake(*bodies[p]);
    }
    if (!woken) break;
    listAwake();
  }
  contacts.expect({});
}

void World::Impl::fillShapeColliders() {
  shape_colliders.resize(bodies.size() + obstacles.size());
  for (std::size_t o = 0; o < obstacles.size(); ++o)
    shape_colliders[bodies.size() + o] = shapeColliderOf(*obstacles[o], kObstacleKey + o);
  forNumbers(bodies.size(), [this](std::size_t b) { fillShapeCollider(*bodies[b], shape_colliders[b]); });
}

void World::Impl::fillShapeCollider(WorldBody& body, ShapeCollider& collider) {
  collider = shapeColliderOf(*body.model, body.material, body.state, body.number);
  collider.moves = !body.asleep;
  const SelfContact wanted = body.material.self_contact;
  collider.meets_itself = body.material.bends() &&
                          (wanted == SelfContact::kAll || (wanted == SelfContact::kWoundFaces && body.model->incised));
  if (body.asleep) {
    collider.bounds = body.bounds;
    return;
  }
  readMotion(*body.model, body.material, body.state, embeddedReach(body), collider);
  body.spread = collider.spread;
  body.fastest = collider.velocity.norm() + collider.spread;
  body.bounds = collider.bounds;
  if (body.model->surface.vertices.empty()) collider.bounds = Box();  // nothing to touch with
}

double World::Impl::embeddedReach(WorldBody& body) {
  if (body.reach_of == body.model) return body.embedded_reach;
  body.reach_of = body.model;
  body.embedded_reach = embeddedReachOf(*body.model);
  return body.embedded_reach;
}

void World::Impl::equipShapeCollider(WorldBody& body, ShapeCollider& collider) {
  const ContactModel& model = contactModel(body);
  collider.shape = &model.shape;
  collider.inverse_masses = model.inverse_masses.data();
  if (collider.meets_itself) collider.self = &model.self(body.material.self_contact == SelfContact::kWoundFaces);
  if (model.shape.hasEmbedded()) {
    refreshSurface(body);
    collider.surface = body.state.surface.data();
  }
}

void World::Impl::solveContacts(double h) {
  for (std::size_t b = 0; b < bodies.size(); ++b)
    shape_colliders[b].previous = bodies[b]->asleep ? shape_colliders[b].positions : bodies[b]->scratch.previous.data();
  const RefitMaps refit = [this](Index p, std::vector<ContactMap>& maps) {
    if (p >= bodies.size()) {
      maps = obstacles[p - bodies.size()]->maps;
      return;
    }
    WorldBody& body = *bodies[p];
    fitMaps(*body.model, body.material, body.state, maps, body.quadratic_maps);
    if (shape_colliders[p].surface && !body.asleep) {
      updateSurface(*body.model, body.state);
      shape_colliders[p].surface = body.state.surface.data();
    }
  };
  contacts.solve(shape_colliders, h, refit, report.contact_counters, for_each);
  report.ground_contacts += contacts.groundLoaded();
}

// Lifts for the eye what the sweeps leave below the ground, and what is there between the points that contacts hold:
// particles without a change of speed, embedded vertices by their offsets, which fade.
void World::Impl::liftOutOfGround(WorldBody& body, double h_frame) {
  const SurfaceBinding& binding = body.model->binding;
  // Far above the ground its speed need not be computed.
  if (!settings.ground || !(body.bounds.min.z() - body.bounds.diagonal() - h_frame * body.fastest < *settings.ground) ||
      !(body.bounds.min.z() - 2.0 * h_frame * speedOf(body) < *settings.ground))
    return;
  // What a stiff pick holds down there is lifted a little at a time: the pick would pull all of it back in the next
  // step.
  const double most = isHeld(body) ? kHeldLift * body.model->spacing : std::numeric_limits<double>::infinity();
  for (Index i : binding.particle)
    if (i != kNoIndex && body.state.positions[i].z() < *settings.ground && !body.model->fixed[i])
      body.state.positions[i].z() = std::min(*settings.ground, body.state.positions[i].z() + most);
  if (binding.embedded.empty()) return;
  findLow(body, h_frame);
  body.low_current = false;
  if (body.low_embedded.empty()) return;
  fitClusters(matchInput(*body.model, body.state), body.state.positions, binding.lever_clusters, body.state.poses);
  for (Index r : body.low_embedded) {
    const double z =
        embeddedPosition(binding, body.state.positions, body.state.poses, r).z() + body.state.embedded_offsets[r].z();
    if (z < *settings.ground) body.state.embedded_offsets[r].z() += *settings.ground - z;
  }
}

}  // namespace meshless
