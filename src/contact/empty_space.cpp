#include "empty_space.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "meshless_surgery/geometry/measures.h"

namespace meshless {
namespace {

constexpr double kMostCells = 1 << 17;
constexpr double kRounding = 1e-6;  // relative, of what is kept in single precision

// Each edge counts once in either direction where the surface is closed, and cancels.
bool isClosed(const TriangleMesh& mesh) {
  std::uint64_t sum = 0;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      const std::uint64_t a = t[k], b = t[(k + 1) % 3];
      std::uint64_t hash = (std::min(a, b) << 32 | std::max(a, b)) + 0x9E3779B97F4A7C15u;  // splitmix64
      hash = (hash ^ (hash >> 30)) * 0xBF58476D1CE4E5B9u;
      hash = (hash ^ (hash >> 27)) * 0x94D049BB133111EBu;
      hash ^= hash >> 31;
      sum += a < b ? hash : ~hash + 1;
    }
  return sum == 0 && !mesh.triangles.empty();
}

// The cells that the bounds of a triangle and its plane touch.
void mark(const TriangleMesh& mesh, const Grid& grid, double rounding, std::vector<char>& taken) {
  for (const Triangle& t : mesh.triangles) {
    const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    const Vec3 normal = (b - a).cross(c - a).normalized();
    const double reach = 0.5 * grid.edge * normal.cwiseAbs().sum() + rounding;
    const Vec3 slack = Vec3::Constant(rounding);
    const std::array<int, 3> first = grid.cellAt(a.cwiseMin(b).cwiseMin(c) - slack),
                             last = grid.cellAt(a.cwiseMax(b).cwiseMax(c) + slack);
    for (int x = first[0]; x <= last[0]; ++x)
      for (int y = first[1]; y <= last[1]; ++y)
        for (int z = first[2]; z <= last[2]; ++z) {
          const Vec3 centre = grid.origin + grid.edge * Vec3(x + 0.5, y + 0.5, z + 0.5);
          if (!(std::abs(normal.dot(centre - a)) > reach)) taken[grid.number(x, y, z)] = 1;
        }
  }
}

// The cells that can be reached from the first corner, which no triangle touches, through cells that none touches.
std::vector<char> outsideOf(const Grid& grid, const std::vector<char>& taken) {
  std::vector<char> outside(taken.size(), 0);
  std::vector<std::array<int, 3>> from{{{0, 0, 0}}};
  outside[0] = 1;
  while (!from.empty()) {
    const std::array<int, 3> at = from.back();
    from.pop_back();
    for (int d = 0; d < 3; ++d)
      for (int step = -1; step <= 1; step += 2) {
        std::array<int, 3> to = at;
        to[d] += step;
        if (to[d] < 0 || to[d] >= grid.counts[d]) continue;
        const std::size_t number = grid.number(to[0], to[1], to[2]);
        if (taken[number] || outside[number]) continue;
        outside[number] = 1;
        from.push_back(to);
      }
  }
  return outside;
}

// forRows(d, visit): the first cell of each row along d, and how far its cells are apart.
template <class Visit>
void forRows(const Grid& grid, int d, const Visit& visit) {
  const std::size_t strides[3] = {static_cast<std::size_t>(grid.counts[1]) * grid.counts[2],
                                  static_cast<std::size_t>(grid.counts[2]), 1};
  const int u = (d + 1) % 3, v = (d + 2) % 3;
  for (int i = 0; i < grid.counts[u]; ++i)
    for (int j = 0; j < grid.counts[v]; ++j) visit(i * strides[u] + j * strides[v], strides[d]);
}

// To each cell the square of how many cells it is from the next one that is taken, or beside one: between the cells
// themselves, not their centres, there is at least so much. By rows, with the lower envelope of parabolas
// (Felzenszwalb and Huttenlocher 2012).
std::vector<float> squaresTo(const Grid& grid, std::vector<char> taken) {
  std::vector<char> row;
  for (int d = 0; d < 3; ++d)
    forRows(grid, d, [&](std::size_t first, std::size_t stride) {
      const int n = grid.counts[d];
      row.resize(static_cast<std::size_t>(n));
      for (int k = 0; k < n; ++k) row[k] = taken[first + k * stride];
      for (int k = 0; k < n; ++k)
        taken[first + k * stride] = row[k] || (k > 0 && row[k - 1]) || (k + 1 < n && row[k + 1]);
    });
  constexpr float kNone = std::numeric_limits<float>::infinity();
  std::vector<float> squares(taken.size());
  for (std::size_t k = 0; k < taken.size(); ++k) squares[k] = taken[k] ? 0.0F : kNone;
  std::vector<double> heights, starts;
  std::vector<int> lowest;
  for (int d = 0; d < 3; ++d)
    forRows(grid, d, [&](std::size_t first, std::size_t stride) {
      const int n = grid.counts[d];
      heights.resize(static_cast<std::size_t>(n));
      lowest.clear();
      starts.clear();
      for (int k = 0; k < n; ++k) {
        const double height = squares[first + k * stride];
        heights[k] = height;
        if (height == kNone) continue;
        double start = -kNone;
        while (!lowest.empty()) {
          const int m = lowest.back();
          start = 0.5 * ((height - heights[m]) / (k - m) + (k + m));
          if (start > starts.back()) break;
          lowest.pop_back();
          starts.pop_back();
          start = -kNone;
        }
        lowest.push_back(k);
        starts.push_back(start);
      }
      if (lowest.empty()) return;
      std::size_t at = 0;
      for (int k = 0; k < n; ++k) {
        while (at + 1 < lowest.size() && starts[at + 1] < k) ++at;
        const double apart = k - lowest[at];
        squares[first + k * stride] = static_cast<float>(heights[lowest[at]] + apart * apart);
      }
    });
  return squares;
}

}  // namespace

