#include "drive/energy_law.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "drive/depth_law.h"
#include "drive/words.h"

namespace meshless {
namespace {

struct Second {
  std::map<std::string, double> energy;  // [m^2/s^2] largest of each piece
  double fastest = 0.0;                  // [m/s]
};

}  // namespace

AloneLook alone(const Seen& seen) {
  AloneLook look;
  look.time = seen.time;
  const double g = seen.gravity.norm();
  for (const SeenBody& body : seen.bodies)
    look.pieces.push_back({body.name, body.speed(), g > 0.0 ? -seen.gravity.dot(body.centre) / g : 0.0, body.diagonal});
  return look;
}

Finding energyLaw(const std::vector<AloneLook>& looks, double gravity) {
  Finding worst;
  std::vector<Second> seconds;
  for (const AloneLook& look : looks) {
    const std::size_t number = static_cast<std::size_t>(look.time - looks.front().time + 1e-9);
    if (number >= seconds.size()) seconds.resize(number + 1);
    Second& second = seconds[number];
    for (const Motion& piece : look.pieces) {
      const double energy = 0.5 * piece.speed * piece.speed + gravity * piece.height;
      const auto [entry, is_new] = second.energy.emplace(piece.name, energy);
      if (!is_new) entry->second = std::max(entry->second, energy);
      second.fastest = std::max(second.fastest, piece.speed);
      if (number == 0) continue;
      const auto before = seconds[number - 1].energy.find(piece.name);
      if (before == seconds[number - 1].energy.end()) continue;
      const double fastest = seconds[number - 1].fastest;
      const double allowed = gravity * allowedDepth(piece.diagonal) + 2.0 * fastest * fastest;
      // Without gravity and motion, rounding's.
      worst.take((energy - before->second) / (allowed + 1e-8),
                 words(piece.name, " at ", look.time, " s has ", energy - before->second, " J/kg more than before"));
    }
  }
  return worst;
}

}  // namespace meshless
