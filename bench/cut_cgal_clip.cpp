#include <array>
#include <cmath>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/clip.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Surface_mesh.h>

#include "cut_rows.h"

namespace meshless::bench {
namespace {

namespace pmp = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;

}  // namespace

struct CgalClip::Impl {
  Surface whole;
  std::array<Surface, 2> sides;
};

CgalClip::CgalClip(const TriangleMesh& mesh) : impl_(new Impl) {
  std::vector<Surface::Vertex_index> made;
  made.reserve(mesh.vertices.size());
  for (const Vec3& p : mesh.vertices) made.push_back(impl_->whole.add_vertex(Kernel::Point_3(p.x(), p.y(), p.z())));
  for (const Triangle& t : mesh.triangles) impl_->whole.add_face(made[t[0]], made[t[1]], made[t[2]]);
}

CgalClip::~CgalClip() { delete impl_; }

void CgalClip::copy() {
  for (Surface& side : impl_->sides) side = impl_->whole;
}

bool CgalClip::run(const Plane& plane) {
  const Vec3& n = plane.normal;
  const Kernel::Plane_3 up(Kernel::Point_3(plane.point.x(), plane.point.y(), plane.point.z()),
                           Kernel::Vector_3(n.x(), n.y(), n.z()));
  const auto clipped = [](Surface& side, const Kernel::Plane_3& by) {
    return pmp::clip(side, by, CGAL::parameters::clip_volume(true)) && CGAL::is_closed(side);
  };
  return clipped(impl_->sides[0], up) && clipped(impl_->sides[1], up.opposite());
}

std::size_t CgalClip::capTriangles(const Plane& plane) const {
  std::size_t count = 0;
  for (const Surface& side : impl_->sides) {
    for (const Surface::Face_index face : side.faces()) {
      bool in_plane = true;
      for (const Surface::Vertex_index v : side.vertices_around_face(side.halfedge(face))) {
        const Kernel::Point_3& p = side.point(v);
        in_plane &= std::abs(plane.height(Vec3(p.x(), p.y(), p.z()))) < 1e-9;
      }
      count += in_plane;
    }
  }
  return count;
}

std::array<double, 2> CgalClip::volumes() const {
  return {CGAL::to_double(pmp::volume(impl_->sides[0])), CGAL::to_double(pmp::volume(impl_->sides[1]))};
}

std::array<double, 2> CgalClip::areas() const {
  return {CGAL::to_double(pmp::area(impl_->sides[0])), CGAL::to_double(pmp::area(impl_->sides[1]))};
}

double CgalClip::volume() const {
  const std::array<double, 2> both = volumes();
  return both[0] + both[1];
}

}  // namespace meshless::bench
