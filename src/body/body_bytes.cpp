#include "meshless_surgery/body/body_bytes.h"

#include "meshless_surgery/geometry/lattice/cell_regions.h"

namespace meshless {

namespace {
std::size_t bytesOf(const CollisionSurface& collision) {
  const SurfaceBinding& binding = collision.binding;
  return sizeof collision + meshless::bytesOf(collision.mesh.vertices, collision.mesh.triangles, binding.offsets,
                                              binding.carriers, binding.weights, binding.cells);
}
std::size_t bytesOf(const Cavities& cavities) {
  const SurfaceBinding& binding = cavities.binding;
  std::size_t sum = sizeof cavities + meshless::bytesOf(binding.offsets, binding.carriers, binding.weights,
                                                        cavities.shells);
  for (const Cavities::Shell& shell : cavities.shells) sum += meshless::bytesOf(shell.triangles);
  return sum;
}
}  // namespace

std::size_t bytesOf(const BodyModel& model) {
  const ClusterSet& clusters = model.clusters;
  const SurfaceBinding& binding = model.binding;
  return sizeof model + bytesOf(model.rest, model.masses, model.match_masses, model.fixed, model.held_by, model.elastic) +
         bytesOf(model.graph.offsets, model.graph.neighbours, model.graph.lengths) +
         bytesOf(clusters.offsets, clusters.members, clusters.weights, clusters.seeds, clusters.radii) +
         bytesOf(model.shape.clusters, model.shape.quadratic) +
         (model.lattice ? bytesOf(model.lattice->cells, model.tissue) : 0) +
         (model.lattice && model.lattice->regions ? bytesOf(model.lattice->regions->parts(), model.regions) : 0) +
         (model.clamp ? model.clamp->bytes() + bytesOf(model.clamp_points) : 0) +
         (model.cells ? bytesOf(model.cells->cells, model.cells->masses) : 0) +
         (model.elastic_batch ? model.elastic_batch->bytes() : 0) +
         bytesOf(model.surface.vertices, model.surface.triangles, model.surface.patches) +
         (model.collision ? bytesOf(*model.collision) : 0) + (model.cavities ? bytesOf(*model.cavities) : 0) +
         bytesOf(binding.offsets, binding.carriers, binding.weights, binding.cells);
}

std::size_t bytesOf(const BodyState& state) {
  return bytesOf(state.positions, state.velocities, state.poses, state.cells, state.surface, state.plastic,
                 state.plastic_cells, state.relaxed, state.cavities, state.held);
}

std::size_t bytesOf(const StepScratch& scratch) {
  const ElasticBatchState& elastic = scratch.elastic;
  return scratch.clamp.bytes() +
         bytesOf(scratch.previous, scratch.predicted, scratch.goals, scratch.matched, scratch.touched, scratch.moved, scratch.cavity,
                 scratch.cavity_pull) +
         bytesOf(elastic.rotations, elastic.relaxed, elastic.others, elastic.forces, elastic.largest, elastic.cold);
}

}  // namespace meshless
