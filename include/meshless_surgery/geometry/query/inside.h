// Point and segment queries against a closed surface.
#pragma once

#include <memory>

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// Built once for a mesh (copied), then queried; const queries may run in parallel. Open meshes are accepted: inside is
/// then where they wind around more than half. Without triangles nothing is inside and every distance is infinite.
class SolidQuery {
 public:
  explicit SolidQuery(const TriangleMesh& mesh);
  ~SolidQuery();
  SolidQuery(SolidQuery&&) noexcept;
  SolidQuery& operator=(SolidQuery&&) noexcept;

  /// True where the surface winds around p at least once: counted by two rays, and by the sum of solid angles (Jacobson
  /// et al. 2013) where they disagree. Surfaces that cross themselves so have a sensible inside too. False for NaN.
  bool contains(const Vec3& p) const;
  /// True where the open segment a-b (shortened by 1e-6 of its length at both ends) goes through the surface.
  /// A segment that lies in a face, as a surface edge does, does not go through it.
  bool crosses(const Vec3& a, const Vec3& b) const;
  /// Distance to the surface [m], unsigned.
  double distance(const Vec3& p) const;
  /// The place on it that is nearest to p; p where there is none.
  Vec3 nearest(const Vec3& p) const;
  /// The triangle of the mesh that this is on; kNoIndex where there is none.
  Index nearestTriangle(const Vec3& p) const;

  std::size_t bytes() const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace meshless
