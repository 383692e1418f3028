#include "meshless_surgery/body/cell_blend.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include <tbb/enumerable_thread_specific.h>

#include "meshless_surgery/base/compressed_rows.h"
#include "meshless_surgery/body/filled_cells.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr double kReach = 1.2;           // [spacing] cells farther than this do not count
constexpr double kBeyond = 1.0 + 1e-9;   // of the reach: out of it, whatever rounding does
constexpr int kAround = 2;               // places on each side of a vertex's own: kReach, rounded up
constexpr std::size_t kChunk = 16;       // cells
constexpr std::size_t kMostWays = 1000;  // kept from cell to cell: 12 kB each
constexpr int kWide = 2 * kAround + 1, kPlaces = kWide * kWide * kWide, kMiddle = kPlaces / 2;
constexpr int kStride[3] = {1, kWide, kWide* kWide};

// Places of the window around a vertex's own.
using Window = std::bitset<kPlaces>;
template <class Is>
Window placesThat(const Is& is) {
  Window places;
  for (int p = 0; p < kPlaces; ++p) places[static_cast<std::size_t>(p)] = is(p);
  return places;
}
// Where two axes are two places off, all is farther than kReach.
const Window kInReach = placesThat([](int p) {
  int far = 0;
  for (const int stride : kStride) far += std::abs(p / stride % kWide - kAround) == kAround;
  return far < 2;
});
// Those with a next one along an axis.
const Window kNotLast[3] = {placesThat([](int p) { return p % kWide + 1 < kWide; }),
                            placesThat([](int p) { return p / kStride[1] % kWide + 1 < kWide; }),
                            placesThat([](int p) { return p / kStride[2] % kWide + 1 < kWide; })};

// The affine map of a cell at the centroid of what fills it.
struct CellMap {
  Vec3 centroid = Vec3::Zero();          // [m] at rest
  Eigen::Array<double, 8, 1> at;         // weights of the corners there
  Eigen::Array<double, 8, 1> slopes[3];  // [1/m] their gradients
  double filled = 0.0;                   // of a cell
  int middle = 0;                        // its sample that is nearest to the centroid
};

// All samples at a place, of whatever cell, and the links of them that are gone.
struct Tissue {
  SampleSet present = kNoSample;
  LinkSet parted{};
  std::vector<Index> cells;
  bool joined[3] = {false, false, false};  // to the next place along an axis
  bool held = false, free = false;         // there is such a cell
  bool severed = false;                    // something here is parted, or there are several cells of either
};

// A crumb has those of the cell that it came from.
SampleSet samplesOf(const LatticeCell& cell) { return cell.samples ? cell.samples : cell.filled; }

// The tissue of a lattice by places, with empty ones all around.
class TissueGrid {
 public:
  explicit TissueGrid(const CellLattice& lattice) {
    std::array<std::int32_t, 3> upper = lower_ = lattice.cells[0].place;
    for (const LatticeCell& cell : lattice.cells)
      for (int k = 0; k < 3; ++k) {
        lower_[k] = std::min(lower_[k], cell.place[k]);
        upper[k] = std::max(upper[k], cell.place[k]);
      }
    std::size_t count = 1;
    for (int k = 0; k < 3; ++k) {
      lower_[k] -= kAround;
      stride_[k] = count;
      count *= static_cast<std::size_t>(upper[k] + kAround + 1 - lower_[k]);
    }
    for (std::size_t p = 0; p < offsets_.size(); ++p)
      for (int axis = 0; axis < 3; ++axis)
        offsets_[p] += stride_[axis] * static_cast<std::size_t>(static_cast<int>(p) / kStride[axis] % kWide - kAround);
    number_.assign(count, 0);
    all_.resize(1);  // the first is that of empty places
    for (Index c = 0; c < lattice.cells.size(); ++c) {
      const LatticeCell& cell = lattice.cells[c];
      Index& number = number_[indexOf(cell.place)];
      if (!number) {
        number = static_cast<Index>(all_.size());
        all_.emplace_back();
      }
      Tissue& tissue = all_[number];
      tissue.cells.push_back(c);
      tissue.severed = tissue.severed || (cell.held ? tissue.held : tissue.free);
      (cell.held ? tissue.held : tissue.free) = true;
      tissue.present |= samplesOf(cell);
      for (int axis = 0; axis < 3; ++axis) tissue.parted[axis] |= samplesOf(cell) & cell.parted[axis];
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (!number_[i]) continue;
      Tissue& tissue = all_[number_[i]];
      for (int axis = 0; axis < 3; ++axis) {
        const SampleSet next = all_[number_[i + stride_[axis]]].present;
        const SampleSet across = faceLinks(tissue.present, next, axis);
        const SampleSet links =
            (tissue.present & (tissue.present >> kSampleStride[axis]) & ~kUpperLayer[axis]) | across;
        tissue.joined[axis] = across & ~tissue.parted[axis];
        tissue.severed = tissue.severed || (links & tissue.parted[axis]);
      }
    }
  }

