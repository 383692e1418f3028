// How one hand has moved, summed up as it goes.
#pragma once

#include <deque>
#include <optional>

#include "meshless_surgery/base/types.h"

namespace meshless {

class HandMotion {
 public:
  /// A hand moves while it gets on by this within 0.1 s [m/s].
  static constexpr double kMoving = 0.005;

  /// Once a step of `dt` [s]; without a position: there is no such hand, and where it comes back is no way of it.
  void feed(const std::optional<Vec3>& position, const std::optional<Quat>& turned, double dt);

  /// Another hand comes in its place: from where the one was to where the other is, is no way.
  void leave(double dt) {
    if (last_) leaveAt(1.0 / dt);
  }
  /// There is no more: the present movement ends.
  void end(double dt);

  bool seen() const { return seen_for_ > 0.0; }
  bool moves() const { return moves_; }
  double path() const { return path_; }            // [m]
  double fastest() const { return fastest_; }      // [m/s] from one step to the next
  double angularPath() const { return turn_; }     // [rad]
  double movingFor() const { return moved_for_; }  // [s]
  std::size_t movements() const { return movements_; }

  // NaN where there is nothing to tell.
  double economy() const;
  double workspace() const;  // [m^3]
  double meanSpeed() const;  // [m/s]
  double sparc() const;
  double jerk() const;
  double tremor() const;  // [m]

 private:
  void endMovement(double rate);
  void leaveAt(double rate);

  double seen_for_ = 0.0, moved_for_ = 0.0, moved_path_ = 0.0, path_ = 0.0, fastest_ = 0.0, straight_ = 0.0,
         turn_ = 0.0;
  std::optional<Vec3> start_, last_;  // of the present way
  std::optional<Quat> last_turned_;
  std::deque<Vec3> lately_;  // of the last 0.1 s
  bool moves_ = false;
  std::size_t movements_ = 0;
  Points velocities_;  // of the present movement
  double smooth_for_ = 0.0, sparc_sum_ = 0.0, jerk_sum_ = 0.0, jerk_for_ = 0.0;
  // of all positions, from the first one
  Vec3 origin_ = Vec3::Zero(), sum_ = Vec3::Zero();
  Mat3 squares_ = Mat3::Zero();
  double count_ = 0.0;
  Points window_;
  double tremor_sum_ = 0.0, tremor_windows_ = 0.0;
};

}  // namespace meshless
