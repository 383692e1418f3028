#include "meshless_surgery/contact/textbook.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "meshless_surgery/base/compressed_rows.h"
#include "meshless_surgery/contact/broad_phase.h"
#include "meshless_surgery/geometry/query/nearest_on_triangle.h"

namespace meshless {
namespace {

constexpr double kFlat = 1e-10;    // a tetrahedron whose volume is below this times its cubed size holds nothing
constexpr double kOnEdge = 1e-9;   // barycentric slack, so that no ray slips through between two faces
constexpr double kNear = 1e-12;    // of an edge's length: at the crossing itself
constexpr double kOnFace = 1e-10;  // barycentric slack, so that no particle is lost between two tetrahedra

/// The tetrahedra of a body, for the particles of others that may be inside.
class Container {
 public:
  Container(const std::vector<ContactBody>& bodies, Index b) : bodies_(bodies), b_(b) {
    const Points& x = *bodies[b].positions;
    Points centres;
    for (const Tetrahedron& t : bodies[b].mesh->tetrahedra) {
      FloatBox& box = boxes_.items.emplace_back();
      Box bounds;
      for (const Index corner : t) bounds.extend(x[corner]);
      const bool finite =
          std::all_of(t.begin(), t.end(), [&](Index corner) { return x[corner].allFinite(); }) && canHold(t, bounds);
      centres.push_back(finite ? Vec3(0.5 * (bounds.min + bounds.max)) : Vec3(Vec3::Zero()));
      if (!finite) continue;
      box.extend(bounds.min);
      box.extend(bounds.max);
    }
    tree_.build(centres);
    tree_.refit(boxes_);
  }

  /// Appends the particles of a that are inside. One may lie on a face between two tetrahedra, or in a fold: it has the
  /// first.
  void find(Index a, std::size_t& tested, std::vector<Penetration>& found) {
    const Points& positions = *bodies_[a].positions;
    for (Index k = 0; k < positions.size(); ++k) {
      const Vec3& p = positions[k];
      if (!bodies_[a].bounds.contains(p) || !bodies_[b_].bounds.contains(p)) continue;
      FloatBox box;
      box.extend(p);
      Penetration inside;
      inside.tetrahedron = kNoIndex;
      tree_.query(boxes_, box, [&](Index t) {
        ++tested;
        if (t < inside.tetrahedron && holds(t, p, inside.weights)) inside.tetrahedron = t;
      });
      if (inside.tetrahedron == kNoIndex) continue;
      inside.body_a = a;
      inside.particle = k;
      inside.body_b = b_;
      found.push_back(inside);
    }
  }

 private:
  Mat3 edgesOf(const Tetrahedron& t) const {
    const Points& x = *bodies_[b_].positions;
    Mat3 edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = x[t[k + 1]] - x[t[0]];
    return edges;
  }

  bool canHold(const Tetrahedron& t, const Box& bounds) const {
    const double size = bounds.diagonal();
    return std::abs(edgesOf(t).determinant()) > kFlat * size * size * size;
  }

  /// Writes weights where it is.
  bool holds(Index t, const Vec3& p, std::array<double, 4>& weights) {
    const Tetrahedron& corners = bodies_[b_].mesh->tetrahedra[t];
    Box box;
    for (const Index corner : corners) box.extend((*bodies_[b_].positions)[corner]);
    if (!box.contains(p)) return false;
    const Vec3 w = edgesOf(corners).inverse() * (p - (*bodies_[b_].positions)[corners[0]]);
    const std::array<double, 4> all{1.0 - w.sum(), w[0], w[1], w[2]};
    for (const double weight : all)
      if (!(weight >= -kOnFace)) return false;
    if (*std::min_element(all.begin(), all.end()) <= kOnFace && liesOnBoundary(corners, all)) return false;
    weights = all;
    return true;
  }

  /// True where the face, edge or vertex of the tetrahedron that the weights name is one of the boundary: the particle
  /// touches the body and is not inside.
  bool liesOnBoundary(const Tetrahedron& corners, const std::array<double, 4>& weights) {
    Triangle simplex{kNoIndex, kNoIndex, kNoIndex};
    int size = 0;
    for (int k = 0; k < 4 && size < 3; ++k)
      if (weights[k] > kOnFace) simplex[size++] = corners[k];
    std::sort(simplex.begin(), simplex.end());
    if (boundary_.empty()) {
      for (Triangle face : bodies_[b_].mesh->faces) {
        std::sort(face.begin(), face.end());
        boundary_.push_back(face);
        for (int k = 0; k < 3; ++k) {
          boundary_.push_back({face[k], kNoIndex, kNoIndex});
          boundary_.push_back({face[k == 2 ? 1 : 0], face[k == 0 ? 1 : 2], kNoIndex});
        }
      }
      std::sort(boundary_.begin(), boundary_.end());
    }
    return std::binary_search(boundary_.begin(), boundary_.end(), simplex);
  }