  std::size_t indexOf(const std::array<std::int32_t, 3>& place) const {
    std::size_t index = 0;
    for (int k = 0; k < 3; ++k) index += stride_[k] * static_cast<std::size_t>(place[k] - lower_[k]);
    return index;
  }
  /// What is around a place that has cells.
  void window(std::size_t middle, std::array<const Tissue*, kPlaces>& places) const {
    for (std::size_t p = 0; p < places.size(); ++p) places[p] = &all_[number_[middle + offsets_[p]]];
  }
  Index numberOf(std::size_t index) const { return number_[index]; }
  std::size_t count() const { return all_.size(); }

 private:
  std::array<std::int32_t, 3> lower_{};
  std::array<std::size_t, 3> stride_{};
  std::array<std::size_t, kPlaces> offsets_{};  // of the places of a window
  std::vector<Index> number_;
  std::vector<Tissue> all_;
};

// The ways by links from a sample to others in the window of places around it, as far as somebody asked.
class Ways {
 public:
  Ways(const TissueGrid& grid, const LatticeCell& cell, int bit) {
    grid.window(grid.indexOf(cell.place), window_);
    steps_.fill(kUnknown);
    enter(kMiddle, SampleSet{1} << bit);
    arrive();
  }

  /// kUnknown where there is no way of at most so many steps.
  int stepsTo(int place, int bit, int most) {
    const std::uint8_t& steps = steps_[static_cast<std::size_t>(64 * place + bit)];
    while (steps == kUnknown && made_ < std::min(most, kUnknown - 1)) {
      ++made_;
      goOn();
      arrive();
    }
    return steps;
  }

  static constexpr std::uint8_t kUnknown = 255;

 private:
  void enter(int p, SampleSet samples) {
    const std::size_t i = static_cast<std::size_t>(p);
    samples &= window_[i]->present & ~passed_[i];
    if (!samples) return;
    if (!passed_[i]) flooded_.push_back(p);
    passed_[i] |= samples;
    next_[i] |= samples;
  }

  void goOn() {
    const std::size_t places = flooded_.size();
    for (std::size_t n = 0; n < places; ++n) {
      const int p = flooded_[n];
      const SampleSet edge = edge_[static_cast<std::size_t>(p)];
      if (!edge) continue;
      const LinkSet& parted = window_[static_cast<std::size_t>(p)]->parted;
      SampleSet within = kNoSample;
      for (int axis = 0; axis < 3; ++axis) {
        const int stride = kSampleStride[axis], along = p / kStride[axis] % kWide;
        const SampleSet linked = edge & ~parted[axis];
        within |= (linked & ~kUpperLayer[axis]) << stride | ((edge & ~kLowerLayer[axis]) >> stride & ~parted[axis]);
        if (const SampleSet up = linked & kUpperLayer[axis]; up && along + 1 < kWide)
          enter(p + kStride[axis], up >> (kCellSamples - 1) * stride);
        if (const SampleSet down = edge & kLowerLayer[axis]; down && along > 0)
          enter(p - kStride[axis], down << (kCellSamples - 1) * stride &
                                       ~window_[static_cast<std::size_t>(p - kStride[axis])]->parted[axis]);
      }
      enter(p, within);
    }
  }

  void arrive() {
    for (const int p : flooded_) {
      const std::size_t i = static_cast<std::size_t>(p);
      edge_[i] = next_[i];
      next_[i] = kNoSample;
      for (SampleSet left = edge_[i]; left; left &= left - 1)
        steps_[64 * i + static_cast<std::size_t>(lowestSample(left))] = static_cast<std::uint8_t>(made_);
    }
  }

