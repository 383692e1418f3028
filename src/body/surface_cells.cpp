#include "surface_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace meshless {
namespace {

constexpr double kWorst = 20.0;       // [length of the edge] a jump that is not told from a larger one
constexpr double kDistance = 0.25;    // cost of a sample one spacing away: it decides where the surface does not
constexpr double kFarthest = 1.0;     // [spacing] outside of a cell that is taken over
constexpr double kLeastShare = 0.01;  // of what a vertex follows
constexpr double kEased = 1.02;       // [length of the edge] a jump that is left
constexpr double kSmooth = 2.0;  // [length of the edge] a jump of maps that fit: at a face their weights have kinks
constexpr int kMostSweeps = 20;

// Which of b's corners has the place of each of a's; -1: none.
std::array<int, 8> samePlaces(const LatticeCell& a, const LatticeCell& b) {
  std::array<int, 8> same{};
  for (int k = 0; k < 8; ++k)
    for (int axis = 0; axis < 3; ++axis) {
      const int in_b = a.place[axis] + (k >> axis & 1) - b.place[axis];
      if (in_b < 0 || in_b > 1)
        same[k] = -1;
      else if (same[k] >= 0)
        same[k] |= in_b << axis;
    }
  return same;
}

// Whether there are copies of the same corner of which each has one.
bool tornApart(const LatticeCell& a, const LatticeCell& b) {
  const std::array<int, 8> same = samePlaces(a, b);
  for (int k = 0; k < 8; ++k)
    if (same[k] >= 0 && a.corners[k] != b.corners[same[k]]) return true;
  return false;
}

// The jump at a point between two maps that are extended to it: how far the weights of corners differ. Torn: as far as
// different copies of the same corners have them.
struct Jump {
  double all = 0.0, torn = 0.0;
};

class SurfaceEdges {
 public:
  SurfaceEdges(const CellLattice& lattice, const TriangleMesh& rest) : lattice_(lattice), rest_(rest) {}

  template <class Use>
  void forEach(const Use& use) const {
    for (const Triangle& t : rest_.triangles)
      for (int k = 0; k < 3; ++k)
        if (t[k] < t[(k + 1) % 3]) use(t[k], t[(k + 1) % 3]);
  }

  // [length of the edge, in spacings] the least jump on the way from u, which follows a, to v, which follows b.
  Jump leastJump(Index u, const CellShares& a, Index v, const CellShares& b, double enough) {
    const Vec3 &x = rest_.vertices[u], &y = rest_.vertices[v];
    const double length = std::max((y - x).norm() / lattice_.spacing, 1e-6);
    Jump least{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
    const bool two = a.size() == 1 && b.size() == 1;
    const LatticeCell &first = lattice_.cells[a[0].cell], &second = lattice_.cells[b[0].cell];
    const std::array<int, 8> same = two ? samePlaces(first, second) : std::array<int, 8>();
    for (const double t : {0.5, 0.0, 1.0, 0.25, 0.75}) {
      const Vec3 at = x + t * (y - x);
      const Jump here = two ? jumpOfTwo(at, first, second, same) : jumpAt(at, a, b);
      least.all = std::min(least.all, here.all / length);
      least.torn = std::min(least.torn, here.torn / length);
      if (least.all <= enough) break;
    }
    return least;
  }

 private:
  // As jumpAt(), of one cell each, which is the most frequent case.
  Jump jumpOfTwo(const Vec3& rest, const LatticeCell& a, const LatticeCell& b, const std::array<int, 8>& same) const {
    const Vec3 in_a = lattice_.placeIn(a, rest), in_b = lattice_.placeIn(b, rest);
    std::array<double, 8> left;
    for (int k = 0; k < 8; ++k) left[k] = extendedWeight(k, in_b);
    Jump jump;
    for (int k = 0; k < 8; ++k) {
      const double weight = extendedWeight(k, in_a);
      const double other = same[k] < 0 ? 0.0 : std::exchange(left[same[k]], 0.0);
      const double merged = std::abs(weight - other);
      const bool one = same[k] >= 0 && a.corners[k] == b.corners[same[k]];
      const double here = one ? merged : std::abs(weight) + std::abs(other);
      jump.all += here;
      jump.torn += here - merged;
    }
    for (const double weight : left) jump.all += std::abs(weight);
    return jump;
  }

  Jump jumpAt(const Vec3& rest, const CellShares& a, const CellShares& b) {
    parts_.clear();
    add(rest, a, 1.0);
    add(rest, b, -1.0);
    Jump jump;
    for (const Part& part : parts_) jump.all += std::abs(part.weight);
    jump.torn = jump.all;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      if (parts_[i].counted) continue;
      double sum = 0.0;
      for (std::size_t j = i; j < parts_.size(); ++j)
        if (parts_[j].place == parts_[i].place) {
          parts_[j].counted = true;
          sum += parts_[j].weight;
        }
      jump.torn -= std::abs(sum);
    }
    return jump;
  }

