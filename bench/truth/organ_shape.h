// The lobed organ: a smooth map of the cube [-1, 1]^3, from which meshes of any resolution and the surface are made.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "law.h"

namespace meshless::truth {

constexpr double kOrganHalfLength = 0.08;       // [m] along x
constexpr double kOrganFixedParameter = -0.65;  // the first parameter of the plane that the organ is held at
constexpr double kOrganFixedBelow = kOrganHalfLength * kOrganFixedParameter;  // [m] rest x of that plane

/// Rest position of a point of the cube. The cube's edges become blunt margins; the plane of the first parameter
/// kOrganFixedParameter becomes the plane x = kOrganFixedBelow, so that a mesh can end exactly there.
Vec3 organPoint(const Vec3& parameter);

struct Surface {
  std::vector<Vec3> vertices;
  std::vector<std::array<int, 3>> triangles;  // counter-clockwise seen from outside
};

/// Closed; its vertices lie on the organ's surface. 12 n^2 triangles.
Surface organSurface(int n);
double enclosedVolume(const Surface& surface);
/// False where it cannot be written.
bool writeObj(const Surface& surface, const std::string& comment, const std::string& path);

}  // namespace meshless::truth
