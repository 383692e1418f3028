// What bench_cut measures against, and an oracle for the tests of cuts. CGAL's headers stay in a translation unit of
// their own.
#pragma once

#include <array>
#include <cstddef>

#include "meshless_surgery/geometry/query/plane.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless::bench {

/// Both sides of a plane by CGAL's Polygon_mesh_processing::clip with clip_volume, each from a fresh copy, since clip
/// works in place. Construction of the surface and the copies are set-up, not part of run().
class CgalClip {
 public:
  explicit CgalClip(const TriangleMesh& mesh);
  ~CgalClip();
  CgalClip(const CgalClip&) = delete;
  CgalClip& operator=(const CgalClip&) = delete;

  void copy();
  /// False where a side failed or is open.
  bool run(const Plane& plane);
  std::size_t capTriangles(const Plane& plane) const;  // of both sides after run()
  double volume() const;                               // [m^3] of both sides after run()
  /// [m^3] and [m^2], cap included, of the side below the plane and of the one above it, after run().
  std::array<double, 2> volumes() const;
  std::array<double, 2> areas() const;

 private:
  struct Impl;
  Impl* impl_;
};

}  // namespace meshless::bench
