#include "meshless_surgery/contact/textbook.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "meshless_surgery/contact/broad_phase.h"

#include "penetration_depth.h"

namespace meshless {
namespace {

constexpr double kFlat = 1e-10;    // a tetrahedron whose volume is below this times its cubed size holds nothing
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
