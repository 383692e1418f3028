#include "meshless_surgery/world/collision_shape.h"

#include "meshless_surgery/body/binding.h"

namespace meshless {

Points collisionShape(const BodySnapshot& body) { return collisionPlaces(*body.model, body.particles); }

}  // namespace meshless
