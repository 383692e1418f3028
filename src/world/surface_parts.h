// A body's surface in parts of about an edge: what a fibre stands for, or a share of a force.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "shown_surface.h"

namespace meshless {

constexpr double kLongFace = 2.0;      // edges of contact: longer faces are divided
constexpr double kMostParts = 100.0;   // of a face's edge
constexpr double kMostSamples = 2e5;   // of faces that are divided

/// What lies in a cube of an edge: surfaces may be much finer, or coarser, than the tissue is.
struct SurfacePart {
  double area = 0.0;                          // [m^2]
  std::vector<std::pair<Index, Vec3>> faces;  // and their corners' areas [m^2]
  Vec3 middle = Vec3::Zero();                 // [m]
  Index fibre = kNoIndex;
};
using SurfaceCube = std::array<long long, 3>;

/// The middles of n^2 equal parts of a triangle, as shares of its corners.
template <class Visit>
void eachPart(int n, const Visit& visit) {
  const auto put = [&](double x, double y) { visit(Vec3(1.0 - (x + y) / n, x / n, y / n)); };
  for (int i = 0; i < n; ++i)
    for (int j = 0; i + j < n; ++j) {
      put(i + 1.0 / 3.0, j + 1.0 / 3.0);
      if (i + j + 1 < n) put(i + 2.0 / 3.0, j + 2.0 / 3.0);
    }
}

/// Of samples of a surface that are wanted(place [m], face, area [m^2] along its normal), in cubes of that edge [m].
/// piecesOf(face, its longest edge [m]): into how many pieces an edge of it is divided.
template <class Pieces, class Wanted>
std::map<SurfaceCube, SurfacePart> surfaceParts(const ShownSurface& of, double edge, const Pieces& piecesOf,
                                                const Wanted& wanted) {
  std::vector<double> divided(of.surface->triangles.size());  // parts of an edge of each face
  double all = 0.0;
  for (Index face = 0; face < divided.size(); ++face) {
    double longest = 0.0;
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, (of.corner(face, (k + 1) % 3) - of.corner(face, k)).norm());
    divided[face] = std::clamp(std::ceil(piecesOf(face, longest)), 1.0, kMostParts);
    all += divided[face] * divided[face];
  }
  const double fewer = std::min(1.0, std::sqrt(kMostSamples / all));
  std::map<SurfaceCube, SurfacePart> parts;
  for (Index face = 0; face < divided.size(); ++face) {
    const int n = static_cast<int>(std::max(1.0, fewer * divided[face]));
    const Vec3 area = of.areaOf(face) / (n * n);
    eachPart(n, [&](const Vec3& shares) {
      const Vec3 p = of.at(face, shares);
      if (!wanted(p, face, area)) return;
      SurfaceCube cube;
      for (int k = 0; k < 3; ++k) cube[k] = std::llround(std::floor(p[k] / edge));
      SurfacePart& part = parts[cube];
      part.area += area.norm();
      part.faces.push_back({face, area.norm() * shares});
    });
  }
  for (auto part = parts.begin(); part != parts.end();)
    part = part->second.area > 0.0 ? std::next(part) : parts.erase(part);
  return parts;
}

/// The mean of a part; fills in its middle.
inline BodyPoint pointOf(SurfacePart& part, const ShownSurface& of) {
  PointMaker maker(of.surface->supports);
  for (const auto& [face, shares] : part.faces) {
    for (int k = 0; k < 3; ++k) maker.add(of.surface->triangles[face][k], shares[k]);
    part.middle += of.at(face, shares) / part.area;
  }
  return maker.make();
}

}  // namespace meshless
