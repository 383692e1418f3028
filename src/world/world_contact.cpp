// Contact by rest shapes: what bodies show of themselves, and what comes back.
#include <algorithm>
#include <cmath>
#include <future>
#include <limits>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/dynamics/extent.h"
#include "meshless_surgery/world/quadratic_fit.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kLeastRigid = 0.5;          // share of a contact's impulse that moves a body for looks as a whole
constexpr double kFlattest = 1e-6;           // det of a map: below, the rotation stands in
constexpr std::size_t kWorthAThread = 1000;  // vertices
constexpr std::size_t kKeptModels = 64;      // more than this many dead entries are cleared away
constexpr double kHeldLift = 0.5;            // of the spacing, a step

SurfaceRows rowsOf(const BodyModel& model) {
  const SurfaceBinding& b = model.binding;
  return {&b.particle, &b.riders, &b.offsets, &b.carriers, &b.weights};
}

// The affine fit of one cluster at given positions; the rotation that it has where the fit has no rank.
ContactMap fitMap(const MatchInput& in, Index c, const Vec3* positions, const ClusterPose& pose) {
  const ClusterRest& rest = in.shape.clusters[c];
  ContactMap map;
  map.rest = rest.centre;
  Vec3 sum = Vec3::Zero();
  Mat3 moment = Mat3::Zero();
  const Vec3 origin = positions[in.clusters.members[in.clusters.offsets[c]]];
  for (Index k = in.clusters.offsets[c]; k < in.clusters.offsets[c + 1]; ++k) {
    const Index i = in.clusters.members[k];
    const double m = in.masses[i] * in.clusters.weights[k];
    const Vec3 x = m * (positions[i] - origin), q = in.rest[i] - rest.centre;
    sum += x;
    for (int d = 0; d < 3; ++d) moment.col(d) += q[d] * x;
  }
  map.centre = origin + sum / rest.mass;
  map.from_rest = rest.linear_rank ? Mat3(moment * rest.moment_inverse) : pose.rotation.toRotationMatrix();
  double det = map.from_rest.determinant();
  if (!(std::abs(det) > kFlattest) || !(map.from_rest.squaredNorm() < 1e6)) {
    map.from_rest = pose.rotation.toRotationMatrix();
    map.to_rest = map.from_rest.transpose();
    return map;
  }
  map.flipped = det < 0.0;
  map.to_rest = map.from_rest.inverse();
  return map;
}

double speedOf(const WorldBody& body) {
  double fastest = 0.0;
  for (const Vec3& v : body.state.velocities) fastest = std::max(fastest, v.squaredNorm());
  return std::sqrt(fastest);
}

// The maps of a frame: a body bends within a cluster where its mode is quadratic. Maps point into `quadratic`.
void fitMaps(const BodyModel& model, const Material& material, const BodyState& state, std::vector<ContactMap>& maps,
             std::vector<QuadraticMap>& quadratic) {
  const MatchInput in = matchInput(model, state);
  const Vec3* positions = state.positions.data();
  maps.resize(in.clusters.size());
  for (Index c = 0; c < in.clusters.size(); ++c) maps[c] = fitMap(in, c, positions, state.poses[c]);
  if (!material.elastic() && material.mode == MatchMode::kQuadratic && !in.shape.quadratic.empty())
    fitQuadraticMaps(in, positions, maps, quadratic);
}

void fitMaps(WorldBody& body) { fitMaps(*body.model, body.material, body.state, body.maps, body.quadratic_maps); }

// Two spacings, but of crumbs, whose surface is all nearer to their few particles, no more than what they have: where
// many of them lie together each would be next to all.
double riderReachOf(const BodyModel& model) {
  const SurfaceBinding& binding = model.binding;
  double farthest = 0.0;  // squared, of a rider from its nearest carrier
  for (Index r = 0; r < binding.riders.size(); ++r) {
    double nearest = std::numeric_limits<double>::infinity();
    for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k)
      nearest = std::min(nearest,
                         (model.surface.vertices[binding.riders[r]] - model.rest[binding.carriers[k]]).squaredNorm());
    farthest = std::max(farthest, nearest);
  }
  return 2.0 * std::min(std::sqrt(farthest), model.spacing);
}

