#include "organ_shape.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <map>

namespace meshless::truth {
namespace {

constexpr double kRoundness = 0.7;    // 0: a box; 1: a ball, whose map is singular along the cube's edges
constexpr double kHalfWidth = 0.052;  // [m] along y
constexpr double kHalfThickness = 0.032;
constexpr double kFissureAt = 0.25;  // of the half length; the small lobe lies beyond
constexpr double kFissureWidth = 0.2;
constexpr double kFissureDepth = 0.42;  // of the width, on the side of +y
constexpr double kWaist = 0.2;          // thinning of the thickness at the fissure
constexpr double kHollow = 0.012;       // [m] the sides in y lie so much higher than the middle

double roundOff(double a, double b) {
  return std::sqrt(1.0 - kRoundness * (0.5 * (a * a + b * b) - a * a * b * b / 3.0));
}

}  // namespace

Vec3 organPoint(const Vec3& p) {
  // The cube's map to a ball, softened; along x scaled about the fixed plane, which so stays plane.
  const double x = kOrganFixedParameter + (p.x() - kOrganFixedParameter) * roundOff(p.y(), p.z());
  const double y = p.y() * roundOff(p.x(), p.z());
  const double z = p.z() * roundOff(p.x(), p.y());

  const double from_fissure = (x - kFissureAt) / kFissureWidth;
  const double fissure = std::exp(-from_fissure * from_fissure);
  const double width = kHalfWidth * y * (1.0 - kFissureDepth * fissure * 0.5 * (1.0 + y));
  const double thickness = kHalfThickness * z * (1.0 - kWaist * fissure);
  return {kOrganHalfLength * x, width, thickness + kHollow * y * y};
}

Surface organSurface(int n) {
  Surface surface;
  std::map<std::array<int, 3>, int> index_of;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [entry, is_new] = index_of.emplace(at, static_cast<int>(surface.vertices.size()));
    if (is_new) {
      // Equal angles rather than equal steps: the map squeezes what is next to the cube's edges.
      Vec3 parameter;
      for (int axis = 0; axis < 3; ++axis) {
        parameter[axis] = std::tan(std::atan(1.0) * (2.0 * at[axis] / n - 1.0));
      }
      surface.vertices.push_back(organPoint(parameter));
    }
    return entry->second;
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      for (int a = 0; a < n; ++a) {
        for (int b = 0; b < n; ++b) {
          const auto corner = [&](int da, int db) {
            std::array<int, 3> at;
            at[axis] = side * n;
            at[(axis + 1) % 3] = a + da;
            at[(axis + 2) % 3] = b + db;
            return vertex(at);
          };
          std::array<int, 4> quad{corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)};
          if (side == 0) {
            std::swap(quad[1], quad[3]);
          }
          // The shorter diagonal.
          const auto& v = surface.vertices;
          if ((v[quad[0]] - v[quad[2]]).squaredNorm() <= (v[quad[1]] - v[quad[3]]).squaredNorm()) {
            surface.triangles.push_back({quad[0], quad[1], quad[2]});
            surface.triangles.push_back({quad[0], quad[2], quad[3]});
          } else {
            surface.triangles.push_back({quad[0], quad[1], quad[3]});
            surface.triangles.push_back({quad[1], quad[2], quad[3]});
          }
        }
      }
    }
  }
  return surface;
}

double enclosedVolume(const Surface& surface) {
  double sum = 0.0;
  for (const auto& t : surface.triangles) {
    sum += surface.vertices[t[0]].dot(surface.vertices[t[1]].cross(surface.vertices[t[2]])) / 6.0;
  }
  return sum;
}

bool writeObj(const Surface& surface, const std::string& comment, const std::string& path) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) {
    return false;
  }
  std::fprintf(file, "# %s\n", comment.c_str());
  for (const Vec3& v : surface.vertices) {
    std::fprintf(file, "v %.7f %.7f %.7f\n", v.x(), v.y(), v.z());
  }
  for (const auto& t : surface.triangles) {
    std::fprintf(file, "f %d %d %d\n", t[0] + 1, t[1] + 1, t[2] + 1);
  }
  return std::fclose(file) == 0;
}

}  // namespace meshless::truth
