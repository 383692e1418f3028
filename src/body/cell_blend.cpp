#include "meshless_surgery/body/cell_blend.h"

#include <algorithm>
#include <cmath>

#include <tbb/enumerable_thread_specific.h>

#include "meshless_surgery/body/filled_cells.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr double kReach = 1.2;       // [spacing] cells farther than this do not count
constexpr int kAround = 2;           // places on each side of a vertex's own: kReach, rounded up
constexpr std::size_t kChunk = 256;  // vertices
constexpr int kWide = 2 * kAround + 1, kPlaces = kWide * kWide * kWide, kMiddle = kPlaces / 2;
constexpr int kStride[3] = {1, kWide, kWide* kWide};

// The affine map of a cell at the centroid of what fills it.
struct CellMap {
  Vec3 centroid = Vec3::Zero();  // [m] at rest
  std::array<double, 8> at{};    // weights of the corners there
  std::array<Vec3, 8> slope{};   // [1/m] their gradients
  double filled = 0.0;           // of a cell
};

// All samples at a place, of whatever cell, and the links of them that are gone.
struct Tissue {
  SampleSet present = kNoSample;
  LinkSet parted{};
  std::vector<Index> cells;
  bool joined[3] = {false, false, false};  // to the next place along an axis
  bool severed = false;                    // something here is parted, or there are several cells
};

// A crumb has those of the cell that it came from.
SampleSet samplesOf(const LatticeCell& cell) { return cell.samples ? cell.samples : cell.filled; }

// A sample in the window of places around a vertex.
struct Sample {
  int place = 0, bit = 0;
};
int stepsBetween(const Sample& a, const Sample& b) {
  int steps = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = [axis](const Sample& s) {
      return kCellSamples * (s.place / kStride[axis] % kWide) + s.bit / kSampleStride[axis] % kCellSamples;
    };
    steps += std::abs(at(a) - at(b));
  }
  return steps;
}

int nearestSample(SampleSet samples, const Vec3& at) {
  int best = lowestSample(samples);
  for (SampleSet left = samples; left; left &= left - 1)
    if (const int bit = lowestSample(left);
        (samplePlace(bit) - at).squaredNorm() < (samplePlace(best) - at).squaredNorm())
      best = bit;
  return best;
}

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
      tissue.present |= samplesOf(cell);
      for (int axis = 0; axis < 3; ++axis) tissue.parted[axis] |= samplesOf(cell) & cell.parted[axis];
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (!number_[i]) continue;
      Tissue& tissue = all_[number_[i]];
      tissue.severed = tissue.cells.size() > 1;
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
    for (int p = 0; p < kPlaces; ++p) {
      std::size_t index = middle;
      for (int axis = 0; axis < 3; ++axis)
        index += stride_[axis] * static_cast<std::size_t>(p / kStride[axis] % kWide - kAround);
      places[static_cast<std::size_t>(p)] = &all_[number_[index]];
    }
  }
  Index numberOf(std::size_t index) const { return number_[index]; }
  std::size_t count() const { return all_.size(); }

 private:
  static SampleSet faceLinks(SampleSet lower, SampleSet upper, int axis) {
    return lower & kUpperLayer[axis] & ((upper & kLowerLayer[axis]) << (kCellSamples - 1) * kSampleStride[axis]);
  }

  std::array<std::int32_t, 3> lower_{};
  std::array<std::size_t, 3> stride_{};
  std::vector<Index> number_;
  std::vector<Tissue> all_;
};

// Rows of vertices, one after the other.
class Blender {
 public:
  struct Lattice {
    const CellLattice& lattice;
    TissueGrid grid;
    std::vector<CellMap> maps;
    std::vector<std::vector<Index>> parts;  // of a bridge: what it joins
    std::vector<bool> held;                 // no corner of a cell can move
  };

  explicit Blender(const Lattice& of)
      : of_(of), open_(of.grid.count(), kUnknown), sum_(of.lattice.corners, 0.0), seen_(of.lattice.corners, false) {}

