#include "drive/supports.h"

#include <cmath>

namespace meshless {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// A profile of (radius, height), counter-clockwise with the outside on its right, turned about z. The first and the
/// last point are on the axis.
TriangleMesh turned(const std::vector<Vec2>& profile, int around, double start_angle) {
  TriangleMesh mesh;
  const Index rings = static_cast<Index>(profile.size()) - 2, count = static_cast<Index>(around);
  mesh.vertices.push_back(Vec3(0.0, 0.0, profile.front().y()));
  for (Index r = 1; r <= rings; ++r)
    for (Index k = 0; k < count; ++k) {
      const double angle = start_angle + 2.0 * kPi * k / around;
      mesh.vertices.push_back(Vec3(profile[r].x() * std::cos(angle), profile[r].x() * std::sin(angle), profile[r].y()));
    }
  mesh.vertices.push_back(Vec3(0.0, 0.0, profile.back().y()));
  const Index last = static_cast<Index>(mesh.vertices.size()) - 1;
  const auto at = [&](Index ring, Index k) { return 1 + ring * count + k % count; };
  for (Index k = 0; k < count; ++k) {
    mesh.triangles.push_back({0, at(0, k + 1), at(0, k)});
    for (Index r = 0; r + 1 < rings; ++r) {
      mesh.triangles.push_back({at(r, k), at(r, k + 1), at(r + 1, k + 1)});
      mesh.triangles.push_back({at(r, k), at(r + 1, k + 1), at(r + 1, k)});
    }
    mesh.triangles.push_back({last, at(rings - 1, k), at(rings - 1, k + 1)});
  }
  return mesh;
}

}  // namespace

TriangleMesh bowlMesh(double radius, double depth, double wall) {
  constexpr int kArc = 12, kAround = 40;
  // Outside from the bottom up to the rim, inside back down.
  std::vector<Vec2> profile{{0.0, 0.0}};
  const double centre = radius + wall, open = std::acos(1.0 - depth / radius);
  for (int k = 1; k <= kArc; ++k) {
    const double angle = open * k / kArc;
    profile.push_back({(radius + wall) * std::sin(angle), centre - (radius + wall) * std::cos(angle)});
  }
  for (int k = kArc; k >= 1; --k) {
    const double angle = open * k / kArc;
    profile.push_back({radius * std::sin(angle), centre - radius * std::cos(angle)});
  }
  profile.push_back({0.0, wall});
  return turned(profile, kAround, 0.0);
}

TriangleMesh trayMesh(double half_width, double rim, double wall) {
  const double corner = std::sqrt(2.0);
  return turned({{0.0, 0.0},
                 {corner * (half_width + wall), 0.0},
                 {corner * (half_width + wall), wall + rim},
                 {corner * half_width, wall + rim},
                 {corner * half_width, wall},
                 {0.0, wall}},
                4, 0.25 * kPi);
}

}  // namespace meshless
