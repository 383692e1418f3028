#include "exact.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

namespace meshless {
namespace exact {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;

Kernel::Point_2 point(const Vec2& p) { return {p.x(), p.y()}; }
Kernel::Point_3 point(const Vec3& p) { return {p.x(), p.y(), p.z()}; }
Kernel::Triangle_3 triangle(const Corners& c) { return {point(c[0]), point(c[1]), point(c[2])}; }
Kernel::Segment_3 lastEdge(const Corners& c) { return {point(c[1]), point(c[2])}; }

}  // namespace

int turn(const Vec2& a, const Vec2& b, const Vec2& c) {
  return static_cast<int>(CGAL::orientation(point(a), point(b), point(c)));
}

bool onALine(const Corners& corners) { return triangle(corners).is_degenerate(); }

bool meet(const Corners& a, const Corners& b, int shared) {
  if (shared == 0) return CGAL::do_intersect(triangle(a), triangle(b));
  if (shared == 1) return CGAL::do_intersect(lastEdge(a), triangle(b)) || CGAL::do_intersect(lastEdge(b), triangle(a));
  const Kernel::Point_3 from = point(a[0]), to = point(a[1]), p = point(a[2]), q = point(b[2]);
  return CGAL::coplanar(from, to, p, q) && CGAL::coplanar_orientation(from, to, p, q) == CGAL::POSITIVE;
}

}  // namespace exact
}  // namespace meshless