  /// Appends the row of a vertex of the tissue of `cell`.
  void follow(const Vec3& rest, Index cell, SurfaceBinding& part) {
    const LatticeCell& own = of_.lattice.cells[cell];
    const Vec3 at = of_.lattice.placeIn(own, rest);
    const double to_own = (rest - of_.maps[cell].centroid).norm() / of_.lattice.spacing;
    const double reach = std::max(kReach, std::sqrt(2.0) * to_own);  // its own cell always counts
    lookAround(own);
    choose(rest, reach);
    if (of_.held[cell])  // what is held with all around it stays
      candidates_.assign(1, {cell, kMiddle, to_own});
    else if (reach > kReach || !isOpen(own.place))
      findDetours({kMiddle, nearestSample(samplesOf(own), at)}, cell, reach);
    double all = 0.0;
    for (const Candidate& c : candidates_) {
      const double near = 1.0 - std::pow((c.away + c.detour) / reach, 2);
      if (!(near > 0.0)) continue;
      const CellMap& map = of_.maps[c.cell];
      const double weight = near * near * map.filled;
      all += weight;
      for (int k = 0; k < 8; ++k) {
        const Index corner = of_.lattice.cells[c.cell].corners[k];
        if (!seen_[corner]) touched_.push_back(corner);
        seen_[corner] = true;
        sum_[corner] += weight * (map.at[k] + map.slope[k].dot(rest - map.centroid));
      }
    }
    std::sort(touched_.begin(), touched_.end());
    for (const Index corner : touched_) {
      part.carriers.push_back(corner);
      part.weights.push_back(sum_[corner] / all);
      sum_[corner] = 0.0;
      seen_[corner] = false;
    }
    touched_.clear();
    part.offsets.push_back(static_cast<Index>(part.carriers.size()));
  }

 private:
  enum Openness : char { kUnknown, kOpen, kNotOpen };
  struct Candidate {
    Index cell;
    int place;            // in the window
    double away;          // [spacing] straight
    double detour = 0.0;  // [spacing] that tissue makes of it
  };

  void lookAround(const LatticeCell& own) {
    const std::size_t index = of_.grid.indexOf(own.place);
    if (index == around_) return;
    around_ = index;
    of_.grid.window(index, window_);
  }

  void choose(const Vec3& rest, double reach) {
    candidates_.clear();
    for (int p = 0; p < kPlaces; ++p)
      for (const Index c : window_[static_cast<std::size_t>(p)]->cells) {
        const double away = (rest - of_.maps[c].centroid).norm() / of_.lattice.spacing;
        if (away < reach) candidates_.push_back({c, p, away});
      }
  }

  /// Nothing that is in kReach of a place is parted or lies apart.
  bool isOpen(const std::array<std::int32_t, 3>& place) {
    char& known = open_[of_.grid.numberOf(of_.grid.indexOf(place))];
    if (known == kUnknown) known = lookForGaps() ? kNotOpen : kOpen;
    return known == kOpen;
  }
  bool lookForGaps() const {
    std::array<bool, kPlaces> reached{};
    std::array<int, kPlaces> queue;
    int count = 0, filled = 0, found = 0;
    const auto visit = [&](int p) {
      if (reached[static_cast<std::size_t>(p)]) return;
      reached[static_cast<std::size_t>(p)] = true;
      queue[static_cast<std::size_t>(count++)] = p;
    };
    for (int p = 0; p < kPlaces; ++p) {
      if (!isInReach(p)) continue;
      const Tissue& tissue = *window_[static_cast<std::size_t>(p)];
      if (tissue.severed) return true;
      filled += tissue.present != kNoSample;
    }
    visit(kMiddle);
    for (int n = 0; n < count; ++n) {
      const int p = queue[static_cast<std::size_t>(n)];
      found += isInReach(p);
      for (int axis = 0; axis < 3; ++axis) {
        const int along = p / kStride[axis] % kWide;
        if (along + 1 < kWide && window_[static_cast<std::size_t>(p)]->joined[axis]) visit(p + kStride[axis]);
        if (along > 0 && window_[static_cast<std::size_t>(p - kStride[axis])]->joined[axis]) visit(p - kStride[axis]);
      }
    }
    return found < filled;
  }
  // Where two axes are two places off, all is farther than kReach.
  static bool isInReach(int p) {
    int far = 0;
    for (const int stride : kStride) far += std::abs(p / stride % kWide - kAround) == kAround;
    return far < 2;
  }