  std::array<const Tissue*, kPlaces> window_{};
  std::array<std::uint8_t, 64 * kPlaces> steps_;  // to each sample
  std::array<SampleSet, kPlaces> passed_{}, edge_{}, next_{};
  std::vector<int> flooded_;  // places of the window
  int made_ = 0;              // steps
};

// Rows of vertices, one after the other.
class Blender {
 public:
  struct Lattice {
    const CellLattice& lattice;
    TissueGrid grid;
    std::vector<CellMap> maps;
    std::vector<std::vector<Index>> parts;  // of a bridge: what it joins
  };
  struct Rows {
    std::vector<Index> lengths, carriers;
    std::vector<double> weights;
  };

  explicit Blender(const Lattice& of)
      : of_(of), open_(of.grid.count(), kUnknown), number_(of.lattice.corners, kNoIndex) {}

  /// Appends the rows of the vertices [from, to) of the tissue of `cell`.
  void follow(Index cell, const Index* from, const Index* to, const Points& rest, Rows& rows) {
    const LatticeCell& own = of_.lattice.cells[cell];
    of_.grid.window(of_.grid.indexOf(own.place), window_);
    choose(cell, from, to, rest);
    if (ways_.size() > kMostWays) ways_.clear();  // not within a cell, whose vertices ask for the same ones
    const double spacing = of_.lattice.spacing;
    for (; from != to; ++from) {
      const Vec3& p = rest[*from];
      const double to_own = awayFrom(cell, p), reach = reachOf(to_own), far = kBeyond * spacing * reach;
      // What is held stays.
      const bool held = own.held, direct = held || (!(reach > kReach) && isOpen(own.place));
      const int bit = direct ? 0 : nearestSample(samplesOf(own), of_.lattice.placeIn(own, p));
      double all = 0.0;
      for (const Candidate& c : candidates_) {
        if (held && c.cell != cell) continue;
        if ((p - c.centroid).squaredNorm() > far * far) continue;
        const double away = awayFrom(c.cell, p);
        if (!(away < reach)) continue;
        const double detour = direct || c.cell == cell ? 0.0 : detourTo(c, own, bit, away, reach);
        const double near = 1.0 - std::pow((away + detour) / reach, 2);
        if (!(near > 0.0)) continue;
        const CellMap& map = of_.maps[c.cell];
        const Vec3 d = p - map.centroid;
        const double weight = near * near * map.filled;
        all += weight;
        const Eigen::Array<double, 8, 1> share =
            weight * (map.at + ((map.slopes[0] * d.x() + map.slopes[1] * d.y()) + map.slopes[2] * d.z()));
        for (int k = 0; k < 8; ++k) {
          sum_[c.corners[k]] += share[k];
          seen_[c.corners[k]] = true;
        }
      }
      const std::size_t before = rows.carriers.size();
      for (std::size_t i = 0; i < corners_.size(); ++i) {
        if (!seen_[i]) continue;
        rows.carriers.push_back(corners_[i]);
        rows.weights.push_back(sum_[i] / all);
        sum_[i] = 0.0;
        seen_[i] = false;
      }
      rows.lengths.push_back(static_cast<Index>(rows.carriers.size() - before));
    }
  }

 private:
  enum Openness : char { kUnknown, kOpen, kNotOpen };
  struct Candidate {
    Vec3 centroid;
    Index cell;
    int place;                     // in the window
    std::array<Index, 8> corners;  // in corners_
  };

  double awayFrom(Index cell, const Vec3& p) const {  // [spacing]
    return (p - of_.maps[cell].centroid).norm() / of_.lattice.spacing;
  }
  // Its own cell always counts.
  static double reachOf(double to_own) { return std::max(kReach, std::sqrt(2.0) * to_own); }