// What a party is, and how it moves.
ContactParty partyOf(const BodyModel& model, const Material& material, BodyState& state, std::uint64_t key) {
  ContactParty party;
  party.key = key;
  party.mass = model.mass;
  party.friction = material.friction;
  party.restitution = material.restitution;
  party.positions = state.positions.data();
  party.particles = static_cast<Index>(state.positions.size());
  party.masses = model.masses.data();
  return party;
}

void readMotion(const BodyModel& model, const Material& material, const BodyState& state, double rider_reach,
                ContactParty& party) {
  party.rigid_share = model.any_fixed || material.elastic() ? 0.0 : std::max(kLeastRigid, material.alpha);
  party.bounds = extentOf(state.positions);
  const Box velocities = extentOf(state.velocities);
  party.velocity = 0.5 * (velocities.min + velocities.max);
  party.spread = 0.5 * velocities.diagonal();
  party.bounds.min.array() -= rider_reach;
  party.bounds.max.array() += rider_reach;
}

// A body as it was when a cut had been made, for another thread.
struct Met {
  std::uint64_t key = 0;
  BodyModelPtr model;
  Material material;
  BodyState state;
  bool surface_current = false, moves = false;
  std::shared_future<std::shared_ptr<const ContactModel>> coming;  // or
  std::shared_ptr<const ContactModel> contact;
  std::vector<ContactMap> maps;
  std::vector<QuadraticMap> quadratic_maps;
};

// What a frame would find of them, where they are.
std::shared_ptr<const Contacts> meet(std::vector<Met>& met, const ContactScene& scene, double h_frame) {
  std::vector<ContactParty> parties;
  for (Met& m : met) {
    if (m.coming.valid()) m.contact = m.coming.get();
    if (!m.contact || m.contact->model != m.model) m.contact = std::make_shared<ContactModel>(m.model);
    m.contact->shape.link();
    ContactParty party = partyOf(*m.model, m.material, m.state, m.key);
    party.moves = m.moves;
    readMotion(*m.model, m.material, m.state, riderReachOf(*m.model), party);
    party.shape = &m.contact->shape;
    party.inverse_masses = m.contact->inverse_masses.data();
    if (m.contact->shape.rides()) {
      if (!m.surface_current) updateSurface(*m.model, m.state);
      party.surface = m.state.surface.data();
    }
    fitMaps(*m.model, m.material, m.state, m.maps, m.quadratic_maps);
    party.maps = m.maps.data();
    party.map_count = static_cast<Index>(m.maps.size());
    parties.push_back(party);
  }
  auto contacts = std::make_shared<Contacts>();
  ContactCounters counters;
  contacts->findPairs(scene, parties, h_frame, counters);
  contacts->make(parties, h_frame, counters, oneAfterAnother);
  return contacts;
}

}  // namespace

WorldObstacle::WorldObstacle(ObstacleDef of_def)
    : def(std::make_shared<ObstacleDef>(std::move(of_def))),
      masses(def->mesh.vertices.size(), 0.0),
      inverse_masses(def->mesh.vertices.size(), 0.0),
      maps(1),
      shape(def->mesh, {&own, nullptr, nullptr, nullptr, nullptr}, 0.0) {
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
  if (settings.contact != ContactMethod::kRestShape || body.model->surface.vertices.size() < kWorthAThread) return;
  body.coming_contact = std::async(std::launch::async, [model = body.model]() -> std::shared_ptr<const ContactModel> {
    return std::make_shared<ContactModel>(model);
  });
}

