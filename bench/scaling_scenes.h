// Worlds of a chosen size: an organ of so many particles, cells or triangles on the ground, and cubes beside each
// other.
#pragma once

#include <functional>
#include <memory>

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/world/world.h"

namespace meshless::bench {

using BodyPtr = std::shared_ptr<const PreparedBody>;

/// elastic_liver of config/materials/elastic.yaml.
Material elasticLiver();

/// A random organ of 0.2 m just above the ground; spacing 0: what the package chooses. Null where it is refused.
BodyPtr makeOrgan(std::size_t triangles, double spacing);

/// The same of the spacing that gives about so many (within 5 %) of what `count` counts: particles or cells.
BodyPtr makeOrganOf(std::size_t wanted, const std::function<std::size_t(const BodyModel&)>& count);
std::size_t particlesOf(const BodyModel& model);
std::size_t cellsOf(const BodyModel& model);

/// The defaults but for these two.
World makeWorld(int threads, bool sleep);
World worldWith(const BodyPtr& body, int threads, bool sleep);

/// Cubes of 0.1 m and 27 particles on the ground, half of that apart, that never sleep: of elastic_liver, or of the
/// default material in one cluster.
World worldOfCubes(int count, bool elastic, int threads);

}  // namespace meshless::bench
