// The quadratic maps of a body's clusters, for contact.
#pragma once

#include "meshless_surgery/contact/contacts.h"
#include "meshless_surgery/dynamics/shape_matching.h"

namespace meshless {

/// Fits them to positions [m], for the clusters that have the rank for it, and makes `maps` (one a cluster, fitted)
/// point to them. `in` has had addQuadraticRest(). quadratics lives as long as maps do.
void fitQuadraticMaps(const MatchInput& in, const Vec3* positions, std::vector<ContactMap>& maps,
                      std::vector<QuadraticMap>& quadratics);

}  // namespace meshless
