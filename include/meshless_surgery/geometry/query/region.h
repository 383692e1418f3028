// A part of space that a user names: what is held there, or of which material it is.
#pragma once

#include <memory>
#include <string>

#include "meshless_surgery/base/types.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/query/plane.h"

namespace meshless {

struct Region {
  enum class Kind { kBox, kPlane, kSphere, kMesh };

  Kind kind = Kind::kBox;
  Box box;
  Plane plane;                              // what is below it
  Vec3 centre = Vec3::Zero();               // [m] of the sphere
  double radius = 0.0;                      // [m]
  std::shared_ptr<const SolidQuery> solid;  // of the mesh
  std::string file;                         // for messages: where that is from

  Region() = default;
  Region(const Box& inside) : box(inside) {}  // a box is a region
  Region(const Vec3& min, const Vec3& max) : box{min, max} {}
  static Region below(const Plane& plane);
  static Region sphere(const Vec3& centre, double radius);
  static Region within(const TriangleMesh& mesh, std::string file);  // closed

  /// [m] below 0 inside, outside of a box the largest distance along an axis. It grows no faster than the distance
  /// does.
  double height(const Vec3& p) const;
  /// For messages: "the box from 0 0 0 to 1 1 1".
  std::string text() const;
  /// Its border is inside.
  bool contains(const Vec3& p) const { return height(p) <= 0.0; }
};

}  // namespace meshless
