// How much of each cell of a lattice resists: finer than its samples see.
#include <algorithm>
#include <cmath>

#include "meshless_surgery/geometry/lattice/cell_lattice.h"

namespace meshless {
namespace {

constexpr double kFictitious =
    1e-6;  // what a cell of held tissue resists with (finite cell method: Parvizian et al. 2007)

// Sums over what a cell resists with.
struct Sums {
  double volume = 0.0;  // [cells]
  Vec3 first = Vec3::Zero(), second = Vec3::Zero();
};

class ResistanceFinder {
 public:
  ResistanceFinder(const SolidQuery& solid, const HeldHeight& held, CellLattice& lattice)
      : solid_(solid), held_(held), lattice_(lattice), step_(lattice.spacing / kCellSamples) {}

  void run() {
    if (held_) partAtTheBorder();
    makeTable();
    sums_.resize(lattice_.cells.size());
    for (std::int32_t z = 0; z < size_[2]; ++z)
      for (std::int32_t y = 0; y < size_[1]; ++y)
        for (std::int32_t x = 0; x < size_[0]; ++x) addPlace({x, y, z});
    for (Index c = 0; c < lattice_.cells.size(); ++c) finish(c);
  }

 private:
  using Place = std::array<std::int32_t, 3>;

  void partAtTheBorder() {
    std::vector<LatticeCell>& cells = lattice_.cells;
    for (Index c = 0, count = static_cast<Index>(cells.size()); c < count; ++c) {
      SampleSet held = kNoSample;
      for (SampleSet left = cells[c].samples; left; left &= left - 1)
        if (held_(lattice_.restPlace(cells[c], samplePlace(lowestSample(left)))) <= 0.0) held |= left & ~(left - 1);
      if (!held) continue;
      if (held != cells[c].samples) {
        LatticeCell free = cells[c];
        free.samples = free.filled = cells[c].samples & ~held;
        cells.push_back(free);
      }
      cells[c].samples = cells[c].filled = held;
      cells[c].held = true;
    }
    std::vector<bool> moves(lattice_.corners, false);
    for (const LatticeCell& cell : cells)
      for (const Index corner : cell.corners) moves[corner] = moves[corner] || !cell.held;
    std::vector<Index> stays(lattice_.corners, kNoIndex);
    for (LatticeCell& cell : cells)
      for (Index& corner : cell.corners) {
        if (!cell.held || !moves[corner]) continue;
        if (stays[corner] == kNoIndex) stays[corner] = lattice_.corners++;
        corner = stays[corner];
      }
  }

  // Cells at each place, and one more place all around.
  void makeTable() {
    Place upper = lower_ = lattice_.cells[0].place;
    for (const LatticeCell& cell : lattice_.cells)
      for (int k = 0; k < 3; ++k) {
        lower_[k] = std::min(lower_[k], cell.place[k]);
        upper[k] = std::max(upper[k], cell.place[k]);
      }
    for (int k = 0; k < 3; ++k) {
      --lower_[k];
      size_[k] = upper[k] - lower_[k] + 2;
    }
    table_.resize(static_cast<std::size_t>(size_[0]) * size_[1] * size_[2]);
    for (Index c = 0; c < lattice_.cells.size(); ++c) {
      Place at = lattice_.cells[c].place;
      for (int k = 0; k < 3; ++k) at[k] -= lower_[k];
      table_[indexOf(at)].push_back(c);
    }
  }
  std::size_t indexOf(const Place& at) const {
    return static_cast<std::size_t>(at[0]) +
           static_cast<std::size_t>(size_[0]) * (at[1] + static_cast<std::size_t>(size_[1]) * at[2]);
  }
  bool isPlace(const Place& at) const {
    for (int k = 0; k < 3; ++k)
      if (at[k] < 0 || at[k] >= size_[k]) return false;
    return true;
  }

  void addPlace(const Place& at) {
    const std::vector<Index>& here = table_[indexOf(at)];
    if (here.empty() && !hasNeighbour(at)) return;
    const Vec3 low = lattice_.origin + lattice_.spacing * Vec3(at[0] + lower_[0], at[1] + lower_[1], at[2] + lower_[2]);
    const Vec3 middle = low + Vec3::Constant(0.5 * lattice_.spacing);
    const double half = 0.8661 * lattice_.spacing;
    const bool surface = solid_.distance(middle) <= half;
    if (!surface && here.empty()) return;
    // A region may end at a face of its own: heights are no distances beyond its edges, and grow no faster than them.
    const bool border = held_ && std::abs(held_(middle)) <= half;
    for (int bit = 0; bit < 64; ++bit) {
      const Vec3 p = low + lattice_.spacing * samplePlace(bit);
      const auto owner =
          std::find_if(here.begin(), here.end(), [&](Index c) { return lattice_.cells[c].samples >> bit & 1; });
      const bool inside = owner != here.end();
      addSample(at, bit, p, inside, surface, border, inside && !lattice_.cells[*owner].held ? *owner : kNoIndex);
    }
  }

  bool hasNeighbour(const Place& at) const {
    for (std::int32_t k = 0; k < 27; ++k) {
      const Place near{at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1};
      if (isPlace(near) && !table_[indexOf(near)].empty()) return true;
    }
    return false;
  }

