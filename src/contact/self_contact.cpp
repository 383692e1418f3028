#include "meshless_surgery/contact/self_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

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
constexpr double kRidge = 0.94;          // cosine of the normals beside a ridge, at most: about 20 degrees
constexpr double kOutwards = -0.2;       // sine of the angle by which the face beyond it is turned back
constexpr double kParallel = 0.05;       // sine: ridges along each other do not cross
constexpr Index kMostRidges = 1 << 15;   // so that a pair of them is told by one number

// Edges of the chosen faces at which they turn outwards, or end.
std::vector<SelfContactSet::Ridge> ridgesOf(const TriangleMesh& surface, const std::vector<Index>& triangles) {
  struct Side {
    std::array<Index, 2> edge;
    Index triangle, opposite;
  };
  std::vector<Side> sides;
  for (Index t : triangles)
    for (int k = 0; k < 3; ++k) {
      const Triangle& c = surface.triangles[t];
      const Index u = c[(k + 1) % 3], v = c[(k + 2) % 3];
      sides.push_back({{std::min(u, v), std::max(u, v)}, t, c[k]});
    }
  std::sort(sides.begin(), sides.end(),
            [](const Side& p, const Side& q) { return std::tie(p.edge, p.triangle) < std::tie(q.edge, q.triangle); });
  const auto normalOf = [&surface](Index t) -> Vec3 {
    const Triangle& c = surface.triangles[t];
    const Vec3& a = surface.vertices[c[0]];
    return (surface.vertices[c[1]] - a).cross(surface.vertices[c[2]] - a).normalized();
  };
  std::vector<SelfContactSet::Ridge> ridges;
  for (std::size_t k = 0; k < sides.size();) {
    std::size_t end = k + 1;
    while (end < sides.size() && sides[end].edge == sides[k].edge) ++end;
    const bool two = end == k + 2;
    bool ridge = end == k + 1;
    if (two) {
      const Vec3 normal = normalOf(sides[k].triangle);
      const Vec3 beyond = surface.vertices[sides[k + 1].opposite] - surface.vertices[sides[k].edge[0]];
      ridge = normal.dot(normalOf(sides[k + 1].triangle)) < kRidge && normal.dot(beyond) < kOutwards * beyond.norm();
    }
    if (ridge) ridges.push_back({sides[k].edge, {sides[k].triangle, two ? sides[k + 1].triangle : kNoIndex}});
    k = end;
  }
  return ridges;
}

bool isBehindAtRest(const TriangleMesh& rest, const SelfContactSet::Ridge& ridge, const Vec3& p, double depth) {
  for (Index f : ridge.faces) {
    if (f == kNoIndex) continue;
    const Triangle& c = rest.triangles[f];
    const Vec3& r0 = rest.vertices[c[0]];
    const Vec3 area = (rest.vertices[c[1]] - r0).cross(rest.vertices[c[2]] - r0);
    if (area.dot(p - r0) > -kBehindAtRest * depth * area.norm()) return false;
  }
  return true;
}

// Where two segments, from a along u and from b along v, are nearest; false where that is not within both.
bool crossing(const Vec3& a, const Vec3& u, const Vec3& b, const Vec3& v, double& s, double& t) {
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
  const double det = uu * vv - uv * uv;
  if (!(det > kParallel * kParallel * uu * vv)) return false;
  const Vec3 d = b - a;
  s = (u.dot(d) * vv - v.dot(d) * uv) / det;
  t = (u.dot(d) * uv - v.dot(d) * uu) / det;
  return s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0;
}

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
  set.ridges = ridgesOf(surface, set.triangles);
  return set;
}

