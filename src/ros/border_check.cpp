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
    fault(field + " is " + numberText(value) + "; accepted: " + numberText(min) + ".." + numberText(max) +
          (unit.empty() ? "" : " " + unit));
  }
  return value;
}

Vec3 BorderCheck::point(const std::string& field, const geometry_msgs::Point& value) {
  number(field + ".x", value.x, -kMaxCoordinate, kMaxCoordinate, "m");
  number(field + ".y", value.y, -kMaxCoordinate, kMaxCoordinate, "m");
  number(field + ".z", value.z, -kMaxCoordinate, kMaxCoordinate, "m");
  return {value.x, value.y, value.z};
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