EmptySpace::EmptySpace(const TriangleMesh& surface, double edge) {
  Box bounds;
  for (const Vec3& p : surface.vertices) bounds.extend(p);
  if (bounds.empty() || !(edge > 0.0) || !std::isfinite(bounds.diagonal()) || !isClosed(surface)) return;
  if (!(signedVolume(surface) > 0.0)) return;  // inside out: what is around it is its inside
  const Vec3 extent = bounds.max - bounds.min;
  const auto cells = [&](double of, int d) { return std::ceil(extent[d] / of) + 4.0; };
  while (!(cells(edge, 0) * cells(edge, 1) * cells(edge, 2) <= kMostCells)) edge *= 1.1;
  if (!std::isfinite(edge)) return;
  grid_.edge = edge;
  grid_.origin = bounds.min.array() - 2.0 * edge;
  std::size_t total = 1;
  for (int d = 0; d < 3; ++d) {
    grid_.counts[d] = static_cast<int>(cells(edge, d));
    total *= static_cast<std::size_t>(grid_.counts[d]);
  }
  std::vector<char> taken(total, 0);
  mark(surface, grid_, 1e-9 * (bounds.diagonal() + edge), taken);
  const std::vector<char> outside = outsideOf(grid_, taken);
  gaps_ = squaresTo(grid_, std::move(taken));
  for (std::size_t k = 0; k < total; ++k)
    gaps_[k] = outside[k] ? static_cast<float>((1.0 - kRounding) * edge) * std::sqrt(gaps_[k]) : -1.0F;
}

// Beyond the cells a point is at least as far from everything as the cell at the border is.
double EmptySpace::around(const Vec3& point) const {
  if (!known() || !point.allFinite()) return 0.0;
  const std::array<int, 3> at = grid_.cellAt(point);
  return std::max(0.0F, gaps_[grid_.number(at[0], at[1], at[2])]);
}

bool EmptySpace::isOutside(const Vec3& point) const {
  if (!known() || !point.allFinite()) return false;
  const std::array<int, 3> at = grid_.cellAt(point);
  return gaps_[grid_.number(at[0], at[1], at[2])] >= 0.0F;
}

}  // namespace meshless