// The first step after a cut would look up in fresh shapes all points of the pieces, of each other and of what they lie
// on, and all at once: another thread does while the cut is answered.
void World::Impl::foreseeMeeting(const BodyId& parent, const std::vector<BodyId>& pieces) {
  auto met = std::make_shared<std::vector<Met>>();
  Box around;
  for (const BodyId& id : pieces) {
    const WorldBody& piece = *find(id);
    if (!piece.coming_contact.valid()) continue;
    const Box bounds = extentOf(piece.state.positions);
    around.extend(bounds.min);
    around.extend(bounds.max);
    met->push_back({piece.number,
                    piece.model,
                    piece.material,
                    piece.state,
                    piece.surface_current,
                    true,
                    piece.coming_contact,
                    nullptr,
                    {},
                    {}});
  }
  if (met->size() < 2) return;
  for (const auto& other : bodies) {
    if (other->id == parent || std::find(pieces.begin(), pieces.end(), other->id) != pieces.end()) continue;
    if (!other->bounds.overlaps(around) || other->model->surface.vertices.empty()) continue;
    // Whoever has been loaded has no shape yet: who is met must not depend on that.
    if ((!other->contact || other->contact->model != other->model) && !other->coming_contact.valid())
      foreseeContact(*other);
    if (!other->coming_contact.valid()) contactModel(*other);
    met->push_back({other->number,
                    other->model,
                    other->material,
                    other->state,
                    other->surface_current,
                    !other->asleep,
                    other->coming_contact,
                    other->contact,
                    {},
                    {}});
  }
  ContactScene scene;  // without the ground, in which nothing is looked up
  scene.gravity = settings.gravity;
  meetings.push_back(std::async(
      std::launch::async, [met, scene, h_frame = 1.0 / settings.step_rate] { return meet(*met, scene, h_frame); }));
}

void World::Impl::takeMeetings() {
  auto taken = std::move(meetings);
  meetings.clear();
  for (auto& meeting : taken) contacts.adopt(*meeting.get());
}

// Who is where, which pairs can touch, and what they need for it: nothing for those that nobody is near. Whom something
// reaches wakes, and then its neighbours are looked at as well.
void World::Impl::findContacts(double h_frame) {
  ContactScene scene;
  scene.ground = settings.ground;
  scene.ground_friction = settings.ground_friction;
  scene.gravity = settings.gravity;
  for (;;) {
    fillParties();
    contacts.findPairs(scene, parties, h_frame, report.contact_counters);
    for (std::size_t b = 0; b < bodies.size(); ++b)
      if (contacts.needed()[b]) equipParty(*bodies[b], parties[b]);
    forNumbers(bodies.size(), [this](std::size_t b) {
      if (!(contacts.needed()[b] & 1)) return;
      fitMaps(*bodies[b]);
      parties[b].maps = bodies[b]->maps.data();
      parties[b].map_count = static_cast<Index>(bodies[b]->maps.size());
    });
    rememberSlow();
    contacts.make(parties, h_frame, report.contact_counters, for_each);
    bool woken = false;
    for (Index p : contacts.reached()) {
      woken = woken || bodies[p]->asleep;
      wake(*bodies[p]);
    }
    if (!woken) return;
    listAwake();
  }
}

void World::Impl::fillParties() {
  parties.resize(bodies.size() + obstacles.size());
  for (std::size_t o = 0; o < obstacles.size(); ++o) {
    WorldObstacle& obstacle = *obstacles[o];
    ContactParty& party = parties[bodies.size() + o];
    party = ContactParty();
    party.key = kObstacleKey + o;
    party.shape = &obstacle.shape;
    party.positions = obstacle.def->mesh.vertices.data();
    party.previous = party.positions;
    party.masses = obstacle.masses.data();
    party.inverse_masses = obstacle.inverse_masses.data();
    party.particles = static_cast<Index>(obstacle.def->mesh.vertices.size());
    party.maps = obstacle.maps.data();
    party.map_count = 1;
    party.friction = obstacle.def->friction;
    party.bounds = obstacle.bounds;
    party.moves = false;
  }
  forNumbers(bodies.size(), [this](std::size_t b) { fillParty(*bodies[b], parties[b]); });
}

