// How the vertices of a surface follow the particles.
#pragma once

#include "meshless_surgery/body/body.h"

namespace meshless {

/// Binds a surface whose vertex v is particle vertex_particle[v], or rides where that is kNoIndex: a rider follows the
/// clusters of the particles nearest to it at rest, at most three, and is exact where the body moves affinely.
SurfaceBinding bindSurface(const Points& rest, const std::vector<double>& masses, const ClusterSet& clusters,
                           const RestShape& shape, const Points& surface_rest, std::vector<Index> vertex_particle);

/// Where rider r of the binding is by its clusters, without its offset [m].
Vec3 riderPosition(const BodyModel& model, const std::vector<ClusterPose>& poses, Index r);

}  // namespace meshless