void SelfGrid::make(const ShapeCollider& collider, double reach) {
  const SelfContactSet& set = *collider.self;
  const std::vector<Triangle>& triangles = collider.shape->surface().triangles;
  boxes_.clear();
  triangles_ = &set.triangles;
  Box all;
  double extent = 0.0;
  for (Index t : set.triangles) {
    Box box;
    for (Index corner : triangles[t]) box.extend(vertexAt(collider, corner));
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
    forCells(boxes_[k], [&](std::size_t cell) { items_[next_[cell]++] = k; });
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
  for (Index n = offsets_[cell]; n < offsets_[cell + 1]; ++n)
    if (boxes_[items_[n]].contains(p)) visit((*triangles_)[items_[n]]);
}

// The points of a body against its own faces, where both are now. Rest shapes say nothing here: in them, wound faces
// lie on each other.
void Contacts::Impl::querySelf(Findings& to, const std::vector<ShapeCollider>& colliders, const Pair& pair) {
  const ShapeCollider& collider = colliders[pair.a];
  const SelfContactSet& set = *collider.self;
  const ContactShape& shape = *collider.shape;
  const TriangleMesh& rest = shape.surface();
  to.self_grid.make(collider, std::max(pair.reach, set.depth));
  Points& areas = to.self_areas;  // about the vertices, as they are now
  areas.assign(rest.vertices.size(), Vec3::Zero());
  for (Index t : set.triangles) {
    const Triangle& c = rest.triangles[t];
    const Vec3& x0 = vertexAt(collider, c[0]);
    const Vec3 area = (vertexAt(collider, c[1]) - x0).cross(vertexAt(collider, c[2]) - x0);
    for (Index v : c) areas[v] += area;
  }
  for (Index v : set.vertices) {
    ++to.counters.self_points;
    const Vec3 p = vertexAt(collider, v);
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
      const Vec3 &x0 = vertexAt(collider, c[0]), &x1 = vertexAt(collider, c[1]), &x2 = vertexAt(collider, c[2]);
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
    addContact(to, colliders, pair.a, v, {{v, v}, 0.0, Vec3::Zero()}, pair.a, face,
               {weights_there.x(), weights_there.y(), weights_there.z()}, false, false);
    if (to.contacts.size() > before) to.contacts.back().below = height_there < 0.0;
  }
  crossRidges(to, colliders, pair);
}

// Ridges that cross: no vertex of one need be over a face of the other. They press along what is across both, out of
// the second; where they touch stays the same in a frame.
void Contacts::Impl::crossRidges(Findings& to, const std::vector<ShapeCollider>& colliders, const Pair& pair) {
  const ShapeCollider& collider = colliders[pair.a];
  const SelfContactSet& set = *collider.self;
  const TriangleMesh& rest = collider.shape->surface();
  if (set.ridges.size() < 2 || set.ridges.size() > kMostRidges) return;
  const double reach = std::max(pair.reach, set.depth);
  std::vector<RidgeNow>& now = to.ridges;
  now.clear();
  for (Index r = 0; r < set.ridges.size(); ++r) {
    const SelfContactSet::Ridge& ridge = set.ridges[r];
    RidgeNow here{{}, Vec3::Zero(), r};
    for (Index v : ridge.vertices) here.box.extend(vertexAt(collider, v));
    for (Index f : ridge.faces) {
      if (f == kNoIndex) continue;
      const Triangle& c = rest.triangles[f];
      const Vec3& x0 = vertexAt(collider, c[0]);
      here.outward += (vertexAt(collider, c[1]) - x0).cross(vertexAt(collider, c[2]) - x0).normalized();
    }
    here.outward.normalize();
    if (!here.outward.allFinite() || !std::isfinite(here.box.diagonal())) continue;
    here.box = grown(here.box, 0.5 * reach);
    now.push_back(here);
  }
  std::sort(now.begin(), now.end(), [](const RidgeNow& p, const RidgeNow& q) {
    return std::make_pair(p.box.min.x(), p.ridge) < std::make_pair(q.box.min.x(), q.ridge);
  });
  const std::size_t first = to.contacts.size();
  for (std::size_t k = 0; k < now.size(); ++k)
    for (std::size_t n = k + 1; n < now.size() && now[n].box.min.x() <= now[k].box.max.x(); ++n) {
      if (now[k].outward.dot(now[n].outward) > kOpposed || !now[k].box.overlaps(now[n].box)) continue;
      const bool in_order = now[k].ridge < now[n].ridge;
      const RidgeNow &a = now[in_order ? k : n], &b = now[in_order ? n : k];
      ++to.counters.self_points;
      const std::array<Index, 2>&e = set.ridges[a.ridge].vertices, &f = set.ridges[b.ridge].vertices;
      if (e[0] == f[0] || e[0] == f[1] || e[1] == f[0] || e[1] == f[1]) continue;
      const Vec3 from_a = vertexAt(collider, e[0]), from_b = vertexAt(collider, f[0]);
      const Vec3 along_a = vertexAt(collider, e[1]) - from_a, along_b = vertexAt(collider, f[1]) - from_b;
      double s = 0.0, t = 0.0;
      if (!crossing(from_a, along_a, from_b, along_b, s, t)) continue;
      Vec3 normal = along_a.cross(along_b).normalized();
      if (normal.dot(b.outward) < 0.0) normal = -normal;
      // Each on the outer side of the other.
      if (!(normal.dot(b.outward) > -kOpposed) || !(normal.dot(a.outward) < kOpposed)) continue;
      const double height = normal.dot(from_a + s * along_a - from_b - t * along_b);
      if (!(height < pair.reach) || !(height > -set.depth)) continue;
      const Vec3 rest_a = rest.vertices[e[0]] + s * (rest.vertices[e[1]] - rest.vertices[e[0]]);
      const Vec3 rest_b = rest.vertices[f[0]] + t * (rest.vertices[f[1]] - rest.vertices[f[0]]);
      if ((rest_a - rest_b).norm() < kNearAtRest * set.depth &&
          isBehindAtRest(rest, set.ridges[b.ridge], rest_a, set.depth))
        continue;
      Contact c;
      c.a = c.b = pair.a;
      c.sample = static_cast<Index>(rest.vertices.size()) + a.ridge * kMostRidges + b.ridge;
      c.triangle = set.ridges[b.ridge].faces[0];
      c.below = height < 0.0;
      c.normal = normal;
      c.first = static_cast<Index>(to.entries.size());
      c.offset = addRow(collider, e[0], 1.0 - s, to.entries);
      c.offset += addRow(collider, e[1], s, to.entries);
      tidy(to.entries, c.first);
      c.split = static_cast<Index>(to.entries.size());
      c.offset -= addRow(collider, f[0], 1.0 - t, to.entries);
      c.offset -= addRow(collider, f[1], t, to.entries);
      tidy(to.entries, c.split);
      c.end = static_cast<Index>(to.entries.size());
      to.contacts.push_back(c);
    }
  std::sort(to.contacts.begin() + static_cast<std::ptrdiff_t>(first), to.contacts.end(),
            [](const Contact& p, const Contact& q) { return p.sample < q.sample; });
}

}  // namespace meshless
