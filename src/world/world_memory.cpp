// How much memory a world holds.
#include "meshless_surgery/body/body_bytes.h"
#include "world_impl.h"

namespace meshless {

std::size_t ContactModel::bytes() const {
  std::size_t sum = sizeof *this - sizeof shape + shape.bytes() + bytesOf(inverse_masses);
  for (const auto& set : self_)
    if (set) sum += sizeof *set + bytesOf(set->vertices, set->triangles, set->ridges);
  return sum;
}

MemoryUse World::memory() const {
  const Impl& w = *impl_;
  MemoryUse use;
  std::set<const void*> seen;  // what is shared
  const auto first = [&seen](const void* part) { return part && seen.insert(part).second; };
  for (const auto& body : w.bodies) {
    use.particles += body->state.positions.size();
    if (first(body->model.get())) use.models += bytesOf(*body->model);
    use.states += sizeof *body + bytesOf(body->state) + bytesOf(body->scratch) + bytesOf(body->rest_from);
    use.contact += bytesOf(body->collision, body->maps, body->quadratic_maps, body->low_particles, body->low_embedded);
    if (first(body->contact.get())) use.contact += body->contact->bytes();
    if (first(body->surface_model.get())) use.contact += body->surface_model->bytes();
    if (first(body->mesh.get()))
      use.contact += sizeof *body->mesh + bytesOf(body->mesh->tetrahedra, body->mesh->faces, body->mesh->edges);
  }
  for (const WorldBatch& batch : w.batches) {
    use.states += batch.batch->bytes() + bytesOf(batch.bodies, batch.states, batch.spare);
    for (const auto& lanes : batch.spare)
      use.states += sizeof *lanes + lanes->batch.bytes() + bytesOf(lanes->models, lanes->states);
  }
  use.states += bytesOf(w.island_batches, w.in_island);
  for (const IslandBatch& island_batch : w.island_batches) {
    use.states += bytesOf(island_batch.bodies, island_batch.alone, island_batch.side_by_side, island_batch.lanes);
    for (const auto& some : island_batch.side_by_side) use.states += bytesOf(some);
  }
  for (const auto& obstacle : w.obstacles) {
    use.models += bytesOf(obstacle->def->mesh.vertices, obstacle->def->mesh.triangles, obstacle->own) +
                  bytesOf(obstacle->masses, obstacle->inverse_masses, obstacle->maps);
    use.contact += obstacle->shape.bytes() + obstacle->surface.bytes();
  }
  use.contact += w.contacts.bytes() + w.surface_contacts.bytes() + bytesOf(w.shape_colliders, w.colliders, w.loaded) +
                 bytesOf(w.surface_work, w.stiffest);
  for (const SurfaceWork& work : w.surface_work)
    use.contact += bytesOf(work.bodies, work.picks, work.previous, work.springs, work.each_counters) +
                   bytesOf(work.solver_scratch.active, work.solver_scratch.levers, work.limit_scratch.meeting,
                           work.limit_scratch.held);
  for (const auto& body : w.scene) {
    if (!first(body.get())) continue;
    if (first(body->model.get())) use.kept += bytesOf(*body->model);
    use.kept += sizeof *body + bytesOf(body->state);
  }
  for (const CutUndo& undo : w.undo)
    for (const CutUndo::Body& body : undo.bodies) {
      if (first(body.model.get())) use.kept += bytesOf(*body.model);
      use.kept += sizeof body + bytesOf(body.state);
    }
  return use;
}

}  // namespace meshless
