// Scalar and array types that every room shares. Units are SI, frames right-handed.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace meshless {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Quat = Eigen::Quaterniond;

using Index = std::uint32_t;
constexpr Index kNoIndex = 0xffffffffu;

using Points = std::vector<Vec3>;
using Triangle = std::array<Index, 3>;
using Tetrahedron = std::array<Index, 4>;

/// Rigid motion p -> rotation * p + translation [m].
struct Pose {
  Quat rotation = Quat::Identity();
  Vec3 translation = Vec3::Zero();

  Vec3 operator*(const Vec3& p) const { return rotation * p + translation; }
};

/// Axis-aligned box [m]; empty while min > max.
struct Box {
  Vec3 min = Vec3::Constant(1e300);
  Vec3 max = Vec3::Constant(-1e300);

  bool empty() const { return !(min.array() <= max.array()).all(); }
  void extend(const Vec3& p) {
    min = min.cwiseMin(p);
    max = max.cwiseMax(p);
  }
  bool contains(const Vec3& p) const { return (p.array() >= min.array()).all() && (p.array() <= max.array()).all(); }
  bool overlaps(const Box& o) const { return (min.array() <= o.max.array()).all() && (o.min.array() <= max.array()).all(); }
  /// Length of the diagonal [m]; 0 when empty.
  double diagonal() const { return empty() ? 0.0 : (max - min).norm(); }
};

/// Colour, each channel 0..1.
struct Color {
  float r = 0.8f, g = 0.8f, b = 0.8f, a = 1.0f;
};

}  // namespace meshless
