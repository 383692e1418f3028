#include "border_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <utf8.h>

namespace meshless {

std::string printable(const std::string& text, std::size_t most) {
  std::string shown = text.substr(0, most + 3);  // with all of the character in which it is cut
  for (auto at = shown.begin(); (at = utf8::find_invalid(at, shown.end())) != shown.end();) *at = '?';
  std::replace_if(
      shown.begin(), shown.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  if (text.size() <= most) return shown;
  while (most > 0 && (static_cast<unsigned char>(shown[most]) & 0xc0) == 0x80) --most;
  return shown.substr(0, most) + "...";
}

void BorderCheck::fault(const std::string& sentence) {
  if (!error_) error_ = Error{ErrorCode::kInvalidArgument, sentence};
}

double BorderCheck::number(const std::string& field, double value, double min, double max, const std::string& unit) {
  if (!(value >= min && value <= max)) {
    const std::string least = numberText(min), most = numberText(max);
    std::string said = numberText(value);
    if (said == least || said == most) said = numberText(value, 12);  // just outside
    fault(field + " is " + said + "; accepted: " + least + ".." + most + (unit.empty() ? "" : " " + unit));
  }
  return value;
}

namespace {

void checkEach(BorderCheck& check, const std::string& field, const Vec3& value, double most) {
  for (int axis = 0; axis < 3; ++axis)
    check.number(field + "." + std::string(1, "xyz"[axis]), value[axis], -most, most, "m");
}

}  // namespace

Vec3 BorderCheck::point(const std::string& field, const geometry_msgs::Point& value) {
  const Vec3 point(value.x, value.y, value.z);
  checkEach(*this, field, point, kMaxSaid);
  return point;
}

Vec3 BorderCheck::place(const std::string& field, const Pose& frame, const Vec3& said) {
  const Vec3 place = frame * said;
  checkEach(*this, "in the world frame, " + field, place, kMaxCoordinate);
  return place;
}

Vec3 BorderCheck::direction(const std::string& field, const geometry_msgs::Vector3& value) {
  number(field + ".x", value.x, -kMaxCoordinate, kMaxCoordinate, "");
  number(field + ".y", value.y, -kMaxCoordinate, kMaxCoordinate, "");
  number(field + ".z", value.z, -kMaxCoordinate, kMaxCoordinate, "");
  return {value.x, value.y, value.z};
}

Quat BorderCheck::rotation(const std::string& field, const geometry_msgs::Quaternion& value) {
  number(field + ".x", value.x, -kMaxCoordinate, kMaxCoordinate, "");
  number(field + ".y", value.y, -kMaxCoordinate, kMaxCoordinate, "");
  number(field + ".z", value.z, -kMaxCoordinate, kMaxCoordinate, "");
  number(field + ".w", value.w, -kMaxCoordinate, kMaxCoordinate, "");
  const Quat rotation(value.w, value.x, value.y, value.z);
  if (rotation.coeffs().isZero(0.0)) return Quat::Identity();
  const double norm = rotation.norm();
  if (!(norm >= kMinQuaternionNorm && std::isfinite(norm))) {
    fault(field + " has the norm " + numberText(norm) + "; accepted: a quaternion x y z w of a norm of at least " +
          numberText(kMinQuaternionNorm) + ", such as 0 0 0 1, or all zeros for it");
    return Quat::Identity();
  }
  return rotation.normalized();
}

Pose BorderCheck::pose(const std::string& field, const geometry_msgs::Pose& value) {
  Pose checked;
  checked.translation = point(field + ".position", value.position);
  checked.rotation = rotation(field + ".orientation", value.orientation);
  return checked;
}

std::string BorderCheck::newName(const std::string& field, const std::string& value) {
  const bool plain =
      value.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.") == std::string::npos;
  if (!plain || value.size() > kMaxName) {
    fault(field + " is '" + printable(value) + "'; accepted: letters, digits and _ - . only, at most " +
          std::to_string(kMaxName) + " of them");
  }
  return value;
}

std::vector<std::string> BorderCheck::names(const std::string& field, const std::vector<std::string>& value) {
  if (value.size() > kMaxNames) {
    fault(field + " has " + std::to_string(value.size()) + " names; accepted: up to " + std::to_string(kMaxNames));
    return value;
  }
  for (std::size_t i = 0; i < value.size(); ++i) {
    if (value[i].empty() || value[i].size() > kMaxName) {
      fault(field + "[" + std::to_string(i) + "] is '" + printable(value[i]) + "'; accepted: names of 1.." +
            std::to_string(kMaxName) + " characters");
    }
  }
  return value;
}

}  // namespace meshless
