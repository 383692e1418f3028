#include "crossings.h"

#include <algorithm>

#include <CGAL/Bbox_3.h>
#include <CGAL/box_intersection_d.h>

#include "exact.h"

namespace meshless {
namespace {

bool trianglesCross(const Points& points, const Triangle& s, const Triangle& t) {
  const auto corners = [&](Index a, Index b, Index c) { return exact::Corners{points[a], points[b], points[c]}; };
  if (exact::onALine(corners(s[0], s[1], s[2])) || exact::onALine(corners(t[0], t[1], t[2]))) return false;
  std::vector<Index> first, second;  // the common ones, then the others
  for (const Index v : s)
    if (std::find(t.begin(), t.end(), v) != t.end()) first.push_back(v);
  second = first;
  const std::size_t common = first.size();
  for (const Index v : s)
    if (std::find(t.begin(), t.end(), v) == t.end()) first.push_back(v);
  for (const Index v : t)
    if (std::find(s.begin(), s.end(), v) == s.end()) second.push_back(v);
  return common < 3 && exact::meet(corners(first[0], first[1], first[2]), corners(second[0], second[1], second[2]),
                                   static_cast<int>(common));
}

}  // namespace

void forEachCrossing(const Points& points, const std::vector<Triangle>& triangles,
                     const std::function<void(Index, Index)>& found) {
  using TriangleBox = CGAL::Box_intersection_d::Box_with_info_d<double, 3, Index>;
  std::vector<TriangleBox> boxes;
  boxes.reserve(triangles.size());
  for (Index f = 0; f < triangles.size(); ++f) {
    Box box;
    for (const Index v : triangles[f]) box.extend(points[v]);
    boxes.emplace_back(CGAL::Bbox_3(box.min.x(), box.min.y(), box.min.z(), box.max.x(), box.max.y(), box.max.z()), f);
  }
  CGAL::box_self_intersection_d(boxes.begin(), boxes.end(), [&](const TriangleBox& a, const TriangleBox& b) {
    if (trianglesCross(points, triangles[a.info()], triangles[b.info()])) found(a.info(), b.info());
  });
}

}  // namespace meshless