void World::Impl::fillParty(WorldBody& body, ContactParty& party) {
  party = partyOf(*body.model, body.material, body.state, body.number);
  party.moves = !body.asleep;
  const SelfContact wanted = body.material.self_contact;
  party.meets_itself =
      body.material.bends() && (wanted == SelfContact::kAll || (wanted == SelfContact::kLips && body.model->lips));
  if (body.asleep) {
    party.bounds = body.bounds;
    return;
  }
  readMotion(*body.model, body.material, body.state, riderReach(body), party);
  body.spread = party.spread;
  body.fastest = party.velocity.norm() + party.spread;
  body.bounds = party.bounds;
  if (body.model->surface.vertices.empty()) party.bounds = Box();  // nothing to touch with
}

double World::Impl::riderReach(WorldBody& body) {
  if (body.reach_of == body.model) return body.rider_reach;
  body.reach_of = body.model;
  body.rider_reach = riderReachOf(*body.model);
  return body.rider_reach;
}

void World::Impl::equipParty(WorldBody& body, ContactParty& party) {
  const ContactModel& model = contactModel(body);
  party.shape = &model.shape;
  party.inverse_masses = model.inverse_masses.data();
  if (party.meets_itself) party.self = &model.self(body.material.self_contact == SelfContact::kLips);
  if (model.shape.rides()) {
    refreshSurface(body);
    party.surface = body.state.surface.data();
  }
}

void World::Impl::solveContacts(double h) {
  for (std::size_t b = 0; b < bodies.size(); ++b)
    parties[b].previous = bodies[b]->asleep ? parties[b].positions : bodies[b]->scratch.previous.data();
  const RefitMaps refit = [this](Index p, std::vector<ContactMap>& maps) {
    if (p >= bodies.size()) {
      maps = obstacles[p - bodies.size()]->maps;
      return;
    }
    WorldBody& body = *bodies[p];
    fitMaps(*body.model, body.material, body.state, maps, body.quadratic_maps);
    if (parties[p].surface && !body.asleep) {
      updateSurface(*body.model, body.state);
      parties[p].surface = body.state.surface.data();
    }
  };
  contacts.solve(parties, h, refit, report.contact_counters, for_each);
  report.ground_contacts += contacts.groundLoaded();
}

// What the sweeps leave below the ground, and what is there between the points that contacts hold, is lifted for the
// eye: particles without a change of speed, riders by the offsets that fade.
void World::Impl::liftOutOfGround(WorldBody& body, double h_frame) {
  const SurfaceBinding& binding = body.model->binding;
  // Far above nobody has to ask how fast it is by now.
  if (!settings.ground || !(body.bounds.min.z() - body.bounds.diagonal() - h_frame * body.fastest < *settings.ground) ||
      !(body.bounds.min.z() - 2.0 * h_frame * speedOf(body) < *settings.ground))
    return;
  // Of what a rod holds down there a little at a time: it would have it all back in the next step.
  const double most = isHeld(body) ? kHeldLift * body.model->spacing : std::numeric_limits<double>::infinity();
  for (Index i : binding.particle)
    if (i != kNoIndex && body.state.positions[i].z() < *settings.ground && !body.model->fixed[i])
      body.state.positions[i].z() = std::min(*settings.ground, body.state.positions[i].z() + most);
  if (binding.riders.empty()) return;
  findLow(body, h_frame);
  body.low_current = false;
  if (body.low_riders.empty()) return;
  fitClusters(matchInput(*body.model, body.state), body.state.positions, binding.lever_clusters, body.state.poses);
  for (Index r : body.low_riders) {
    const double z =
        riderPosition(binding, body.state.positions, body.state.poses, r).z() + body.state.rider_offsets[r].z();
    if (z < *settings.ground) body.state.rider_offsets[r].z() += *settings.ground - z;
  }
}

}  // namespace meshless
