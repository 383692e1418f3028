// How a streamed tool goes where its stream says: never back in time, no faster than its bound, and only as long as the
// stream speaks. Times are of a clock that the caller reads [s].
#pragma once

#include <optional>

#include "stamp_order.h"
#include "meshless_surgery/tools/command.h"

namespace meshless {

class ToolMotion {
 public:
  /// [s] of movement and of silence that one call makes up for at most: who comes late neither jumps nor was silent.
  static constexpr double kLongestTick = 0.05;

  struct Limits {
    double speed = 5.0;        // [m/s]
    double turn_speed = 50.0;  // [rad/s]
    double silence = 0.5;      // [s]; 0: it may be silent for ever
  };

  explicit ToolMotion(const Limits& limits) : limits_(limits) {}

  /// What the stream said. `stamp` is its own [s], 0 where it has none. Refused kInvalidArgument where it is late, as
  /// StampOrder says; the stream lives all the same. The first pose after a silence is taken at once.
  Status hear(const Pose& wanted, double stamp, double now);
  /// How far the last pose is from the one before, and after what time: by their stamps, where both have some and they
  /// grow, else by when they were heard.
  struct Way {
    double length = 0.0;  // [m]
    double time = 0.0;    // [s]
  };
  const Way& way() const { return way_; }
  /// Another sign of life of the same tool, such as its jaw's.
  void keepAlive(double now);
  /// True once the silence has lasted: the tool is to be lifted. Once only; hear() begins anew. To be asked all the
  /// time: who asks late was held up itself, and what the stream said is still on its way to hear().
  bool fellSilent(double now);
  bool alive() const { return alive_; }
  bool arrived() const { return arrived_; }
  const Pose& wanted() const { return wanted_; }
  const Pose& pose() const { return pose_; }

  /// Moves pose() towards wanted() for the time since the last call.
  void advance(double now);
  /// It stays there: what the stream wanted is forgotten.
  void halt(const Vec3& place);
  /// As once the silence has lasted.
  void end();
  /// It is elsewhere: another pick was taken into the hand.
  void putAt(const Vec3& place);

 private:
  Limits limits_;
  Pose wanted_, pose_;
  StampOrder order_;
  Way way_;
  double stamp_ = 0.0, heard_ = 0.0, looked_ = 0.0, silent_ = 0.0, advanced_ = 0.0;
  bool alive_ = false;
  bool arrived_ = true;
};

}  // namespace meshless
