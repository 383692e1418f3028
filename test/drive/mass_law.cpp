#include "drive/mass_law.h"

#include <cmath>

#include "drive/words.h"

namespace meshless {
namespace {

constexpr double kMassRounding = 1e-9;
constexpr double kVolumeMoved = 1e-3;  // cuts move vertices that are close to the blade onto it

}  // namespace

MassBooks booksOf(const Seen& seen) {
  MassBooks books;
  for (const SeenBody& body : seen.bodies) {
    books.mass[rootOf(body.name)] += body.mass;
    books.rest_volume[rootOf(body.name)] += body.rest_volume;
  }
  return books;
}

Finding massLaw(const MassBooks& start, const Seen& seen) {
  MassBooks now = booksOf(seen);
  Finding worst;
  for (const auto& [root, mass] : start.mass)
    worst.take(std::abs(now.mass[root] - mass) / (kMassRounding * mass),
               words("the pieces of ", root, " weigh ", now.mass[root] / mass - 1.0, " of it more"));
  for (const auto& [root, volume] : start.rest_volume)
    worst.take(std::abs(now.rest_volume[root] - volume) / (kVolumeMoved * volume),
               words("the rest volumes of ", root, "'s pieces are ", now.rest_volume[root] / volume - 1.0,
                     " of its own more"));
  for (const auto& [root, mass] : now.mass)
    if (!start.mass.count(root)) worst.take(2.0, root + " was not there at the start");
  return worst;
}

}  // namespace meshless
