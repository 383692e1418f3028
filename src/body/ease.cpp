#include "meshless_surgery/body/ease.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/body/deform.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr double kNothing = 1e-9;     // of the spacing that a particle would move in a substep: not worth easing
constexpr double kLeastShare = 1e-5;  // of its stiffness that a body has, whatever it was before
constexpr double kAtOnce = 0.99;      // so much of it may come at once

// [m/s^2] of every particle by what the body does to itself.
Points ownAccelerations(const BodyModel& model, BodyState state, const Material& material, double h) {
  StepScratch scratch;
  MatchCounters uncounted;
  state.cavities.clear();  // what fills them goes on
  Points accelerations = state.velocities;
  matchAndMove(model, material, Vec3::Zero(), h, state, scratch, uncounted);
  for (std::size_t i = 0; i < accelerations.size(); ++i)
    accelerations[i] = (state.velocities[i] - accelerations[i]) / h;
  return accelerations;
}

}  // namespace

void easeRelease(const BodyModel& parent, const BodyState& before, const Material& material, double h,
                 const std::vector<Index>& held, std::vector<BodyPiece>& pieces) {
  if (!(h > 0.0) || parent.lattice) return;  // what is left of filled cells pulls as before but for what was cut
  // The uncut body first: together the pieces are as much.
  Points whole;
  std::vector<Points> parts(pieces.size());
  inChunks(pieces.size() + 1, 1, [&](std::size_t n, std::size_t) {
    if (n == 0)
      whole = ownAccelerations(parent, before, material, h);
    else
      parts[n - 1] = ownAccelerations(*pieces[n - 1].model, pieces[n - 1].state, material, h);
  });
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    BodyPiece& piece = pieces[p];
    const BodyModel& model = *piece.model;
    Points& eased = parts[p];
    for (std::size_t i = 0; i < eased.size(); ++i) {
      const Index old = piece.parent_particles[i];
      // A crumb's one particle has nothing to ease.
      eased[i] = old == kNoIndex || model.fixed[i] ? Vec3(Vec3::Zero()) : Vec3(whole[old] - eased[i]);
    }
    const auto& mine = piece.parent_particles;
    const bool is_held = model.any_fixed || std::any_of(held.begin(), held.end(), [&](Index i) {
                           return std::find(mine.begin(), mine.end(), i) != mine.end();
                         });
    if (!is_held) {
      const RigidMotion released = rigidMotionOf(model, piece.state.positions, eased);
      for (std::size_t i = 0; i < eased.size(); ++i)
        eased[i] -= released.velocity + released.spin.cross(piece.state.positions[i] - released.centre);
    }
    double most = 0.0;
    for (const Vec3& a : eased) most = std::max(most, a.norm());
    if (!(h * h * most > kNothing * model.spacing)) continue;
    piece.state.eased = std::move(eased);
    piece.state.eased_for = 0.0;
    piece.state.eased_whole = is_held;
  }
}

double stiffenedBy(const BodyModel& before, const Material& old, const BodyModel& model, const Material& material,
                   double h, const BodyState& state) {
  BodyState still = state;
  for (Vec3& v : still.velocities) v.setZero();
  still.eased.clear();
  const auto pulls = [&](const BodyModel& of, const Material& made_of) {  // where nothing is slowed
    return ownAccelerations(of, still, made_of, std::min(h, longestSubstep(of, still)));
  };
  const Points then = pulls(before, old);
  still.stiffened = 1.0;
  const Points now = pulls(model, material);
  double common = 0.0, squared = 0.0, most = 0.0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (model.fixed[i]) continue;
    common += model.masses[i] * now[i].dot(then[i]);
    squared += model.masses[i] * now[i].squaredNorm();
    most = std::max(most, now[i].norm());
  }
  if (!(h * h * most > kNothing * model.spacing) || common > kAtOnce * squared) return 1.0;
  return std::max(kLeastShare, common / squared);
}

double easedShare(double eased_for) {
  return eased_for < kEaseTime ? 0.5 * (1.0 + std::cos(M_PI * eased_for / kEaseTime)) : 0.0;
}

}  // namespace meshless
