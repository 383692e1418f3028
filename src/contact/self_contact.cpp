#include "meshless_surgery/contact/self_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "contacts_impl.h"
#include "meshless_surgery/geometry/nearest_on_triangle.h"

namespace meshless {
namespace {

constexpr double kThicknessShare = 0.5;  // of the thickness: a point farther behind a face is at the other side
constexpr double kOpposed = -0.2;        // cosine of the normals of what faces each other
constexpr double kOver = 0.9;            // of the distance: a point is over a face, not beside it
constexpr double kBehindAtRest = 0.1;    // of the depth: what is behind a face at rest has tissue between
constexpr double kNearAtRest = 3.0;      // depths
constexpr int kMostCells = 64;           // along an edge of the grid

}  // namespace

SelfContactSet selfContactSet(const ContactShape& shape, bool cuts_alone, double spacing) {
  SelfContactSet set;
  const TriangleMesh& surface = shape.surface();
  set.depth = std::min(kThicknessShare * shape.thickness(), spacing > 0.0 ? spacing : shape.size());
  std::vector<char> taken(surface.vertices.size(), 0);
  for (Index t = 0; t < surface.triangles.size(); ++t) {
    if (cuts_alone && surface.patchOf(t) == kOuterPatch) continue;
    set.triangles.push_back(t);
    for (Index v : surface.triangles[t]) taken[v] = 1;
  }
  for (Index v = 0; v < taken.size(); ++v)
    if (taken[v]) set.vertices.push_back(v);
  return set;
}

void SelfGrid::make(const ContactParty& party, double reach) {
  const SelfContactSet& set = *party.self;
  const std::vector<Triangle>& triangles = party.shape->surface().triangles;
  boxes_.clear();
  Box all;
  double extent = 0.0;
  for (Index t : set.triangles) {
    Box box;
    for (Index corner : triangles[t]) box.extend(vertexAt(party, corner));
    extent += box.diagonal();
    boxes_.push_back(grown(box, reach));
    all.extend(box.min);
    all.extend(box.max);
  }
  cells_ = {1, 1, 1};
  origin_ = all.min.array() - reach;
  edge_ = boxes_.empty() ? 1.0 : extent / static_cast<double>(boxes_.size()) + 2.0 * reach;
  if (!all.empty()) edge_ = std::max(edge_, ((all.max - all.min).maxCoeff() + 2.0 * reach) / kMostCells);
  if (!(edge_ > 0.0) || !std::isfinite(edge_)) {  // without extent, or of no number: nothing is near anything
    boxes_.clear();
    edge_ = 1.0;
    offsets_.assign(2, 0);
    return;
  }
  for (int d = 0; d < 3; ++d)
    cells_[d] = std::clamp(static_cast<int>((all.max[d] - origin_[d] + reach) / edge_) + 1, 1, kMostCells + 1);
  offsets_.assign(static_cast<std::size_t>(cells_[0]) * cells_[1] * cells_[2] + 1, 0);
  for (const Box& box : boxes_) forCells(box, [this](std::size_t cell) { ++offsets_[cell + 1]; });
  for (std::size_t c = 0; c + 1 < offsets_.size(); ++c) offsets_[c + 1] += offsets_[c];
  items_.resize(offsets_.back());
  next_.assign(offsets_.begin(), offsets_.end() - 1);
  for (Index k = 0; k < boxes_.size(); ++k)
    forCells(boxes_[k], [&](std::size_t cell) { items_[next_[cell]++] = set.triangles[k]; });
}

template <class Visit>
void SelfGrid::forCells(const Box& box, const Visit& visit) const {
  std::array<int, 3> first, last;
  for (int d = 0; d < 3; ++d) {
    first[d] = at(box.min[d], d);
    last[d] = at(box.max[d], d);
  }
  for (int x = first[0]; x <= last[0]; ++x)
    for (int y = first[1]; y <= last[1]; ++y)
      for (int z = first[2]; z <= last[2]; ++z) visit((static_cast<std::size_t>(x) * cells_[1] + y) * cells_[2] + z);
}

int SelfGrid::at(double coordinate, int axis) const {
  const double c = (coordinate - origin_[axis]) / edge_;
  return c > 0.0 ? (c < cells_[axis] ? static_cast<int>(c) : cells_[axis] - 1) : 0;
}

template <class Visit>
void SelfGrid::forNear(const Vec3& p, const Visit& visit) const {
  const std::size_t cell =
      (static_cast<std::size_t>(at(p.x(), 0)) * cells_[1] + at(p.y(), 1)) * cells_[2] + at(p.z(), 2);
  for (Index k = offsets_[cell]; k < offsets_[cell + 1]; ++k) visit(items_[k]);
}

// The points of a body against its own faces, where both are now. Rest shapes say nothing here: lips lie on each other
// in them.
void Contacts::Impl::lookIntoSelf(Findings& to, const std::vector<ContactParty>& parties, const Pair& pair) {
  const ContactParty& party = parties[pair.a];
  const SelfContactSet& set = *party.self;
  const ContactShape& shape = *party.shape;
  const TriangleMesh& rest = shape.surface();
  to.self_grid.make(party, std::max(pair.reach, set.depth));
  Points& areas = to.self_areas;  // about the vertices, as they are now
  areas.assign(rest.vertices.size(), Vec3::Zero());
  for (Index t : set.triangles) {
    const Triangle& c = rest.triangles[t];
    const Vec3& x0 = vertexAt(party, c[0]);
    const Vec3 area = (vertexAt(party, c[1]) - x0).cross(vertexAt(party, c[2]) - x0);
    for (Index v : c) areas[v] += area;
  }
  for (Index v : set.vertices) {
    ++to.counters.self_points;
    const Vec3 p = vertexAt(party, v);
    if (!p.allFinite()) continue;
    const Vec3 outward = areas[v].normalized();
    const Vec3& at_rest = rest.vertices[v];
    double nearest = std::numeric_limits<double>::infinity(), height_there = 0.0;
    Index face = kNoIndex;
    Vec3 weights_there = Vec3::Zero();
    to.self_grid.forNear(p, [&](Index t) {
      const Triangle& c = rest.triangles[t];
      for (Index corner : c)
        if (corner == v) return;
      const Vec3 &x0 = vertexAt(party, c[0]), &x1 = vertexAt(party, c[1]), &x2 = vertexAt(party, c[2]);
      const Vec3 area = (x1 - x0).cross(x2 - x0);
      const double length = area.norm();
      if (!(length > 0.0) || area.dot(outward) > kOpposed * length) return;
      const double height = area.dot(p - x0) / length;
      if (height > pair.reach || height < -set.depth) return;
      const Vec3 w = nearestWeights(p, x0, x1, x2);
      const double distance = (p - w.x() * x0 - w.y() * x1 - w.z() * x2).norm();
      if (!(distance < nearest) || std::abs(height) < kOver * distance - 1e-9 * shape.size()) return;
      const Vec3 &r0 = rest.vertices[c[0]], &r1 = rest.vertices[c[1]], &r2 = rest.vertices[c[2]];
      const Vec3 rest_area = (r1 - r0).cross(r2 - r0);
      const bool behind = rest_area.dot(at_rest - r0) < -kBehindAtRest * set.depth * rest_area.norm();
      if (behind && (nearestOnTriangle(at_rest, r0, r1, r2) - at_rest).norm() < kNearAtRest * set.depth) return;
      nearest = distance;
      height_there = height;
      face = t;
      weights_there = w;
    });
    if (face == kNoIndex) continue;
    const std::size_t before = to.contacts.size();
    addContact(to, parties, pair.a, v, {{v, v}, 0.0, Vec3::Zero()}, pair.a, face,
               {weights_there.x(), weights_there.y(), weights_there.z()}, false, false);
    if (to.contacts.size() > before) to.contacts.back().below = height_there < 0.0;
  }
}

}  // namespace meshless