  // One number for each place of the lattice.
  static std::int64_t placeOf(const LatticeCell& cell, int corner) {
    std::int64_t place = 0;
    for (int axis = 0; axis < 3; ++axis) place = (place << 21) + cell.place[axis] + (corner >> axis & 1);
    return place;
  }

  void add(const Vec3& rest, const CellShares& shares, double sign) {
    for (const CellShare& s : shares) {
      const LatticeCell& cell = lattice_.cells[s.cell];
      const Vec3 at = lattice_.placeIn(cell, rest);
      for (int k = 0; k < 8; ++k) {
        const double weight = sign * s.share * extendedWeight(k, at);
        const auto known = std::find_if(parts_.begin(), parts_.end(),
                                        [&](const Part& part) { return part.corner == cell.corners[k]; });
        if (known != parts_.end())
          known->weight += weight;
        else
          parts_.push_back({placeOf(cell, k), cell.corners[k], weight, false});
      }
    }
  }

  struct Part {
    std::int64_t place;
    Index corner;
    double weight;
    bool counted;
  };
  const CellLattice& lattice_;
  const TriangleMesh& rest_;
  std::vector<Part> parts_;
};

// Some of b's to a.
CellShares mixed(const CellShares& a, const CellShares& b, double share) {
  CellShares mix = a;
  for (CellShare& s : mix) s.share *= 1.0 - share;
  for (const CellShare& s : b) {
    const auto known = std::find_if(mix.begin(), mix.end(), [&](const CellShare& q) { return q.cell == s.cell; });
    if (known != mix.end())
      known->share += share * s.share;
    else
      mix.push_back({s.cell, share * s.share});
  }
  mix.erase(std::remove_if(mix.begin(), mix.end(), [](const CellShare& s) { return s.share < kLeastShare; }),
            mix.end());
  double sum = 0.0;
  for (const CellShare& s : mix) sum += s.share;
  for (CellShare& s : mix) s.share /= sum;
  return mix;
}

void makeUnique(std::vector<Index>& of) {
  std::sort(of.begin(), of.end());
  of.erase(std::unique(of.begin(), of.end()), of.end());
}

}  // namespace