  const std::vector<ContactBody>& bodies_;
  const Index b_;
  BoxTree tree_;
  TreeBoxes boxes_;
  std::vector<Triangle> boundary_;  // its faces, edges and vertices, sorted; unused slots kNoIndex. Made when needed
};

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

/// Fills depth and direction of all penetrations of one body into another (Heidelberger et al. 2004): `first` .. `last`
/// of a list in which they stand together, ordered by particle. One for which no direction can be found keeps depth 0
/// and a zero direction.
///
/// - Edges of a with one end inside b leave b's boundary at a point with a normal. (Exactly: the face's own normal,
/// where
///   the paper interpolates the vertices'; and the exit nearest to the inner end.) A particle with such edges takes the
///   mean of their depths and normals, weighted with 1 / distance^2.
/// - The others take the mean over their neighbours that are done, layer by layer.
/// - Where no edge of a connected group leaves b (one body within another, or a body without edges), the group's
/// particle
///   nearest to a boundary face of b starts the layers: the whole group then leaves the same way.
void computePenetrationDepths(const std::vector<ContactBody>& bodies, Penetration* first, Penetration* last) {
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

}  // namespace

std::vector<Penetration> findPenetrations(const std::vector<ContactBody>& bodies, ContactCounters& counters) {
  std::vector<Box> boxes;
  for (const ContactBody& body : bodies) boxes.push_back(body.positions ? body.bounds : Box());
  BroadPhase broad;
  std::vector<std::vector<Index>> visitors(bodies.size());  // bodies whose particles one may contain, ascending
  for (const auto& [a, b] : broad.find(boxes, std::vector<char>(bodies.size(), 1))) {
    ++counters.pairs;
    for (const auto& [visitor, of] : {std::pair(a, b), std::pair(b, a)})
      if (bodies[of].mesh && !bodies[of].mesh->tetrahedra.empty()) visitors[of].push_back(visitor);
  }
  std::vector<Penetration> found;
  for (Index b = 0; b < bodies.size(); ++b) {
    if (visitors[b].empty()) continue;
    Container container(bodies, b);
    for (const Index a : visitors[b]) container.find(a, counters.tested, found);
  }
  counters.penetrating += found.size();
  for (std::size_t first = 0; first < found.size();) {
    std::size_t last = first + 1;
    while (last < found.size() && found[last].body_a == found[first].body_a &&
           found[last].body_b == found[first].body_b)
      ++last;
    computePenetrationDepths(bodies, found.data() + first, found.data() + last);
    first = last;
  }
  std::sort(found.begin(), found.end(), [](const Penetration& p, const Penetration& q) {
    return std::array<Index, 3>{p.body_a, p.particle, p.body_b} < std::array<Index, 3>{q.body_a, q.particle, q.body_b};
  });
  return found;
}

void addRow(const Penetration& penetration, const std::vector<ContactBody>& bodies, double friction, RowSet& set) {
  if (!(penetration.depth > 0.0) || !penetration.direction.allFinite()) return;
  const ContactBody &a = bodies[penetration.body_a], &b = bodies[penetration.body_b];
  const Tetrahedron& corners = b.mesh->tetrahedra[penetration.tetrahedron];
  ContactRow row;
  row.features = {penetration.particle, penetration.tetrahedron};
  row.normal = penetration.direction;
  row.friction = friction;
  row.begin = static_cast<Index>(set.entries.size());
  set.entries.push_back({1.0, penetration.particle});
  row.middle = row.begin + 1;
  Vec3 sum = (*a.positions)[penetration.particle];
  for (int k = 0; k < 4; ++k) {
    set.entries.push_back({-penetration.weights[k], corners[k]});
    sum -= penetration.weights[k] * (*b.positions)[corners[k]];
  }
  row.end = static_cast<Index>(set.entries.size());
  row.constant = -penetration.depth - row.normal.dot(sum);
  set.rows.push_back(row);
}

}  // namespace meshless
