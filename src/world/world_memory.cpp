// How much memory a world holds.
#include "meshless_surgery/body/body_bytes.h"
#include "world_impl.h"

namespace meshless {

MemoryUse World::memory() const {
  const Impl& w = *impl_;
  MemoryUse use;
  std::set<const void*> seen;  // what is shared
  const auto first = [&seen](const void* part) { return part && seen.insert(part).second; };
  const auto add = [&first](const BodyModelPtr& model, std::size_t& to) {
    if (!first(model.get())) return;
    to += bytesOf(*model);
    if (first(model->texture.get())) to += model->texture->bytes();
  };
  for (const auto& body : w.bodies) {
    use.particles += body->state.positions.size();
    add(body->model, use.models);
    use.states += sizeof *body + bytesOf(body->state) + bytesOf(body->scratch) + bytesOf(body->rest_from);
    if (first(body->surface_model.get())) use.contact += body->surface_model->bytes();
    if (first(body->mesh.get()))
      use.contact += sizeof *body->mesh + bytesOf(body->mesh->tetrahedra, body->mesh->faces, body->mesh->edges);
  }
  const auto bytesOfAll = [](const std::vector<Attachment>& attachments) {
    std::size_t sum = bytesOf(attachments);
    for (const Attachment& attachment : attachments) {
      sum += bytesOf(attachment.fibres);
      for (const Fibre& fibre : attachment.fibres)
        for (const BodyPoint* end : {&fibre.at_a, &fibre.at_b}) sum += bytesOf(end->particles, end->weights);
    }
    return sum;
  };
  use.states += bytesOf(w.forces);
  for (const AppliedForce& force : w.forces) {
    use.states += bytesOf(force.points);
    for (const AppliedForce::Point& point : force.points) use.states += bytesOf(point.at.particles, point.at.weights);
  }
  use.states += bytesOfAll(w.attachments) + bytesOf(w.attached.all, w.attached.offsets, w.attached.of_body);
  for (const WorldBatch& batch : w.batches) {
    use.states += bytesOf(batch.bodies, batch.spare);
    for (const auto& lanes : batch.spare)
      use.states += sizeof *lanes + lanes->batch.bytes() + bytesOf(lanes->models, lanes->states);
  }
  for (const auto& obstacle : w.obstacles) {
    use.models +=
        bytesOf(obstacle->def->mesh.vertices, obstacle->def->mesh.triangles) + bytesOf(obstacle->inverse_masses);
    use.contact += obstacle->surface.bytes();
  }
  use.contact += w.surface_contacts.bytes() + bytesOf(w.colliders, w.loaded, w.surface_work, w.stiffest, w.members);
  for (const SurfaceWork& work : w.surface_work) {
    use.contact += bytesOf(work.members, work.bodies, work.alone, work.side_by_side, work.lanes, work.each_counters) +
                   bytesOf(work.solver_scratch.active, work.solver_scratch.pulls);
    for (const auto& some : work.side_by_side) use.contact += bytesOf(some);
    for (const SurfaceWork::Member& member : work.members)
      use.contact += bytesOf(member.previous, member.picks, member.springs, member.fibres, member.fibre_rows);
  }
  for (const auto& body : w.scene) {
    if (!first(body.get())) continue;
    add(body->model, use.kept);
    use.kept += sizeof *body + bytesOf(body->state);
  }
  for (const CutUndo& undo : w.undo) use.kept += bytesOfAll(undo.attachments);
  for (const CutUndo& undo : w.undo)
    for (const CutUndo::Body& body : undo.bodies) {
      add(body.model, use.kept);
      use.kept += sizeof body + bytesOf(body.state);
    }
  return use;
}

}  // namespace meshless
