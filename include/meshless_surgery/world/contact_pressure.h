// How hard hands press on the surface of a body, for who looks at it.
#pragma once

#include <vector>

#include "meshless_surgery/world/world.h"

namespace meshless {

/// [Pa] one a vertex of the body's surface, of instruments and of the push sphere: times the areas around the vertices
/// it adds up to the forces of the contact points, each of which is spread over one particle spacing. Empty: nothing
/// presses. Needs surfaces and contacts in the snapshot.
std::vector<float> contactPressure(const WorldSnapshot& snapshot, const BodySnapshot& body);

}  // namespace meshless
