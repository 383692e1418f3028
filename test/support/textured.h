// A cube each of whose sides has a part of its own of an image, in a colour of its own.
#pragma once

#include "meshless_surgery/appearance/look.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/geometry/mesh/texture_map.h"

namespace meshless::test {

/// 0..5, of the side that a normal points out of.
inline int sideOf(const Vec3& normal) {
  int axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  return 2 * axis + (normal[axis] > 0.0 ? 1 : 0);
}

inline Color colorOfSide(int side) {
  const auto bit = [side](int k) { return ((side + 1) >> k & 1) != 0 ? 1.0f : 0.0f; };
  return {bit(0), bit(1), bit(2), 1.0f};
}

/// Three parts wide and two high.
inline Look sixColors() {
  constexpr std::uint32_t kPart = 16;  // pixels
  std::vector<std::uint8_t> rgb;
  for (std::uint32_t y = 0; y < 2 * kPart; ++y)
    for (std::uint32_t x = 0; x < 3 * kPart; ++x) {
      const Color color = colorOfSide(static_cast<int>(x / kPart + 3 * (1 - y / kPart)));
      for (const float channel : {color.r, color.g, color.b}) rgb.push_back(channel > 0.5f ? 255 : 0);
    }
  Look look;
  look.noise = Noise::kImage;
  look.image = *Image::make(3 * kPart, 2 * kPart, std::move(rgb));
  return look;
}

struct TexturedCube {
  double size;  // [m]
  bool mirrored = false;
  TriangleMesh mesh;
  std::vector<TexturePoint> points;

  explicit TexturedCube(double edge, int squares = 3, bool mirror = false)
      : size(edge), mirrored(mirror), mesh(boxMesh(Vec3::Constant(edge), squares, squares, squares)) {
    for (const Triangle& t : mesh.triangles)
      for (const Index v : t) points.push_back(at(sideOf(normal(mesh.vertices, t)), mesh.vertices[v]));
  }
  static Vec3 normal(const Points& vertices, const Triangle& t) {
    return (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]);
  }
  /// Of a place on a side.
  TexturePoint at(int side, const Vec3& place) const {
    double right = place[(side / 2 + 1) % 3] / size + 0.5;
    const double up = place[(side / 2 + 2) % 3] / size + 0.5;
    if (mirrored) right = 1.0 - right;
    return {static_cast<float>((side % 3 + 0.05 + 0.9 * right) / 3.0),
            static_cast<float>((side / 3 + 0.05 + 0.9 * up) / 2.0)};
  }
  TextureMapPtr map() const { return *TextureMap::make(mesh, points); }
};

inline float apart(const TexturePoint& one, const TexturePoint& other) {
  return std::max(std::abs(one[0] - other[0]), std::abs(one[1] - other[1]));
}

}  // namespace meshless::test
