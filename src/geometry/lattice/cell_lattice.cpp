#include "meshless_surgery/geometry/lattice/cell_lattice.h"

#include <cmath>
#include <limits>
#include <map>
#include <sstream>
#include <utility>

#include "meshless_surgery/base/compressed_rows.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {
namespace {

// The samples of a cell that lie in the solid. Those of a cell far from the surface are all as its middle is.
SampleSet samplesInside(const SolidQuery& solid, const Vec3& lower, double spacing) {
  const Vec3 middle = lower + Vec3::Constant(0.5 * spacing);
  if (solid.distance(middle) > 0.8661 * spacing) return solid.contains(middle) ? kAllSamples : kNoSample;
  SampleSet inside = kNoSample;
  for (int bit = 0; bit < 64; ++bit)
    if (solid.contains(lower + spacing * samplePlace(bit))) inside |= SampleSet{1} << bit;
  return inside;
}

// [sample^2] between the nearest samples of two cells.
double squaredBetween(const LatticeCell& a, const LatticeCell& b) {
  double least = std::numeric_limits<double>::infinity();
  const Vec3 apart(b.place[0] - a.place[0], b.place[1] - a.place[1], b.place[2] - a.place[2]);
  for (SampleSet of_a = a.samples; of_a; of_a &= of_a - 1)
    for (SampleSet of_b = b.samples; of_b; of_b &= of_b - 1)
      least =
          std::min(least, (samplePlace(lowestSample(of_b)) + apart - samplePlace(lowestSample(of_a))).squaredNorm());
  return least;
}

// Which corners of cells are the same, and which cells hang together.
struct Joiner {
  explicit Joiner(const std::vector<LatticeCell>& of) : cells(of), corners(of.size() * 8), parts(of.size()) {}

  void join(Index a, Index b) {
    parts.join(a, b);
    for (Index k = 0; k < 8; ++k) {
      Index other = 0;
      bool shared = true;
      for (int axis = 0; axis < 3; ++axis) {
        const int up = static_cast<int>(k >> axis & 1) + cells[a].place[axis] - cells[b].place[axis];
        shared = shared && (up == 0 || up == 1);
        other |= static_cast<Index>(up & 1) << axis;
      }
      if (shared) corners.join(a * 8 + k, b * 8 + other);
    }
  }

  // The tip of a fin can hang together with the rest by less than samples see. What is less than a cell goes with the
  // nearest tissue beside it. at: the cells at a place, from the first to before the last.
  template <class At>
  void joinCrumbs(const At& at) {
    for (bool again = true; std::exchange(again, false);) {
      struct Nearest {
        double squared = std::numeric_limits<double>::infinity();
        Index a = kNoIndex, b = kNoIndex;
      };
      std::vector<int> samples(cells.size(), 0);
      for (Index c = 0; c < cells.size(); ++c) samples[parts.find(c)] += countSamples(cells[c].samples);
      std::map<Index, Nearest> crumbs;
      for (Index a = 0; a < cells.size(); ++a) {
        if (samples[parts.find(a)] >= kCellSamples * kCellSamples * kCellSamples) continue;
        Nearest& nearest = crumbs[parts.find(a)];
        for (int side = 0; side < 27; ++side) {
          auto [b, end] = at({cells[a].place[0] + side % 3 - 1, cells[a].place[1] + side / 3 % 3 - 1,
                              cells[a].place[2] + side / 9 - 1});
          for (; b < end; ++b) {
            if (parts.find(b) == parts.find(a)) continue;
            if (const double squared = squaredBetween(cells[a], cells[b]); squared < nearest.squared)
              nearest = {squared, a, b};
          }
        }
      }
      for (const auto& [part, nearest] : crumbs) {
        if (nearest.a == kNoIndex || parts.find(nearest.a) == parts.find(nearest.b)) continue;
        join(nearest.a, nearest.b);
        again = true;
      }
    }
  }

  const std::vector<LatticeCell>& cells;
  UnionFind corners;  // eight a cell
  UnionFind parts;    // of cells
};

}  // namespace

Points cornerPlaces(const CellLattice& lattice) {
  Points places(lattice.corners);
  for (const LatticeCell& cell : lattice.cells)
    for (int k = 0; k < 8; ++k) places[cell.corners[k]] = lattice.restPlace(cell, Vec3(k & 1, k >> 1 & 1, k >> 2 & 1));
  return places;
}

