#include "penetration_depth.h"

#include <algorithm>
#include <limits>

#include "meshless_surgery/base/compressed_rows.h"
#include "meshless_surgery/contact/box_tree.h"
#include "meshless_surgery/geometry/nearest_on_triangle.h"

namespace meshless {
namespace {

constexpr double kOnEdge = 1e-9;  // barycentric slack, so that no ray slips through between two faces
constexpr double kNear = 1e-12;   // of an edge's length: at the crossing itself

struct BorderEdge {
  Index inside, outside;  // particles of a
  Index local;            // of `inside` in the list of penetrations
};

struct Crossing {
  double along = std::numeric_limits<double>::infinity();  // 0 at the inner end, 1 at the outer
  Index face = kNoIndex;
  Vec3 normal = Vec3::Zero();
};

/// Where the segment p-q leaves through the face, if it does so nearer to p than the crossing known so far.
void meetFace(const Points& positions, const Triangle& face, Index number, const Vec3& p, const Vec3& q,
              Crossing& best) {
  const Vec3& a = positions[face[0]];
  const Vec3 u = positions[face[1]] - a, v = positions[face[2]] - a, d = q - p;
  const Vec3 normal = u.cross(v);
  const double facing = normal.dot(d);  // also the determinant
  // Only the way out counts; a face seen edge-on, without area or not finite has no crossing.
  if (!(facing > 1e-14 * normal.norm() * d.norm())) return;
  const double along = normal.dot(a - p) / facing;
  if (!(along >= -kOnEdge) || !(along <= 1.0 + kOnEdge)) return;
  const Vec3 from_a = p - a;
  const Vec3 w = d.cross(from_a);
  const double s = v.dot(w) / facing, t = -u.dot(w) / facing;
  if (!(s >= -kOnEdge) || !(t >= -kOnEdge) || !(s + t <= 1.0 + kOnEdge)) return;
  // Equal places are decided by the face's number, not by the order of the search.
  if (along > best.along || (along == best.along && number > best.face)) return;
  best = {along, number, normal.normalized()};
}

bool finite(const Points& positions, const Triangle& face) {
  return positions[face[0]].allFinite() && positions[face[1]].allFinite() && positions[face[2]].allFinite();
}

/// Crossings of all border edges with b's boundary, one each.
std::vector<Crossing> meetBoundary(const Points& a, const std::vector<BorderEdge>& edges, const ContactBody& b) {
  std::vector<Crossing> crossings(edges.size());
  if (edges.empty()) return crossings;
  double length = 0.0;
  for (const BorderEdge& edge : edges) length += (a[edge.inside] - a[edge.outside]).norm();
  length /= static_cast<double>(edges.size());
  if (!(length > 0.0)) return crossings;
  // Rounding must not part a face from an edge that ends on it.
  const Vec3 margin = Vec3::Constant(1e-9 * length);
  const std::vector<Triangle>& faces = b.mesh->faces;
  Points centres;
  TreeBoxes boxes;
  boxes.items.resize(faces.size());
  for (Index f = 0; f < faces.size(); ++f) {
    const bool there = finite(*b.positions, faces[f]);
    centres.push_back(there ? (*b.positions)[faces[f][0]] : Vec3(Vec3::Zero()));
    for (int k = 0; k < 3 && there; ++k) {
      boxes.items[f].extend((*b.positions)[faces[f][k]] - margin);
      boxes.items[f].extend((*b.positions)[faces[f][k]] + margin);
    }
  }
  const BoxTree tree(centres);
  tree.refit(boxes);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const Vec3 &p = a[edges[e].inside], &q = a[edges[e].outside];
    FloatBox box;
    box.extend(p);
    box.extend(q);
    tree.query(boxes, box, [&](Index f) { meetFace(*b.positions, faces[f], f, p, q, crossings[e]); });
  }
  return crossings;
}

/// The particle of a group that is nearest to a boundary face, and that face.
struct NearestFace {
  Index local = kNoIndex;
  Index face = kNoIndex;
  double squared = std::numeric_limits<double>::infinity();  // [m^2]
};
NearestFace nearestFace(const Points& a, const Penetration* first, const std::vector<Index>& group,
                        const ContactBody& b) {
  NearestFace best;
  for (Index f = 0; f < b.mesh->faces.size(); ++f) {
    const Triangle& face = b.mesh->faces[f];
    if (!finite(*b.positions, face)) continue;
    const Vec3 &u = (*b.positions)[face[0]], &v = (*b.positions)[face[1]], &w = (*b.positions)[face[2]];
    const Vec3 centre = (u + v + w) / 3.0;
    const double radius =
        std::sqrt(std::max({(u - centre).squaredNorm(), (v - centre).squaredNorm(), (w - centre).squaredNorm()}));
    if (!((v - u).cross(w - u).norm() > 1e-12 * radius * radius)) continue;  // no normal
    for (Index local : group) {
      const Vec3& p = a[first[local].particle];
      const double far = radius + std::sqrt(best.squared);
      if ((p - centre).squaredNorm() > far * far) continue;
      const double squared = (nearestOnTriangle(p, u, v, w) - p).squaredNorm();
      if (squared < best.squared) best = {local, f, squared};
    }
  }
  return best;
}

/// Depth and direction of a particle gathered from crossings or neighbours.
struct Gathered {
  double weight = 0.0;
  double depth = 0.0;
  Vec3 direction = Vec3::Zero();