  /// How much longer the ways from a sample to the cells are, from sample to sample by links, than without gaps.
  void findDetours(const Sample& from, Index own, double reach) {
    targets_.clear();
    int most = 0;
    for (Index n = 0; n < candidates_.size(); ++n) addTargets(n);
    for (const Target& t : targets_)
      most = std::max(most, stepsBetween(from, t.sample) +
                                static_cast<int>(kCellSamples * (reach - candidates_[t.candidate].away)));
    flood(from, most);
    for (const Target& t : targets_) {
      Candidate& c = candidates_[t.candidate];
      if (c.cell == own) continue;
      const double detour = t.steps < 0 ? reach : (t.steps - stepsBetween(from, t.sample)) / double{kCellSamples};
      c.detour = std::max(c.detour, detour);  // a bridge is as far as the farther of what it joins
    }
  }

  struct Target {
    Index candidate;
    Sample sample;
    int steps = -1;
  };
  void addTargets(Index number) {
    const Candidate& c = candidates_[number];
    const LatticeCell& cell = of_.lattice.cells[c.cell];
    const auto add = [&](Index of) {
      const LatticeCell& part = of_.lattice.cells[of];
      const int bit = nearestSample(samplesOf(part), of_.lattice.placeIn(part, of_.maps[of].centroid));
      targets_.push_back({number, {c.place, bit}});
    };
    if (!cell.isBridge(c.cell)) return add(c.cell);
    for (const Index part : of_.parts[c.cell]) add(part);
  }

  void flood(const Sample& from, int most) {
    for (const int p : flooded_) passed_[static_cast<std::size_t>(p)] = edge_[static_cast<std::size_t>(p)] = kNoSample;
    flooded_.clear();
    std::size_t missing = targets_.size();
    const auto enter = [&](int p, SampleSet samples, std::array<SampleSet, kPlaces>& next) {
      const std::size_t i = static_cast<std::size_t>(p);
      samples &= window_[i]->present & ~passed_[i];
      if (!samples) return;
      if (!passed_[i]) flooded_.push_back(p);
      passed_[i] |= samples;
      next[i] |= samples;
    };
    enter(from.place, SampleSet{1} << from.bit, edge_);
    for (int steps = 0; steps <= most && missing; ++steps) {
      for (Target& t : targets_)
        if (t.steps < 0 && edge_[static_cast<std::size_t>(t.sample.place)] >> t.sample.bit & 1) {
          t.steps = steps;
          --missing;
        }
      const std::size_t places = flooded_.size();
      for (std::size_t n = 0; n < places; ++n) {
        const int p = flooded_[n];
        const std::size_t i = static_cast<std::size_t>(p);
        const SampleSet edge = edge_[i];
        if (!edge) continue;
        for (int axis = 0; axis < 3; ++axis) {
          const int stride = kSampleStride[axis], along = p / kStride[axis] % kWide;
          const SampleSet linked = edge & ~window_[i]->parted[axis];
          enter(p, (linked & ~kUpperLayer[axis]) << stride, next_);
          enter(p, (edge & ~kLowerLayer[axis]) >> stride & ~window_[i]->parted[axis], next_);
          if (along + 1 < kWide)
            enter(p + kStride[axis], (linked & kUpperLayer[axis]) >> (kCellSamples - 1) * stride, next_);
          if (along > 0)
            enter(p - kStride[axis],
                  (edge & kLowerLayer[axis]) << (kCellSamples - 1) * stride &
                      ~window_[static_cast<std::size_t>(p - kStride[axis])]->parted[axis],
                  next_);
        }
      }
      for (const int p : flooded_) {
        edge_[static_cast<std::size_t>(p)] = next_[static_cast<std::size_t>(p)];
        next_[static_cast<std::size_t>(p)] = kNoSample;
      }
    }
  }