  /// The cells that any of the vertices may follow, and their corners.
  void choose(Index cell, const Index* from, const Index* to, const Points& rest) {
    Box bounds;
    double reach = 0.0;
    for (const Index* v = from; v != to; ++v) {
      bounds.extend(rest[*v]);
      reach = std::max(reach, reachOf(awayFrom(cell, rest[*v])));
    }
    const double far = kBeyond * of_.lattice.spacing * reach;
    candidates_.clear();
    corners_.clear();
    for (int p = 0; p < kPlaces; ++p)
      for (const Index c : window_[static_cast<std::size_t>(p)]->cells) {
        const Vec3& centroid = of_.maps[c].centroid;
        if ((centroid.cwiseMax(bounds.min).cwiseMin(bounds.max) - centroid).squaredNorm() > far * far) continue;
        candidates_.push_back({centroid, c, p, of_.lattice.cells[c].corners});
        for (const Index corner : candidates_.back().corners) {
          if (number_[corner] == kNoIndex) corners_.push_back(corner);
          number_[corner] = 0;
        }
      }
    std::sort(corners_.begin(), corners_.end());
    for (Index i = 0; i < corners_.size(); ++i) number_[corners_[i]] = i;
    for (Candidate& c : candidates_)
      for (Index& corner : c.corners) corner = number_[corner];
    for (const Index corner : corners_) number_[corner] = kNoIndex;
    sum_.assign(corners_.size(), 0.0);
    seen_.assign(corners_.size(), false);
  }

  /// Nothing that is in kReach of a place is parted or lies apart.
  bool isOpen(const std::array<std::int32_t, 3>& place) {
    char& known = open_[of_.grid.numberOf(of_.grid.indexOf(place))];
    if (known == kUnknown) known = lookForGaps() ? kNotOpen : kOpen;
    return known == kOpen;
  }
  bool lookForGaps() const {
    Window filled, reached, joined[3];  // along each axis, to the next place
    for (std::size_t p = 0; p < kPlaces; ++p) {
      const Tissue& tissue = *window_[p];
      if (!tissue.present) continue;
      if (kInReach[p]) {
        if (tissue.severed) return true;
        filled.set(p);
      }
      for (int axis = 0; axis < 3; ++axis)
        if (tissue.joined[axis]) joined[axis].set(p);
    }
    for (int axis = 0; axis < 3; ++axis) joined[axis] &= kNotLast[axis];
    reached.set(kMiddle);
    for (Window before; before != reached;) {
      before = reached;
      for (int axis = 0; axis < 3; ++axis) {
        const auto stride = static_cast<std::size_t>(kStride[axis]);
        reached |= (reached & joined[axis]) << stride | (reached >> stride & joined[axis]);
      }
    }
    return (filled & ~reached).any();
  }

  /// [spacing] How much longer the way from a sample of `own` to a cell is, from sample to sample by links, than
  /// without gaps; the reach where there is none.
  double detourTo(const Candidate& c, const LatticeCell& own, int bit, double away, double reach) {
    if (!of_.lattice.cells[c.cell].isBridge(c.cell)) return detourTo(c.cell, c.place, own, bit, away, reach);
    double most = 0.0;  // a bridge is as far as the farther of what it joins
    for (const Index part : of_.parts[c.cell]) most = std::max(most, detourTo(part, c.place, own, bit, away, reach));
    return most;
  }
  double detourTo(Index cell, int place, const LatticeCell& own, int bit, double away, double reach) {
    const LatticeCell& there = of_.lattice.cells[cell];
    const int middle = of_.maps[cell].middle;
    int straight = 0;
    for (int axis = 0; axis < 3; ++axis)
      straight += std::abs(kCellSamples * (there.place[axis] - own.place[axis]) +
                           middle / kSampleStride[axis] % kCellSamples - bit / kSampleStride[axis] % kCellSamples);
    Ways& ways = ways_.try_emplace(cell, of_.grid, there, middle).first->second;
    // From the cell a vertex's place is where the cell's is from the vertex's, turned round.
    const int steps =
        ways.stepsTo(kPlaces - 1 - place, bit, straight + static_cast<int>(kCellSamples * (reach - away)));
    return steps == Ways::kUnknown ? reach : (steps - straight) / double{kCellSamples};
  }

  const Lattice& of_;
  std::vector<char> open_;  // of each place's tissue
  std::array<const Tissue*, kPlaces> window_{};
  std::vector<Candidate> candidates_;
  std::vector<Index> corners_;  // of the candidates, ascending
  std::vector<double> sum_;     // of each of them
  std::vector<char> seen_;
  std::vector<Index> number_;  // of each corner of the lattice
  std::unordered_map<Index, Ways> ways_;
};