CornerUses cornerUses(const CellLattice& lattice) {
  CornerUses uses;
  const auto each = [&](const auto& visit) {
    for (Index c = 0; c < lattice.cells.size(); ++c)
      for (const Index corner : lattice.cells[c].corners) visit(corner, c);
  };
  compressRows(lattice.corners, each, uses.offsets, uses.cells);
  return uses;
}

Result<CellLattice> divideIntoCells(const TriangleMesh& mesh, const SolidQuery& solid, double spacing,
                                    std::size_t max_cells) {
  const Box bounds = boundsOf(mesh.vertices);
  const Vec3 extent = bounds.max - bounds.min;
  std::array<std::int32_t, 3> n;
  double boxes = 1.0;
  for (int k = 0; k < 3; ++k) {
    const double count = std::max(1.0, std::ceil(extent[k] / spacing - 1e-6));
    boxes *= count;
    n[k] = count < 1e9 ? static_cast<std::int32_t>(count) : 0;
  }
  if (!(spacing > 0.0) || !(boxes <= static_cast<double>(max_cells))) {
    std::ostringstream text;
    text << "spacing is " << spacing << " m, which makes " << boxes << " cells; accepted: at most " << max_cells;
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }
  CellLattice lattice;
  lattice.spacing = spacing;
  lattice.origin = 0.5 * (bounds.min + bounds.max) - 0.5 * spacing * Vec3(n[0], n[1], n[2]);
  const auto at = [&](std::int32_t x, std::int32_t y, std::int32_t z) {
    return static_cast<std::size_t>(x) + static_cast<std::size_t>(n[0]) * (y + static_cast<std::size_t>(n[1]) * z);
  };
  // The parts in the cells, in lattice order.
  std::vector<Index> first(static_cast<std::size_t>(boxes) + 1, 0);
  for (std::int32_t z = 0; z < n[2]; ++z)
    for (std::int32_t y = 0; y < n[1]; ++y)
      for (std::int32_t x = 0; x < n[0]; ++x) {
        LatticeCell cell;
        cell.place = {x, y, z};
        SampleSet inside = samplesInside(solid, lattice.restPlace(cell, Vec3::Zero()), spacing);
        while (inside) {
          cell.samples = cell.filled = connectedPart(inside, cell.parted);
          inside &= ~cell.samples;
          const FilledMoments moments = momentsOf(cell.filled);
          cell.resists = {moments.fraction, moments.centroid, moments.variance};
          lattice.cells.push_back(cell);
        }
        first[at(x, y, z) + 1] = static_cast<Index>(lattice.cells.size());
      }
  if (lattice.cells.empty()) {
    std::ostringstream text;
    text << "spacing is " << spacing << " m, and no sample of a quarter of it lies in the solid; accepted: less";
    return Error{ErrorCode::kUnsuitableShape, text.str()};
  }

  // Corners of parts that continue into each other through a face are the same.
  Joiner joiner(lattice.cells);
  for (Index a = 0; a < lattice.cells.size(); ++a) {
    const LatticeCell& lower = lattice.cells[a];
    for (int axis = 0; axis < 3; ++axis) {
      if (lower.place[axis] + 1 >= n[axis]) continue;
      const std::size_t next =
          at(lower.place[0] + (axis == 0), lower.place[1] + (axis == 1), lower.place[2] + (axis == 2));
      for (Index b = first[next]; b < first[next + 1]; ++b)
        if (faceLinks(lower.samples, lattice.cells[b].samples, axis)) joiner.join(a, b);
    }
  }
  joiner.joinCrumbs([&](const std::array<std::int32_t, 3>& place) {
    for (int k = 0; k < 3; ++k)
      if (place[k] < 0 || place[k] >= n[k]) return std::make_pair(Index{0}, Index{0});
    const std::size_t here = at(place[0], place[1], place[2]);
    return std::make_pair(first[here], first[here + 1]);
  });
  std::vector<Index> number(lattice.cells.size() * 8, kNoIndex);
  for (Index c = 0; c < lattice.cells.size(); ++c)
    for (Index k = 0; k < 8; ++k) {
      Index& known = number[joiner.corners.find(c * 8 + k)];
      if (known == kNoIndex) known = lattice.corners++;
      lattice.cells[c].corners[k] = known;
    }
  return lattice;
}

}  // namespace meshless
