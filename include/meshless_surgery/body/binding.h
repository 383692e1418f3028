// How the vertices of a surface follow the particles.
#pragma once

#include <functional>

#include "meshless_surgery/body/body.h"

namespace meshless {

/// Sum of the magnitudes of a rider's weights at most: by so much can it amplify what its carriers do one by one.
constexpr double kMostWeight = 2.0;

/// Binds a surface whose vertex v is particle vertex_particle[v], or rides where that is kNoIndex. A rider is the
/// moving least-squares mean of up to twelve particles that are near it along the body: smooth, and exact where the
/// body moves affinely. One that lies so far beside its particles that its weights would exceed kMostWeight has up to
/// forty, and where that does not do, follows a cluster for the rest. Directions that the particles hardly span, as in
/// thin sheets and crumbs, follow a cluster of the nearest one.
///
/// Of a piece, riders whose carriers all came along keep them, and those that have enough of theirs left get weights
/// for these: `inherited` says which rider of the parent a vertex was (kNoIndex: none) and what the parent's particles
/// are called in the piece (kNoIndex: not there). `start` says which particle of the piece is near a vertex that is new
/// (kNoIndex: it is looked for).
struct InheritedBinding {
  const SurfaceBinding& parent;
  std::vector<Index> rider;
  const std::vector<Index>& renumbered;
  std::vector<Index> start;  // of each vertex; may be empty
  /// True where a lip lies between a vertex and a particle: it does not follow it. May be empty.
  std::function<bool(Index vertex, Index particle)> separated;
};
SurfaceBinding bindSurface(const Points& rest, const ParticleGraph& graph, const ClusterSet& clusters,
                           const Points& surface_rest, std::vector<Index> vertex_particle,
                           const InheritedBinding* inherited = nullptr);

/// Where rider r of the binding is by its carriers, without its offset [m]. Poses of
/// lever_clusters must fit positions.
inline Vec3 riderPosition(const SurfaceBinding& binding, const Points& positions, const std::vector<ClusterPose>& poses,
                          Index r) {
  Vec3 sum = Vec3::Zero();
  for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k)
    sum += binding.weights[k] * positions[binding.carriers[k]];
  if (!binding.levers[r].isZero(0.0)) sum += poses[binding.turners[r]].deformation * binding.levers[r];
  return sum;
}

}  // namespace meshless