std::vector<CellMap> mapsOf(const CellLattice& lattice) {
  std::vector<CellMap> maps;
  maps.reserve(lattice.cells.size());
  for (const LatticeCell& cell : lattice.cells) {
    const FilledMoments moments = momentsOf(cell.filled);
    const Vec3 at = 0.5 * (moments.centroid + Vec3::Ones());
    CellMap& map = maps.emplace_back();
    map.centroid = lattice.restPlace(cell, at);
    map.filled = cell.stiffness_share * moments.fraction;
    map.middle = nearestSample(samplesOf(cell), lattice.placeIn(cell, map.centroid));
    for (int k = 0; k < 8; ++k) {
      map.at[k] = trilinearWeight(k, at);
      for (int axis = 0; axis < 3; ++axis) {
        Vec3 end = at;
        end[axis] = 1.0;
        map.slopes[axis][k] = (k >> axis & 1 ? 1.0 : -1.0) * trilinearWeight(k | 1 << axis, end) / lattice.spacing;
      }
    }
  }
  return maps;
}

}  // namespace

SurfaceBinding bindToCells(const CellLattice& lattice, const Points& rest, const std::vector<Index>& cell,
                           const KeptRows& kept) {
  Blender::Lattice of{lattice, TissueGrid(lattice), mapsOf(lattice), {}};
  of.parts.resize(lattice.cells.size());
  for (Index c = 0; c < lattice.cells.size(); ++c)
    if (const Index bridge = lattice.cells[c].bridge; bridge != kNoIndex && bridge != c) of.parts[bridge].push_back(c);
  std::vector<Index> offsets, vertices;  // of each cell
  const auto isKept = [&](Index v) {
    const Index was = kept.parent ? kept.vertex[v] : kNoIndex;
    return was != kNoIndex && std::all_of(kept.parent->carriers.data() + kept.parent->offsets[was],
                                          kept.parent->carriers.data() + kept.parent->offsets[was + 1],
                                          [&](Index carrier) { return kept.particle[carrier] != kNoIndex; });
  };
  std::vector<bool> is_kept;
  for (Index v = 0; v < rest.size(); ++v) is_kept.push_back(isKept(v));
  const auto each = [&](const auto& visit) {
    for (Index v = 0; v < rest.size(); ++v)
      if (!is_kept[v]) visit(cell[v], v);
  };
  compressRows(lattice.cells.size(), each, offsets, vertices);
  std::vector<Blender::Rows> parts((lattice.cells.size() + kChunk - 1) / kChunk);
  tbb::enumerable_thread_specific<Blender> blenders([&] { return Blender(of); });
  inChunks(lattice.cells.size(), kChunk, [&](std::size_t from, std::size_t to) {
    Blender& blender = blenders.local();
    for (std::size_t c = from; c < to; ++c)
      if (offsets[c] < offsets[c + 1])
        blender.follow(static_cast<Index>(c), vertices.data() + offsets[c], vertices.data() + offsets[c + 1], rest,
                       parts[from / kChunk]);
  });
  SurfaceBinding binding;
  binding.offsets.assign(rest.size() + 1, 0);
  const Index* next = vertices.data();
  for (const Blender::Rows& part : parts)
    for (const Index length : part.lengths) binding.offsets[*next++ + 1] = length;
  const auto each_kept = [&](const auto& visit) {
    for (Index v = 0; v < rest.size(); ++v)
      if (is_kept[v]) visit(v, kept.parent->offsets[kept.vertex[v]], kept.parent->offsets[kept.vertex[v] + 1]);
  };
  each_kept([&](Index v, Index from, Index to) { binding.offsets[v + 1] = to - from; });
  std::partial_sum(binding.offsets.begin(), binding.offsets.end(), binding.offsets.begin());
  binding.carriers.resize(binding.offsets.back());
  binding.weights.resize(binding.offsets.back());
  next = vertices.data();
  for (const Blender::Rows& part : parts) {
    Index at = 0;
    for (const Index length : part.lengths) {
      const Index to = binding.offsets[*next++];
      std::copy_n(part.carriers.data() + at, length, binding.carriers.data() + to);
      std::copy_n(part.weights.data() + at, length, binding.weights.data() + to);
      at += length;
    }
  }
  each_kept([&](Index v, Index from, Index to) {
    std::copy(kept.parent->weights.data() + from, kept.parent->weights.data() + to,
              binding.weights.data() + binding.offsets[v]);
    for (Index k = from; k < to; ++k)
      binding.carriers[binding.offsets[v] + k - from] = kept.particle[kept.parent->carriers[k]];
  });
  binding.cells = cell;
  return binding;
}

}  // namespace meshless