void agreeOnCells(const CellLattice& lattice, const TriangleMesh& rest, const std::vector<bool>& loose,
                  std::vector<Index>& cell) {
  SurfaceEdges edges(lattice, rest);
  CellShares at_u(1), at_v(1);
  const auto excess = [&](Index u, Index a, Index v, Index b) {
    if (a == b) return 0.0;
    if (a == kNoIndex || b == kNoIndex) return kWorst;
    at_u[0].cell = a;
    at_v[0].cell = b;
    return std::clamp(edges.leastJump(u, at_u, v, at_v, kSmooth).all - kSmooth, 0.0, kWorst);
  };
  std::vector<std::vector<Index>> near(cell.size());
  std::vector<Index> wanted;
  edges.forEach([&](Index u, Index v) {
    if (!loose[u] && !loose[v]) return;
    near[u].push_back(v);
    near[v].push_back(u);
    if (excess(u, cell[u], v, cell[v]) > 0.0) wanted.insert(wanted.end(), {u, v});
  });
  const auto costOf = [&](Index v, Index c, double most) {
    double cost = 0.0;
    if (c != kNoIndex) {
      const LatticeCell& own = lattice.cells[c];
      const Vec3 at = lattice.placeIn(own, rest.vertices[v]);
      if (c != cell[v] && (at - at.cwiseMax(0.0).cwiseMin(1.0)).norm() > kFarthest)
        return std::numeric_limits<double>::infinity();
      cost = kDistance * (own.samples ? std::sqrt(squaredToSamples(own.samples, at)) : 1.0);
    }
    for (const Index u : near[v]) {
      cost += excess(v, c, u, cell[u]);
      if (cost > most) break;
    }
    return cost;
  };
  for (int sweep = 0; sweep < kMostSweeps && !wanted.empty(); ++sweep) {
    makeUnique(wanted);
    std::vector<Index> next;
    for (const Index v : wanted) {
      if (!loose[v]) continue;
      Index best = cell[v];
      double least = costOf(v, best, std::numeric_limits<double>::infinity()) - 1e-9;
      for (const Index u : near[v]) {
        if (cell[u] == kNoIndex || cell[u] == cell[v]) continue;
        const double cost = costOf(v, cell[u], least);
        if (!(cost < least)) continue;
        least = cost;
        best = cell[u];
      }
      if (best == cell[v]) continue;
      cell[v] = best;
      next.insert(next.end(), near[v].begin(), near[v].end());
    }
    wanted = std::move(next);
  }
}

std::vector<CellShares> easeAcrossTears(const CellLattice& lattice, const TriangleMesh& rest,
                                        const std::vector<Index>& cell) {
  std::vector<CellShares> shares(cell.size());
  SurfaceEdges edges(lattice, rest);
  CellShares at_u(1), at_v(1);
  const auto sharesOf = [&](Index v, CellShares& alone) -> const CellShares& {
    alone[0].cell = cell[v];
    return shares[v].empty() ? alone : shares[v];
  };
  const auto tear = [&](Index u, Index v) {
    if (shares[u].empty() && shares[v].empty() &&
        (cell[u] == cell[v] || !tornApart(lattice.cells[cell[u]], lattice.cells[cell[v]])))
      return 0.0;
    return edges.leastJump(u, sharesOf(u, at_u), v, sharesOf(v, at_v), 1.0).torn;
  };
  std::vector<std::array<Index, 2>> ends;
  std::vector<Index> wanted;
  edges.forEach([&](Index u, Index v) {
    if (tear(u, v) > kEased) wanted.push_back(static_cast<Index>(ends.size()));
    ends.push_back({u, v});
  });
  if (wanted.empty()) return shares;
  std::vector<std::vector<Index>> around(cell.size());
  for (Index e = 0; e < ends.size(); ++e)
    for (const Index v : ends[e]) around[v].push_back(e);
  for (int sweep = 0; sweep < kMostSweeps && !wanted.empty(); ++sweep) {
    std::vector<Index> next;
    for (const Index e : wanted) {
      const auto [u, v] = ends[e];
      const double jump = tear(u, v);
      if (!(jump > kEased)) continue;
      const double share = 0.5 * (1.0 - 1.0 / jump);
      const CellShares first = sharesOf(u, at_u), second = sharesOf(v, at_v);
      shares[u] = mixed(first, second, share);
      shares[v] = mixed(second, first, share);
      for (const Index w : ends[e]) next.insert(next.end(), around[w].begin(), around[w].end());
    }
    makeUnique(next);
    wanted = std::move(next);
  }
  return shares;
}

}  // namespace meshless
