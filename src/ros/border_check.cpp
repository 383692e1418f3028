#include "meshless_surgery/ros/border_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace meshless {

std::string formatNumber(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value > 0.0 ? "inf" : "-inf";
  char text[32];
  std::snprintf(text, sizeof(text), "%.6g", value);
  return text;
}

namespace {

/// Bytes of the UTF-8 character that begins there; 0 where none does: Unicode's table 3-7.
std::size_t characterAt(const std::string& text, std::size_t at) {
  const auto byte = [&](std::size_t k) { return at + k < text.size() ? static_cast<unsigned char>(text[at + k]) : 0u; };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  std::size_t length = 0;
  if (first >= 0xc2 && first < 0xe0) length = 2;
  if (first >= 0xe0 && first < 0xf0) length = 3;
  if (first >= 0xf0 && first < 0xf5) length = 4;
  for (std::size_t k = 1; k < length; ++k)
    if ((byte(k) & 0xc0) != 0x80) return 0;
  // Neither longer than need be, nor half of a pair, nor beyond U+10FFFF.
  if ((first == 0xe0 && byte(1) < 0xa0) || (first == 0xed && byte(1) >= 0xa0) || (first == 0xf0 && byte(1) < 0x90) ||
      (first == 0xf4 && byte(1) >= 0x90))
    return 0;
  return length;
}

}  // namespace

std::string printable(const std::string& text, std::size_t most) {
  std::string shown;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t length = characterAt(text, at);
    if (at + std::max<std::size_t>(length, 1) > most) return shown + "...";
    if (length == 0 || static_cast<unsigned char>(text[at]) < 0x20 || text[at] == 0x7f)
      shown += '?';
    else
      shown.append(text, at, length);
    at += std::max<std::size_t>(length, 1);
  }
  return shown;
}

void BorderCheck::fault(const std::string& sentence) {
  if (!error_) error_ = Error{ErrorCode::kInvalidArgument, sentence};
}

double BorderCheck::number(const std::string& field, double value, double min, double max, const std::string& unit) {
  if (!(value >= min && value <= max)) {
    fault(field + " is " + formatNumber(value) + "; accepted: " + formatNumber(min) + ".." + formatNumber(max) +
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
  const double norm = rotation.norm();
  if (!(norm >= kMinQuaternionNorm && std::isfinite(norm))) {
    fault(field + " has the norm " + formatNumber(norm) + "; accepted: a quaternion x y z w of a norm of at least " +
          formatNumber(kMinQuaternionNorm) + ", such as 0 0 0 1");
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

Pose BorderCheck::pointPose(const std::string& field, const geometry_msgs::Pose& value) {
  const auto& q = value.orientation;
  if (q.x == 0.0 && q.y == 0.0 && q.z == 0.0 && q.w == 0.0) {
    Pose unturned;
    unturned.translation = point(field + ".position", value.position);
    return unturned;
  }
  return pose(field, value);
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
