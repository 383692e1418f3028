#include "meshless_surgery/contact/textbook.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "cell_table.h"
#include "penetration_depth.h"

namespace meshless {
namespace {

constexpr double kFlat = 1e-10;    // a tetrahedron whose volume is below this times its cubed size holds nothing
constexpr double kOnFace = 1e-10;  // barycentric slack, so that no particle is lost between two tetrahedra
constexpr std::int64_t kMaxCellsOfTetrahedron = 512;

bool canContain(const ContactBody& body) { return body.mesh && !body.mesh->tetrahedra.empty(); }

Box intersection(const Box& a, const Box& b) { return {a.min.cwiseMax(b.min), a.max.cwiseMin(b.max)}; }

/// Pairs with overlapping bounds, swept along x: {lower, higher} body, sorted.
std::vector<std::array<Index, 2>> overlappingPairs(const std::vector<ContactBody>& bodies) {
  std::vector<Index> order;
  for (Index k = 0; k < bodies.size(); ++k)
    if (!bodies[k].bounds.empty() && bodies[k].positions) order.push_back(k);  // bounds with NaN are empty
  std::sort(order.begin(), order.end(), [&](Index a, Index b) {
    const double x = bodies[a].bounds.min.x(), y = bodies[b].bounds.min.x();
    return x != y ? x < y : a < b;
  });
  std::vector<std::array<Index, 2>> pairs;
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1; j < order.size(); ++j) {
      const Box &first = bodies[order[i]].bounds, &second = bodies[order[j]].bounds;
      if (second.min.x() > first.max.x()) break;
      if (first.overlaps(second)) pairs.push_back({std::min(order[i], order[j]), std::max(order[i], order[j])});
    }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

struct HashedParticle {
  Index body, particle;
};

/// The tetrahedra of bodies that have a partner, against the particles that lie in the bounds of a partner.
class ParticleSearch {
 public:
  ParticleSearch(const std::vector<ContactBody>& bodies, const std::vector<std::array<Index, 2>>& pairs,
                 ContactCounters& counters)
      : bodies_(bodies), counters_(counters), partners_(bodies.size()) {
    visitors_.resize(bodies.size());
    for (const auto& pair : pairs) {
      for (int side = 0; side < 2; ++side) {
        if (!canContain(bodies[pair[side]])) continue;
        partners_[pair[1 - side]].push_back(pair[side]);
        visitors_[pair[side]].push_back(pair[1 - side]);
      }
    }
    is_visitor_.assign(bodies.size(), false);
    collectParticles();
    if (particles_.empty()) return;
    const double edge = meanEdge();
    if (!(edge > 0.0) || !std::isfinite(edge)) return;
    static thread_local CellTable table;
    table.start(region_, edge, particles_.size());
    for (Index k = 0; k < particles_.size(); ++k) table.insert(table.cellOf(at(particles_[k])), k);
    counters_.hashed += particles_.size();
    for (Index b = 0; b < bodies_.size(); ++b)
      if (!visitors_[b].empty()) searchBody(b, table);
  }

  std::vector<Penetration> takeFound() {
    // A particle may lie on a face between two tetrahedra, or in a fold: it keeps the first.
    std::sort(found_.begin(), found_.end(), [](const Penetration& p, const Penetration& q) {
      return std::array<Index, 4>{p.body_a, p.body_b, p.particle, p.tetrahedron} <
             std::array<Index, 4>{q.body_a, q.body_b, q.particle, q.tetrahedron};
    });
    found_.erase(std::unique(found_.begin(), found_.end(),
                             [](const Penetration& p, const Penetration& q) {
                               return p.body_a == q.body_a && p.body_b == q.body_b && p.particle == q.particle;
                             }),
                 found_.end());
    return std::move(found_);
  }

 private:
  const Vec3& at(const HashedParticle& p) const { return (*bodies_[p.body].positions)[p.particle]; }

  void collectParticles() {
    for (Index a = 0; a < bodies_.size(); ++a) {
      if (partners_[a].empty()) continue;
      std::vector<Box> overlaps;
      for (Index b : partners_[a]) overlaps.push_back(intersection(bodies_[a].bounds, bodies_[b].bounds));
      const Points& positions = *bodies_[a].positions;
      for (Index k = 0; k < positions.size(); ++k) {
        const Vec3& p = positions[k];
        if (std::none_of(overlaps.begin(), overlaps.end(), [&](const Box& box) { return box.contains(p); })) continue;
        particles_.push_back({a, k});
        region_.extend(p);
      }
    }
  }

