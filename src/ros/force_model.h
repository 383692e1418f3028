// The force on a tool between the steps that measure it: a local model of what the tool touches. Times are of a clock
// that the caller reads [s].
#pragma once

#include <cstdint>
#include <optional>

#include "meshless_surgery/base/types.h"
#include "step_hold.h"

namespace meshless {

/// Steps come late and seldom; the force follows the hand's own motion at once. It is the steps' own in a straight line
/// from one to the next, and before it what a spring adds for the way that the hand is ahead of the tool in those
/// steps. The spring is as stiff as the last steps were along the hand's way (secant), at most as the tool says.
///
/// What is reported ahead of the steps is taken off later (time constant of two steps): the sum over a touch stays that
/// of the steps.
/// Exactly zero a step after a tool that only pushes is free, and five steps after a spring was let go. On a tool that
/// only pushes the force is changed along itself and keeps its sign: nothing ever pulls.
class ForceModel {
 public:
  struct Step {
    bool there = false;
    std::uint32_t id = 0;       // another one is another touch
    bool pulls = false;         // a spring holds the tissue; else it only pushes
    Vec3 force = Vec3::Zero();  // [N] on the tool, mean over the step
    Vec3 place = Vec3::Zero();  // [m] of the tool in the step
    double stiffest = 0.0;      // [N/m]
    double speed = 0.0;         // [m/s] that the tool has at most; 0: it is placed, and nothing is foreseen
  };

  /// `dt` [s] is what the step simulated; 0 where the world changed without one: then only what came or went is news.
  void stepped(const Step& step, double dt, double now);
  /// The force on the tool [N]; `hand` [m] is where its stream wants it, if one moves it. Times must not go back.
  Vec3 at(double now, const std::optional<Vec3>& hand);
  bool isZero(double now) const;

 private:
  void fade(double since);
  void learn(const Vec3& force_change, const Vec3& way);

  Step step_;
  double dt_ = 0.0, stepped_at_ = 0.0, asked_at_ = 0.0;
  std::optional<double> leaves_;  // when the tool, which is gone, begins to fade [s]
  double fades_from_ = 0.0;       // [N] that is paid back at most while it fades
  StepHold<Vec3> force_{Vec3::Zero()};
  StepHold<Vec3> place_{Vec3::Zero()};
  StepHold<double> stiffness_{0.0};        // [N/m]
  StepHold<double> share_{0.0};            // of the model: 0 without the tool
  double work_ = 0.0, way_squared_ = 0.0;  // of the last steps: -force change times way, and way squared
  bool learned_ = false;
  Vec3 offset_ = Vec3::Zero();  // [m] smoothed, of the hand before the tool
  Vec3 ahead_ = Vec3::Zero();   // [N s] that was reported beyond the steps' own
};

}  // namespace meshless