  void add(double w, double d, const Vec3& r) {
    weight += w;
    depth += w * d;
    direction += w * r;
  }
  /// false where the directions cancel each other.
  bool give(Penetration& penetration) const {
    if (!(weight > 0.0)) return false;
    const double length = direction.norm();
    if (!(length > 1e-6 * weight)) return false;
    penetration.depth = std::max(0.0, depth / weight);
    penetration.direction = direction / length;
    return true;
  }
};

}  // namespace

void computePenetrationDepths(const std::vector<ContactBody>& bodies, Penetration* first, Penetration* last) {
  if (first == last) return;
  const ContactBody &a = bodies[first->body_a], &b = bodies[first->body_b];
  const Points& positions = *a.positions;
  const Index size = static_cast<Index>(last - first);
  for (Penetration* p = first; p != last; ++p) {
    p->depth = 0.0;
    p->direction.setZero();
  }

  // Classify edges by how many of their ends are inside.
  std::vector<Index> local_of(positions.size(), kNoIndex);
  for (Index k = 0; k < size; ++k) local_of[first[k].particle] = k;
  std::vector<BorderEdge> border;
  std::vector<std::array<Index, 2>> inner;
  if (a.mesh)
    for (const auto& edge : a.mesh->edges) {
      const Index u = local_of[edge[0]], v = local_of[edge[1]];
      if (u == kNoIndex && v == kNoIndex) continue;
      if (!positions[edge[0]].allFinite() || !positions[edge[1]].allFinite()) continue;
      if (u == kNoIndex)
        border.push_back({edge[1], edge[0], v});
      else if (v == kNoIndex)
        border.push_back({edge[0], edge[1], u});
      else
        inner.push_back({u, v});
    }

  // Border particles.
  const std::vector<Crossing> crossings = meetBoundary(positions, border, b);
  std::vector<Gathered> gathered(size);
  for (std::size_t e = 0; e < border.size(); ++e) {
    if (crossings[e].face == kNoIndex) continue;
    const Vec3& p = positions[border[e].inside];
    const Vec3 way = positions[border[e].outside] - p;
    const double along = std::max(crossings[e].along, kNear);
    gathered[border[e].local].add(1.0 / (along * along * way.squaredNorm()), along * way.dot(crossings[e].normal),
                                  crossings[e].normal);
  }
  std::vector<bool> done(size, false);
  std::vector<Index> layer;
  for (Index k = 0; k < size; ++k)
    if (gathered[k].give(first[k])) {
      done[k] = true;
      layer.push_back(k);
    }

  // Inner particles, layer by layer.
  std::vector<Index> offsets, neighbours;
  const auto each = [&inner](const auto& visit) {
    for (const auto& [u, v] : inner) {
      visit(u, v);
      visit(v, u);
    }
  };
  compressRows(size, each, offsets, neighbours);
  const auto propagate = [&] {
    while (!layer.empty()) {
      std::vector<Index> next;
      for (Index k : layer)
        for (Index n = offsets[k]; n < offsets[k + 1]; ++n)
          if (!done[neighbours[n]]) next.push_back(neighbours[n]);
      std::sort(next.begin(), next.end());
      next.erase(std::unique(next.begin(), next.end()), next.end());
      std::vector<Index> given;
      for (Index k : next) {
        Gathered sum;
        const Vec3& p = positions[first[k].particle];
        for (Index n = offsets[k]; n < offsets[k + 1]; ++n) {
          const Index j = neighbours[n];
          if (!done[j]) continue;
          const Vec3 way = positions[first[j].particle] - p;
          const double squared = way.squaredNorm();
          if (squared > 0.0) sum.add(1.0 / squared, way.dot(first[j].direction) + first[j].depth, first[j].direction);
        }
        if (sum.give(first[k])) given.push_back(k);
      }
      for (Index k : given) done[k] = true;
      layer = std::move(given);
    }
  };
  propagate();

  // Groups that no edge leaves.
  std::vector<bool> seen(size, false);
  for (Index start = 0; start < size; ++start) {
    if (done[start] || seen[start]) continue;
    std::vector<Index> group{start};
    seen[start] = true;
    for (std::size_t at = 0; at < group.size(); ++at)
      for (Index n = offsets[group[at]]; n < offsets[group[at] + 1]; ++n) {
        const Index j = neighbours[n];
        if (done[j] || seen[j]) continue;
        seen[j] = true;
        group.push_back(j);
      }
    std::sort(group.begin(), group.end());
    const NearestFace nearest = nearestFace(positions, first, group, b);
    if (nearest.face == kNoIndex) continue;
    const Triangle& face = b.mesh->faces[nearest.face];
    const Vec3& corner = (*b.positions)[face[0]];
    first[nearest.local].direction =
        ((*b.positions)[face[1]] - corner).cross((*b.positions)[face[2]] - corner).normalized();
    first[nearest.local].depth = std::sqrt(nearest.squared);
    done[nearest.local] = true;
    layer = {nearest.local};
    propagate();
  }
}

}  // namespace meshless