  const Lattice& of_;
  std::vector<char> open_;  // of each place's tissue
  std::size_t around_ = ~std::size_t{0};
  std::array<const Tissue*, kPlaces> window_{};
  std::vector<Candidate> candidates_;
  std::vector<Target> targets_;
  std::vector<int> flooded_;  // places of the window
  std::array<SampleSet, kPlaces> passed_{}, edge_{}, next_{};
  std::vector<double> sum_;  // of each corner
  std::vector<bool> seen_;
  std::vector<Index> touched_;
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
    for (int k = 0; k < 8; ++k) {
      map.at[k] = trilinearWeight(k, at);
      for (int axis = 0; axis < 3; ++axis) {
        Vec3 end = at;
        end[axis] = 1.0;
        map.slope[k][axis] = (k >> axis & 1 ? 1.0 : -1.0) * trilinearWeight(k | 1 << axis, end) / lattice.spacing;
      }
    }
  }
  return maps;
}

std::vector<bool> heldCells(const CellLattice& lattice) {
  const std::vector<bool> moves = movingCorners(lattice);
  std::vector<bool> held;
  for (const LatticeCell& cell : lattice.cells)
    held.push_back(std::none_of(cell.corners.begin(), cell.corners.end(), [&](Index corner) { return moves[corner]; }));
  return held;
}

}  // namespace

SurfaceBinding bindToCells(const CellLattice& lattice, const Points& rest, const std::vector<Index>& cell) {
  Blender::Lattice of{lattice, TissueGrid(lattice), mapsOf(lattice), {}, heldCells(lattice)};
  of.parts.resize(lattice.cells.size());
  for (Index c = 0; c < lattice.cells.size(); ++c)
    if (const Index bridge = lattice.cells[c].bridge; bridge != kNoIndex && bridge != c) of.parts[bridge].push_back(c);
  std::vector<SurfaceBinding> parts((rest.size() + kChunk - 1) / kChunk);
  tbb::enumerable_thread_specific<Blender> blenders([&] { return Blender(of); });
  inChunks(rest.size(), kChunk, [&](std::size_t from, std::size_t to) {
    Blender& blender = blenders.local();
    for (std::size_t v = from; v < to; ++v) blender.follow(rest[v], cell[v], parts[from / kChunk]);
  });
  SurfaceBinding binding;
  binding.particle.assign(rest.size(), kNoIndex);
  binding.offsets.push_back(0);
  std::size_t carriers = 0;
  for (const SurfaceBinding& part : parts) carriers += part.carriers.size();
  binding.offsets.reserve(rest.size() + 1);
  binding.carriers.reserve(carriers);
  binding.weights.reserve(carriers);
  for (const SurfaceBinding& part : parts) {
    const Index first = static_cast<Index>(binding.carriers.size());
    for (const Index offset : part.offsets) binding.offsets.push_back(first + offset);
    binding.carriers.insert(binding.carriers.end(), part.carriers.begin(), part.carriers.end());
    binding.weights.insert(binding.weights.end(), part.weights.begin(), part.weights.end());
  }
  for (Index v = 0; v < rest.size(); ++v) binding.embedded.push_back(v);
  binding.levers.assign(rest.size(), Vec3::Zero());
  binding.turners = cell;
  binding.bound = static_cast<Index>(rest.size());
  return binding;
}

}  // namespace meshless
