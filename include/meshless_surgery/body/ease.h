// A cut takes forces away at once, and another material has others. What has changed comes little by little.
#pragma once

#include "meshless_surgery/body/cut_body.h"

namespace meshless {

/// [s] until nothing is left of what easeRelease() holds back.
constexpr double kEaseTime = 0.15;

/// Lets the particles of the pieces be accelerated in the next substep of h [s] as they were in the uncut body
/// `before`; what the cut changes comes within kEaseTime. Of a piece that moves freely the force and the torque across
/// the cut are released at once, as a rigid acceleration: what is eased has neither, so that its momentum is its own
/// alone and nothing throws it. Of one that has fixed particles, or one of the parent's particles in `held`, they are
/// eased too.
void easeRelease(const BodyModel& parent, const BodyState& before, const Material& material, double h,
                 const std::vector<Index>& held, std::vector<BodyPiece>& pieces);

/// For BodyState::stiffened, once a body that was `before` of the `old` material is `model` of another one: the share
/// of its stiffness with which it pulls as hard as until now, at most 1. All of it at once would give strained tissue
/// energy. h: the last substep [s].
double stiffenedBy(const BodyModel& before, const Material& old, const BodyModel& model, const Material& material,
                   double h, const BodyState& state);

/// 1 at once after the cut, falling slowly at first, 0 after kEaseTime.
double easedShare(double eased_for);

}  // namespace meshless
