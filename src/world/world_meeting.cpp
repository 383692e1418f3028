// What the pieces of a cut touch, found by another thread before the step that asks for it.
#include <algorithm>

#include "meshless_surgery/dynamics/extent.h"
#include "shape_colliders.h"
#include "world_impl.h"

namespace meshless {

// A body as it was when a cut had been made, or an obstacle.
struct World::Impl::Met {
  std::uint64_t key = 0;
  BodyModelPtr model;
  Material material;
  BodyState state;
  bool surface_current = false, moves = false;
  Box bounds;                                                      // where it does not
  std::shared_future<std::shared_ptr<const ContactModel>> coming;  // or
  std::shared_ptr<const ContactModel> contact;                     // or
  std::shared_ptr<WorldObstacle> obstacle;
  std::vector<ContactMap> maps;
  std::vector<QuadraticMap> quadratic_maps;

  Met(WorldBody& body, bool is_fresh)
      : key(body.number),
        model(body.model),
        material(body.material),
        state(body.state),
        surface_current(body.surface_current),
        moves(is_fresh || !body.asleep),
        bounds(body.bounds),
        coming(body.coming_contact),
        contact(body.contact && body.contact->model == body.model ? body.contact : nullptr) {}
  Met(std::shared_ptr<WorldObstacle> of_obstacle, std::uint64_t of_key)
      : key(of_key), obstacle(std::move(of_obstacle)) {}

  // As fillShapeCollider() and equipShapeCollider() will fill it.
  ShapeCollider collider() {
    if (obstacle) return shapeColliderOf(*obstacle, key);
    if (coming.valid()) contact = coming.get();
    // The model may have been replaced since that was begun.
    if (!contact || contact->model != model) contact = std::make_shared<ContactModel>(model);
    ShapeCollider collider = shapeColliderOf(*model, material, state, key);
    collider.moves = moves;
    if (moves)
      readMotion(*model, material, state, embeddedReachOf(*model), collider);
    else
      collider.bounds = bounds;
    collider.shape = &contact->shape;
    collider.inverse_masses = contact->inverse_masses.data();
    if (contact->shape.hasEmbedded()) {
      if (!surface_current) updateSurface(*model, state);
      collider.surface = state.surface.data();
    }
    fitMaps(*model, material, state, maps, quadratic_maps);
    collider.maps = maps.data();
    collider.map_count = static_cast<Index>(maps.size());
    return collider;
  }
};

struct World::Impl::Meeting {
  std::vector<Met> met;  // the pieces first
  Index fresh = 0;
  Contacts contacts;

  void find(const ContactScene& scene, double h_frame) {
    std::vector<ShapeCollider> colliders;
    for (Met& m : met) {
      colliders.push_back(m.collider());
      colliders.back().shape->link();
    }
    ContactCounters counters;
    contacts.findPairs(scene, colliders, h_frame, counters);
    contacts.queryAhead(colliders, fresh, h_frame);
  }
};

// After a cut, the first step would have to query all points of the pieces at once, in fresh shapes: in each other and
// in what they lie on. Another thread does so while the cut is answered.
void World::Impl::foreseeMeeting(const BodyId& parent, const std::vector<BodyId>& pieces) {
  auto meeting = std::make_shared<Meeting>();
  Box around;
  for (const BodyId& id : pieces) {
    WorldBody& piece = *find(id);
    if (!piece.coming_contact.valid()) continue;
    const Box bounds = extentOf(piece.state.positions);
    around.extend(bounds.min);
    around.extend(bounds.max);
    meeting->met.emplace_back(piece, true);
  }
  meeting->fresh = static_cast<Index>(meeting->met.size());
  if (meeting->fresh < 2) return;
  for (const auto& other : bodies) {
    if (other->id == parent || std::find(pieces.begin(), pieces.end(), other->id) != pieces.end()) continue;
    if (!other->bounds.overlaps(around) || other->model->surface.vertices.empty()) continue;
    const bool has_shape = other->contact && other->contact->model == other->model;
    if (!has_shape && !other->coming_contact.valid()) foreseeContact(*other);  // one that has been loaded has none yet
    if (!other->coming_contact.valid()) contactModel(*other);
    meeting->met.emplace_back(*other, false);
  }
  for (std::size_t o = 0; o < obstacles.size(); ++o)
    if (obstacles[o]->bounds.overlaps(around)) meeting->met.emplace_back(obstacles[o], kObstacleKey + o);
  ContactScene scene;  // without the ground, in which nothing is queried
  scene.gravity = settings.gravity;
  meetings.push_back(std::async(std::launch::async, [meeting, scene, h_frame = 1.0 / settings.step_rate] {
    meeting->find(scene, h_frame);
    return std::shared_ptr<const Contacts>(meeting, &meeting->contacts);
  }));
}

void World::Impl::expectMeetings() {
  auto taken = std::move(meetings);
  meetings.clear();  // whatever one of them throws
  std::vector<std::shared_ptr<const Contacts>> ahead;
  for (auto& meeting : taken) ahead.push_back(meeting.get());
  contacts.expect(std::move(ahead));
}

}  // namespace meshless
