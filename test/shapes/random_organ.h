// Organ-like surfaces that nobody drew: random implicit shapes, for tests and for random scenes.
#pragma once

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// Two to five ellipsoids blended into each other, uneven, with `genus` rings as handles: closed, embedded, in one
/// piece, oriented outwards, centred at the origin, the longest edge of its bounds `size` [m]. It has about `triangles`
/// triangles, more where so few would not show its topology. The same arguments give the same mesh. Refuses
/// (kInvalidArgument) a genus outside 0..3, a size outside 1e-3..10 m, triangles outside 100..200,000; (kFailed) where
/// none of 400 tries has the genus.
Result<TriangleMesh> randomOrgan(std::uint64_t seed, int genus, double size, std::size_t triangles);

/// Genus of a closed surface in one piece, from Euler's characteristic.
int genusOf(const TriangleMesh& mesh);

}  // namespace meshless
