#include "meshless_surgery/geometry/cell_lattice.h"

#include <cmath>
#include <numeric>
#include <sstream>

#include "meshless_surgery/geometry/measures.h"

namespace meshless {
namespace {

constexpr int kSub = 4;  // samples of a cell along each axis
constexpr int kSamples = kSub * kSub * kSub;

class UnionFind {
 public:
  explicit UnionFind(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0u); }
  Index find(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  // The lower index stays the root, so that the result does not depend on the order.
  void join(Index a, Index b) {
    a = find(a);
    b = find(b);
    if (a < b) parent_[b] = a;
    if (b < a) parent_[a] = b;
  }

 private:
  std::vector<Index> parent_;
};

// Which of the samples of each cell lie in the solid, and which part of the cell they belong to (kNoPart: outside).
constexpr std::uint8_t kNoPart = 255;
using Parts = std::array<std::uint8_t, kSamples>;

int sampleAt(int x, int y, int z) { return x + kSub * (y + kSub * z); }

// Numbers the parts that are joined by faces of samples; returns how many.
int numberParts(const std::array<bool, kSamples>& inside, Parts& parts) {
  parts.fill(kNoPart);
  int count = 0;
  std::array<int, kSamples> stack;
  for (int start = 0; start < kSamples; ++start) {
    if (!inside[start] || parts[start] != kNoPart) continue;
    int depth = 0;
    stack[depth++] = start;
    parts[start] = static_cast<std::uint8_t>(count);
    while (depth > 0) {
      const int at = stack[--depth];
      const int place[3] = {at % kSub, at / kSub % kSub, at / (kSub * kSub)};
      const int stride[3] = {1, kSub, kSub * kSub};
      for (int axis = 0; axis < 3; ++axis)
        for (int step : {-1, 1}) {
          if (place[axis] + step < 0 || place[axis] + step >= kSub) continue;
          const int next = at + step * stride[axis];
          if (!inside[next] || parts[next] != kNoPart) continue;
          parts[next] = static_cast<std::uint8_t>(count);
          stack[depth++] = next;
        }
    }
    ++count;
  }
  return count;
}

}  // namespace

Result<CellLattice> divideIntoCells(const TriangleMesh& mesh, const SolidQuery& solid, double spacing,
                                    std::size_t max_cells) {
  const Box bounds = boundsOf(mesh.vertices);
  const Vec3 extent = bounds.max - bounds.min;
  std::array<long, 3> n;
  double boxes = 1.0;
  for (int k = 0; k < 3; ++k) {
    const double count = std::max(1.0, std::ceil(extent[k] / spacing - 1e-6));
    boxes *= count;
    n[k] = count < 1e9 ? static_cast<long>(count) : 0;
  }
  if (!(spacing > 0.0) || !(boxes <= static_cast<double>(max_cells))) {
    std::ostringstream text;
    text << "spacing is " << spacing << " m, which makes " << boxes << " cells; accepted: at most " << max_cells;
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }
  const Vec3 origin = 0.5 * (bounds.min + bounds.max) - 0.5 * spacing * Vec3(n[0], n[1], n[2]);
  const auto cellAt = [&](long x, long y, long z) { return static_cast<std::size_t>(x + n[0] * (y + n[1] * z)); };

  // Samples: those of a cell far from the surface are all as its middle is.
  const std::size_t total = static_cast<std::size_t>(n[0] * n[1] * n[2]);
  std::vector<Parts> parts(total);
  std::vector<Index> first_part(total + 1, 0);
  for (long z = 0; z < n[2]; ++z)
    for (long y = 0; y < n[1]; ++y)
      for (long x = 0; x < n[0]; ++x) {
        const Vec3 corner = origin + spacing * Vec3(x, y, z);
        const Vec3 middle = corner + Vec3::Constant(0.5 * spacing);
        std::array<bool, kSamples> inside;
        if (solid.distance(middle) > 0.8661 * spacing) {
          inside.fill(solid.contains(middle));
        } else {
          for (int k = 0; k < kSamples; ++k)
            inside[k] = solid.contains(
                corner + spacing / kSub * (Vec3(k % kSub, k / kSub % kSub, k / (kSub * kSub)) + Vec3::Constant(0.5)));
        }
        const std::size_t cell = cellAt(x, y, z);
        first_part[cell + 1] = static_cast<Index>(numberParts(inside, parts[cell]));
      }
  for (std::size_t c = 0; c < total; ++c) first_part[c + 1] += first_part[c];
  if (first_part[total] == 0) {
    std::ostringstream text;
    text << "spacing is " << spacing << " m, and no sample of a quarter of it lies in the solid; accepted: less";
    return Error{ErrorCode::kUnsuitableShape, text.str()};
  }

  // Corners of parts that continue into each other through a face are the same.
  UnionFind corners(static_cast<std::size_t>(first_part[total]) * 8);
  for (long z = 0; z < n[2]; ++z)
    for (long y = 0; y < n[1]; ++y)
      for (long x = 0; x < n[0]; ++x) {
        const std::size_t a = cellAt(x, y, z);
        const long place[3] = {x, y, z};
        for (int axis = 0; axis < 3; ++axis) {
          if (place[axis] + 1 >= n[axis]) continue;
          const std::size_t b = cellAt(x + (axis == 0), y + (axis == 1), z + (axis == 2));
          for (int u = 0; u < kSub; ++u)
            for (int v = 0; v < kSub; ++v) {
              int upper[3], lower[3];
              upper[axis] = kSub - 1, lower[axis] = 0;
              upper[(axis + 1) % 3] = lower[(axis + 1) % 3] = u;
              upper[(axis + 2) % 3] = lower[(axis + 2) % 3] = v;
              const std::uint8_t pa = parts[a][sampleAt(upper[0], upper[1], upper[2])];
              const std::uint8_t pb = parts[b][sampleAt(lower[0], lower[1], lower[2])];
              if (pa == kNoPart || pb == kNoPart) continue;
              for (Index corner = 0; corner < 8; ++corner)
                if (corner >> axis & 1)
                  corners.join((first_part[a] + pa) * 8 + corner, (first_part[b] + pb) * 8 + (corner ^ (1u << axis)));
            }
        }
      }

  CellLattice lattice;
  lattice.spacing = spacing;
  std::vector<Index> number(static_cast<std::size_t>(first_part[total]) * 8, kNoIndex);
  for (long z = 0; z < n[2]; ++z)
    for (long y = 0; y < n[1]; ++y)
      for (long x = 0; x < n[0]; ++x) {
        const std::size_t cell = cellAt(x, y, z);
        for (Index part = first_part[cell]; part < first_part[cell + 1]; ++part) {
          CellLattice::Cell made;
          int filled = 0;
          for (std::uint8_t p : parts[cell]) filled += p == part - first_part[cell];
          made.fraction = static_cast<double>(filled) / kSamples;
          for (Index corner = 0; corner < 8; ++corner) {
            Index& at = number[corners.find(part * 8 + corner)];
            if (at == kNoIndex) {
              at = static_cast<Index>(lattice.corners.size());
              lattice.corners.push_back(origin +
                                        spacing * Vec3(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2 & 1)));
            }
            made.corners[corner] = at;
          }
          lattice.cells.push_back(made);
        }
      }
  return lattice;
}

}  // namespace meshless