  // Of a cube of edge `edge` about p: by how far its middle is from the border.
  static double shareWithin(double depth, double edge) { return std::clamp(0.5 + depth / edge, 0.0, 1.0); }

  void addSample(const Place& at, int bit, const Vec3& p, bool inside, bool surface, bool border, Index owner) {
    const double reach = 0.8661 * step_;
    const double depth = surface ? (inside ? 1.0 : -1.0) * solid_.distance(p) : inside ? reach : -reach;
    const double height = held_ ? border ? held_(p) : held_(p) <= 0.0 ? -reach : reach : reach;
    if (depth <= -reach || height <= -reach) return;
    if (depth >= reach && height >= reach) return add(at, bit, {p, Vec3::Constant(step_)}, 1.0, owner);
    const double edge = 0.5 * step_;
    for (int k = 0; k < 8; ++k) {
      Part part{p + 0.5 * edge * Vec3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1), Vec3::Constant(edge)};
      double share = 1.0;
      if (std::abs(height) < reach) share = shareWithin(held_(part.middle), edge);
      if (share > 0.0 && std::abs(depth) < reach) part = withinSurface(part, edge);
      if (share > 0.0 && part.size.minCoeff() > 0.0) add(at, bit, part, share, owner);
    }
  }

  // A box [m].
  struct Part {
    Vec3 middle, size;
  };
  // Of a cube what is inside, as if the surface lay across the axis that leads to it most.
  Part withinSurface(const Part& cube, double edge) const {
    const Vec3 way = solid_.nearest(cube.middle) - cube.middle;
    const bool inside = solid_.contains(cube.middle);
    const double share = shareWithin(inside ? way.norm() : -way.norm(), edge);
    Part part = cube;
    Eigen::Index axis = 0;
    way.cwiseAbs().maxCoeff(&axis);
    part.size[axis] *= share;
    // The surface is ahead of what is inside, and behind what is outside of it.
    if (way[axis] != 0.0) part.middle[axis] -= (inside == way[axis] > 0.0 ? 0.5 : -0.5) * (1.0 - share) * edge;
    return part;
  }

  void add(const Place& at, int bit, const Part& part, double share, Index owner) {
    if (owner == kNoIndex) owner = nearest(at, bit);
    if (owner == kNoIndex) return;
    const Vec3 in = 2.0 * lattice_.placeIn(lattice_.cells[owner], part.middle) - Vec3::Ones();
    const Vec3 size = 2.0 / lattice_.spacing * part.size;
    const double volume = 0.125 * share * size.prod();
    sums_[owner].volume += volume;
    sums_[owner].first += volume * in;
    sums_[owner].second += volume * (in.cwiseAbs2() + size.cwiseAbs2() / 12.0);
  }

  // The cell with the nearest free sample, of those beside this one.
  Index nearest(const Place& at, int bit) const {
    Index best = kNoIndex;
    int least = 4;  // [samples squared]
    for (int k = 0; k < 27; ++k) {
      int place[3], squared = 0;
      const int offset[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
      Place cell_at = at;
      for (int axis = 0; axis < 3; ++axis) {
        place[axis] = bit / kSampleStride[axis] % kCellSamples + offset[axis];
        squared += offset[axis] * offset[axis];
        if (place[axis] < 0) --cell_at[axis];
        if (place[axis] >= kCellSamples) ++cell_at[axis];
        place[axis] = (place[axis] + kCellSamples) % kCellSamples;
      }
      if (squared >= least || !isPlace(cell_at)) continue;
      for (const Index c : table_[indexOf(cell_at)])
        if (!lattice_.cells[c].held && lattice_.cells[c].samples >> sampleBit(place[0], place[1], place[2]) & 1) {
          best = c;
          least = squared;
        }
    }
    return best;
  }

  void finish(Index c) const {
    LatticeCell& cell = lattice_.cells[c];
    const Sums& sums = sums_[c];
    if (!(sums.volume > kFictitious)) {
      cell.resists = {kFictitious, Vec3::Zero(), Vec3::Constant(1.0 / 3.0)};
      return;
    }
    cell.resists.fraction = sums.volume;
    cell.resists.centroid = sums.first / sums.volume;
    cell.resists.variance = sums.second / sums.volume - cell.resists.centroid.cwiseAbs2();
  }

  const SolidQuery& solid_;
  const HeldHeight& held_;
  CellLattice& lattice_;
  double step_;
  Place lower_{}, size_{};
  std::vector<std::vector<Index>> table_;
  std::vector<Sums> sums_;
};

}  // namespace

Resistance resistanceOf(const LatticeCell& before, SampleSet filled) {
  if (filled == before.filled || before.held) return before.resists;
  // Finer than samples see it was known before: of that as much as of the samples.
  const FilledMoments moments = momentsOf(filled), all = momentsOf(before.filled);
  return {before.resists.fraction * moments.fraction / all.fraction,
          before.resists.centroid + moments.centroid - all.centroid,
          before.resists.variance.cwiseProduct(moments.variance).cwiseQuotient(all.variance)};
}

void findResistance(const SolidQuery& solid, const HeldHeight& held, CellLattice& lattice) {
  ResistanceFinder(solid, held, lattice).run();
}

}  // namespace meshless