  /// Mean edge [m] of the tetrahedra that may contain something: the best cell size by Teschner et al.
  double meanEdge() const {
    double sum = 0.0;
    std::size_t count = 0;
    for (Index b = 0; b < bodies_.size(); ++b) {
      if (visitors_[b].empty()) continue;
      for (const Tetrahedron& t : bodies_[b].mesh->tetrahedra) {
        const Points& x = *bodies_[b].positions;
        const double length = (x[t[0]] - x[t[1]]).norm() + (x[t[2]] - x[t[3]]).norm();
        if (!std::isfinite(length)) continue;
        sum += length;
        count += 2;
      }
    }
    return count ? sum / static_cast<double>(count) : 0.0;
  }

  void searchBody(Index b, const CellTable& table) {
    const std::vector<Tetrahedron>& tetrahedra = bodies_[b].mesh->tetrahedra;
    const Points& x = *bodies_[b].positions;
    for (Index a : visitors_[b]) is_visitor_[a] = true;
    const Box reach = intersection(region_, bodies_[b].bounds);
    for (Index t = 0; t < tetrahedra.size(); ++t) {
      Box box;
      bool finite = true;
      for (Index corner : tetrahedra[t]) {
        finite = finite && x[corner].allFinite();
        box.extend(x[corner]);
      }
      if (!finite || !box.overlaps(reach)) continue;
      const double size = box.diagonal();
      Mat3 edges;
      for (int k = 0; k < 3; ++k) edges.col(k) = x[tetrahedra[t][k + 1]] - x[tetrahedra[t][0]];
      if (!(std::abs(edges.determinant()) > kFlat * size * size * size)) continue;
      const Mat3 inverse = edges.inverse();
      const auto test = [&](Index k) {
        const HashedParticle& particle = particles_[k];
        if (!is_visitor_[particle.body] || !box.contains(at(particle))) return;
        ++counters_.tested;
        testParticle(particle, b, t, inverse);
      };
      const CellRange range = table.cellsOf(box);
      // A tetrahedron torn out of all measure covers any number of cells: the particles are fewer.
      if (range.count() > kMaxCellsOfTetrahedron)
        for (Index k = 0; k < particles_.size(); ++k) test(k);
      else
        table.forEach(range, test);
    }
    for (Index a : visitors_[b]) is_visitor_[a] = false;
  }

  void testParticle(const HashedParticle& particle, Index b, Index t, const Mat3& inverse) {
    const Tetrahedron& corners = bodies_[b].mesh->tetrahedra[t];
    const Vec3 w = inverse * (at(particle) - (*bodies_[b].positions)[corners[0]]);
    const std::array<double, 4> weights{1.0 - w.sum(), w[0], w[1], w[2]};
    for (double weight : weights)
      if (!(weight >= -kOnFace)) return;
    if (*std::min_element(weights.begin(), weights.end()) <= kOnFace && liesOnBoundary(b, corners, weights)) return;
    Penetration found;
    found.body_a = particle.body;
    found.particle = particle.particle;
    found.body_b = b;
    found.tetrahedron = t;
    found.weights = weights;
    found_.push_back(found);
  }

  /// True where the face, edge or vertex of the tetrahedron that the weights name is one of the boundary: the particle
  /// touches the body and is not inside.
  bool liesOnBoundary(Index b, const Tetrahedron& corners, const std::array<double, 4>& weights) {
    Triangle simplex{kNoIndex, kNoIndex, kNoIndex};
    int size = 0;
    for (int k = 0; k < 4 && size < 3; ++k)
      if (weights[k] > kOnFace) simplex[size++] = corners[k];
    std::sort(simplex.begin(), simplex.end());
    if (boundary_body_ != b) {
      boundary_body_ = b;
      boundary_.clear();
      for (Triangle face : bodies_[b].mesh->faces) {
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
  ContactCounters& counters_;
  std::vector<std::vector<Index>> partners_;  // bodies that may contain this one's particles
  std::vector<std::vector<Index>> visitors_;  // bodies whose particles this one may contain
  std::vector<bool> is_visitor_;              // of the body that is searched
  std::vector<HashedParticle> particles_;
  Box region_;  // of the hashed particles
  Index boundary_body_ = kNoIndex;
  std::vector<Triangle> boundary_;  // faces, edges and vertices of boundary_body_, sorted; unused slots kNoIndex
  std::vector<Penetration> found_;
};

}  // namespace

std::vector<Penetration> findPenetrations(const std::vector<ContactBody>& bodies, ContactCounters& counters) {
  const std::vector<std::array<Index, 2>> pairs = overlappingPairs(bodies);
  counters.pairs += pairs.size();
  if (pairs.empty()) return {};
  std::vector<Penetration> found = ParticleSearch(bodies, pairs, counters).takeFound();
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
  row.gap = -penetration.depth;
  row.constant = row.gap - row.normal.dot(sum);
  set.rows.push_back(row);
}

}  // namespace meshless
