// Plasticity: what is strained beyond its yield takes a new rest shape (Mueller et al. 2005, sec. 4.5; in logarithms of
// the stretch, so that no step overshoots and the volume stays).
#pragma once

#include "meshless_surgery/dynamics/shape_matching.h"

namespace meshless {

/// Lets the rest shapes flow for the deformations in poses, as matchShapes() or elasticAccelerations() with the same
/// `shapes` left them, over h [s]. The part beyond the yield strain decays at the rate `creep`; a shape's stretch keeps
/// |U - 1| <= maximum and det U = 1. A pose's rotation becomes that of the new shape. `shapes` may be empty and is
/// filled when something flows for the first time. Clusters that do not span space (in `rest`; null where all do), or
/// are nearly flat or inverted, do not flow. Returns how many have flowed.
std::size_t flow(const Plasticity& plasticity, double h, const RestShape* rest, std::vector<ClusterPose>& poses,
                 std::vector<PlasticShape>& shapes);

/// The shape whose stretch has this logarithm: symmetric, without a trace.
PlasticShape plasticShape(const Mat3& logarithm);

}  // namespace meshless
