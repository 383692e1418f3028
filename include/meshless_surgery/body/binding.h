// How the vertices of a surface follow the particles.
#pragma once

#include <functional>

#include "meshless_surgery/body/body.h"

namespace meshless {

/// The largest sum of the magnitudes of an embedded vertex's weights. By so much can the vertex amplify what each of
/// its carriers does.
constexpr double kMostWeight = 2.0;

/// Binds a surface whose vertex v is particle vertex_particle[v], or is embedded where that is kNoIndex. An embedded
/// vertex is the moving least-squares mean of up to twelve particles that are near it along the body, its carriers. It
/// moves smoothly, and exactly where the body moves affinely. A vertex that lies so far beside its carriers that its
/// weights would exceed kMostWeight has up to forty of them. Where these are not enough, it follows a cluster for the
/// rest. Directions that the carriers hardly span, as in thin sheets and crumbs, follow a cluster of the nearest one.
///
/// The embedded vertices of a piece keep their carriers where all of them are in the piece. Those that have enough
/// carriers left get weights for these. `embedded` says which embedded vertex of the parent a vertex was (kNoIndex:
/// none), `renumbered` what number the parent's particles have in the piece (kNoIndex: they are not in it), and `start`
/// which particle of the piece is near a new vertex (kNoIndex: it is searched for).
struct InheritedBinding {
  const SurfaceBinding& parent;
  std::vector<Index> embedded;
  const std::vector<Index>& renumbered;
  std::vector<Index> start;  // of each vertex; may be empty
  /// True where a wound face lies between a vertex and a particle: the vertex does not follow it. May be empty.
  std::function<bool(Index vertex, Index particle)> separated;
};
SurfaceBinding bindSurface(const Points& rest, const ParticleGraph& graph, const ClusterSet& clusters,
                           const Points& surface_rest, std::vector<Index> vertex_particle,
                           const InheritedBinding* inherited = nullptr);

/// Where the carriers of embedded vertex r have it, without its offset [m]. The poses of lever_clusters must fit
/// positions.
inline Vec3 embeddedPosition(const SurfaceBinding& binding, const Points& positions,
                             const std::vector<ClusterPose>& poses, Index r) {
  Vec3 sum = Vec3::Zero();
  for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k)
    sum += binding.weights[k] * positions[binding.carriers[k]];
  if (!binding.levers[r].isZero(0.0)) sum += poses[binding.turners[r]].deformation * binding.levers[r];
  return sum;
}

/// The same by at most eight carriers a vertex: those that carry most, with weights that leave it where it is wherever
/// the body moves affinely (moving least squares of degree one, about the weights that they had). Where eight lie in a
/// plane, all stay. For contact, which asks how a vertex moves in every substep, and wants no smooth surface.
SurfaceBinding fewerCarriers(const SurfaceBinding& binding, const Points& rest, double spacing);

/// Where the carriers have the vertices, without levers [m].
void carriedPlaces(const SurfaceBinding& binding, const Points& positions, Points& places);

/// What pulls at vertices, as what pulls at the particles that they follow: adds it. Without levers it has the same
/// force and torque.
void addToParticles(const SurfaceBinding& binding, const Points& of_vertices, Points& of_particles);

/// Where contact takes the vertices of model.collision to be, which must be there [m].
Points collisionPlaces(const BodyModel& model, const Points& positions);

}  // namespace meshless
