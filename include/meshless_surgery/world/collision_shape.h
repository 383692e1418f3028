// What contact takes for the surface of a body of a snapshot.
#pragma once

#include "meshless_surgery/world/world.h"

namespace meshless {

/// Present places of the vertices of model->collision, which must be there [m]. Needs a snapshot with particles.
Points collisionShape(const BodySnapshot& body);

}  // namespace meshless
