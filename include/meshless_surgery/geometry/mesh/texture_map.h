// Where a file lays its image on its surface. It is kept as the file has it, beside the body's surface: whatever
// repair, cuts and incisions have made of a triangle asks for the place of the file's surface that is nearest. So
// nothing that changes triangles carries coordinates along, and a part of a triangle of the file has exactly the image
// that this had.
#pragma once

#include <memory>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/query/inside.h"

namespace meshless {

/// To the right and up from the image's lower left corner; the image is one wide and one high, and repeats.
using TexturePoint = std::array<float, 2>;

class TextureMap;
using TextureMapPtr = std::shared_ptr<const TextureMap>;

class TextureMap {
 public:
  /// `surface` at rest in the body's own frame [m]; three points a triangle, one a corner. At a seam of the image the
  /// corners at a vertex differ. Refuses kUnsuitableShape: no surface, another number of points, corners that are not
  /// there, numbers that are not finite.
  static Result<TextureMapPtr> make(TriangleMesh surface, std::vector<TexturePoint> points);

  /// For the corners of a triangle in that frame: from the place that is nearest to its middle as near to each corner
  /// as the surface goes on without a seam. So no triangle of two sides of a seam.
  std::array<TexturePoint, 3> of(const std::array<Vec3, 3>& corners) const;

  const TriangleMesh& surface() const { return surface_; }
  const std::vector<TexturePoint>& points() const { return points_; }
  std::size_t bytes() const;

 private:
  TextureMap(TriangleMesh surface, std::vector<TexturePoint> points);

  TriangleMesh surface_;
  std::vector<TexturePoint> points_;
  std::vector<Triangle> neighbours_;  // of each triangle: behind the edge at its corner k, or kNoIndex: none, or a seam
  SolidQuery places_;
};

}  // namespace meshless
