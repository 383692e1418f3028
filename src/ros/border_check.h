// Checks at the border: what messages bring, before it becomes a command. The first fault is kept, as a sentence that
// names the field, its value and what would be accepted.
#pragma once

#include <optional>

#include <geometry_msgs/Point.h>
#include <geometry_msgs/Pose.h>
#include <geometry_msgs/Vector3.h>

#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/tools/command.h"

namespace meshless {

constexpr double kMaxCoordinate = 1e6;  // [m] of any position: beyond it doubles lose the tissue's digits
constexpr double kMaxSaid = 1e9;        // [m] of any position as it is said: frames of maps begin far away
constexpr double kMaxLength = 1e3;      // [m] of any size or reach
constexpr double kMinQuaternionNorm = 1e-6;

class BorderCheck {
 public:
  /// finite and min <= value <= max; unit is for the sentence ("m", "s", empty).
  double number(const std::string& field, double value, double min, double max, const std::string& unit);
  Vec3 point(const std::string& field, const geometry_msgs::Point& value);
  /// [m] In the world: what was said in that frame.
  Vec3 place(const std::string& field, const Pose& frame, const Vec3& said);
  /// A direction: any finite vector, zero too.
  Vec3 direction(const std::string& field, const geometry_msgs::Vector3& value);
  /// Normalised; all zeros were left out and are the identity. Another norm below kMinQuaternionNorm is a fault.
  Quat rotation(const std::string& field, const geometry_msgs::Quaternion& value);
  Pose pose(const std::string& field, const geometry_msgs::Pose& value);
  /// A name for a new body: letters, digits and _ - . only, at most 100 characters.
  std::string newName(const std::string& field, const std::string& value);
  /// Names of bodies that should exist: at most 100 characters each, none empty.
  std::vector<std::string> names(const std::string& field, const std::vector<std::string>& value);

  void fault(const std::string& sentence);
  bool ok() const { return !error_.has_value(); }
  const Error& error() const { return *error_; }

 private:
  std::optional<Error> error_;
};

constexpr std::size_t kMaxName = 100;      // bytes of a name
constexpr std::size_t kMaxNames = 100000;  // in a list
/// For messages to people: control characters and what is no UTF-8 replaced, cut before `most` bytes are exceeded.
std::string printable(const std::string& text, std::size_t most = kMaxName);

}  // namespace meshless
