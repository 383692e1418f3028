#include "cap_rough.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "mesh/exact.h"

namespace meshless {
namespace surgery {
namespace {

constexpr double kSteepest = 0.5;  // height over distance to the rim
constexpr double kRamp = 2.0;      // spacings
constexpr int kOctaves = 6;
constexpr int kHalvings = 4;  // before a vertex is put back into the plane

std::uint64_t mixed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

double fade(double t) { return t * t * t * (t * (6.0 * t - 15.0) + 10.0); }

/// Smooth noise within -1 .. 1, of wavelength about 2: values at whole numbers, blended.
double noise(double x, double y, std::uint64_t seed) {
  const double i = std::floor(x), j = std::floor(y);
  const auto valueAt = [&](double a, double b) {
    const std::uint64_t key = static_cast<std::uint64_t>(static_cast<std::int64_t>(a)) * 0x9e3779b97f4a7c15u ^
                              static_cast<std::uint64_t>(static_cast<std::int64_t>(b)) * 0xc2b2ae3d27d4eb4fu;
    return static_cast<double>(mixed(key ^ seed) >> 11) / 4503599627370496.0 - 1.0;
  };
  const double u = fade(x - i), v = fade(y - j);
  const double low = (1.0 - u) * valueAt(i, j) + u * valueAt(i + 1, j);
  const double high = (1.0 - u) * valueAt(i, j + 1) + u * valueAt(i + 1, j + 1);
  return (1.0 - v) * low + v * high;
}

/// Octaves from the longest wavelength [m] down to two spacings, each half as long and half as high. Within -1 .. 1.
double fractal(const Vec2& place, double longest, double spacing, std::uint32_t seed) {
  double sum = 0.0, most = 0.0, share = 1.0;
  for (int k = 0; k < kOctaves; ++k, share *= 0.5) {
    const double wavelength = longest * share;
    if (k > 0 && wavelength < 2.0 * spacing) break;
    sum += share * noise(2.0 * place.x() / wavelength, 2.0 * place.y() / wavelength,
                         mixed(seed * std::uint64_t{kOctaves} + static_cast<std::uint64_t>(k)));
    most += share;
  }
  return sum / most;
}

/// Boxes in the plane, to be found by place.
class PlaneGrid {
 public:
  PlaneGrid(const Vec2& low, const Vec2& high, double cell)
      : low_(low), cell_(std::max(cell, (high - low).maxCoeff() / 512.0)) {
    columns_ = 1 + static_cast<int>((high.x() - low.x()) / cell_);
    rows_ = 1 + static_cast<int>((high.y() - low.y()) / cell_);
    cells_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  }

  void add(const Vec2& low, const Vec2& high, Index item) {
    visit(low, high, [&](std::vector<Index>& cell) { cell.push_back(item); });
  }
  /// Ascending, each once.
  void find(const Vec2& low, const Vec2& high, std::vector<Index>& items) {
    items.clear();
    visit(low, high, [&](std::vector<Index>& cell) { items.insert(items.end(), cell.begin(), cell.end()); });
    std::sort(items.begin(), items.end());
    items.erase(std::unique(items.begin(), items.end()), items.end());
  }

 private:
  int within(double x, int count) const {
    return static_cast<int>(std::min(std::max(x / cell_, 0.0), static_cast<double>(count - 1)));
  }
  template <class Visitor>
  void visit(const Vec2& low, const Vec2& high, const Visitor& visitor) {
    for (int j = within(low.y() - low_.y(), rows_); j <= within(high.y() - low_.y(), rows_); ++j)
      for (int i = within(low.x() - low_.x(), columns_); i <= within(high.x() - low_.x(), columns_); ++i)
        visitor(cells_[static_cast<std::size_t>(j) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(i)]);
  }

  Vec2 low_;
  double cell_;
  int columns_, rows_;
  std::vector<std::vector<Index>> cells_;
};

double distanceTo(const Vec2& p, const Vec2& a, const Vec2& b) {
  const Vec2 edge = b - a;
  const double squared = edge.squaredNorm();
  const double s = squared > 0.0 ? std::min(std::max((p - a).dot(edge) / squared, 0.0), 1.0) : 0.0;
  return (p - a - s * edge).norm();
}

using exact::Corners;

/// True where two triangles have more in common than the corners and the edge that they share.
bool meet(Corners c, Corners s) {
  for (int axis = 0; axis < 3; ++axis) {
    if (std::max({c[0][axis], c[1][axis], c[2][axis]}) < std::min({s[0][axis], s[1][axis], s[2][axis]})) return false;
    if (std::max({s[0][axis], s[1][axis], s[2][axis]}) < std::min({c[0][axis], c[1][axis], c[2][axis]})) return false;
  }
  int shared = 0;  // those go first
  for (int i = 0; i < 3; ++i)
    for (int j = shared; j < 3; ++j)
      if (c[i] == s[j]) {
        std::swap(c[shared], c[i]);
        std::swap(s[shared++], s[j]);
        break;
      }
  return shared > 2 || exact::onALine(c) || exact::onALine(s) || exact::meet(c, s, shared);
}

class Roughness {
 public:
  Roughness(const SplitSurface& surface, const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& outline,
            const CapCore& core, Index first_node, std::size_t first_triangle, Wound& wound)
      : split_(surface),
        nodes_(nodes),
        outline_(outline),
        core_(core),
        first_(first_node),
        wound_(wound),
        heights_(core.places.size(), 0.0) {
    for (std::size_t t = first_triangle; t < wound.triangles.size(); ++t) {
      const Triangle& n = wound.triangles[t].nodes;
      if (inCore(n[0]) || inCore(n[1]) || inCore(n[2])) cap_.push_back(n);
    }
    low_ = high_ = nodes[outline[0].from];
    for (const OutlineSegment& s : outline) {
      for (const Index n : {s.from, s.to}) {
        low_ = low_.cwiseMin(nodes[n]);
        high_ = high_.cwiseMax(nodes[n]);
      }
    }
  }

  void chooseHeights(double amplitude, std::uint32_t seed) {
    const double extent = (high_ - low_).norm();
    amplitude = std::min(amplitude, 0.5 * kSteepest * extent);  // what the slope leaves of more
    const double reach = std::max(kRamp * core_.spacing, amplitude / kSteepest);
    PlaneGrid grid(low_, high_, 0.5 * reach);
    for (Index s = 0; s < outline_.size(); ++s) {
      const Vec2 &a = nodes_[outline_[s].from], &b = nodes_[outline_[s].to];
      grid.add(a.cwiseMin(b), a.cwiseMax(b), s);
    }
    std::vector<Index> segments;
    for (std::size_t p = 0; p < heights_.size(); ++p) {
      const Vec2& place = core_.places[p];
      grid.find(place - Vec2::Constant(reach), place + Vec2::Constant(reach), segments);
      double distance = reach;
      for (const Index s : segments)
        distance = std::min(distance, distanceTo(place, nodes_[outline_[s].from], nodes_[outline_[s].to]));
      const double height = amplitude * fade(std::min(distance / (kRamp * core_.spacing), 1.0)) *
                            fractal(place, 0.5 * extent, core_.spacing, seed);
      heights_[p] = std::min(std::max(height, -kSteepest * distance), kSteepest * distance);
    }
  }

  void stayWithin() {
    for (Index p = 0; p < heights_.size(); ++p) place(p);
    collectSurface();
    if (surface_.empty()) return;
    std::vector<std::vector<Index>> cap_at(heights_.size());
    std::vector<Index> open;
    for (Index t = 0; t < cap_.size(); ++t) {
      open.push_back(t);
      for (const Index v : cap_[t])
        if (inCore(v)) cap_at[v - first_].push_back(t);
    }
    std::vector<char> lowered;
    for (int round = 0; !open.empty(); ++round) {
      lowered.assign(heights_.size(), 0);
      for (const Index t : open)
        if (meetsSurface(t))
          for (const Index v : cap_[t])
            if (inCore(v)) lowered[v - first_] = heights_[v - first_] != 0.0;
      // A lower vertex changes all triangles around it.
      open.clear();
      for (Index p = 0; p < lowered.size(); ++p) {
        if (!lowered[p]) continue;
        heights_[p] = round < kHalvings ? 0.5 * heights_[p] : 0.0;
        place(p);
        open.insert(open.end(), cap_at[p].begin(), cap_at[p].end());
      }
      std::sort(open.begin(), open.end());
      open.erase(std::unique(open.begin(), open.end()), open.end());
    }
  }

 private:
  bool inCore(Index node) const { return node >= first_ && node - first_ < core_.places.size(); }
  void place(Index p) { wound_.nodes[first_ + p].height = heights_[p]; }

  void addSurface(const Triangle& t, double reach) {
    const Corners corners{split_.positions[t[0]], split_.positions[t[1]], split_.positions[t[2]]};
    double bottom = 1e300, top = -1e300;
    for (const Vec3& p : corners) {
      const double height = split_.frame.height(p);
      bottom = std::min(bottom, height);
      top = std::max(top, height);
    }
    if (bottom > reach || top < -reach) return;
    const Frame& f = split_.frame;
    const Vec2 a = f.flat(corners[0]), b = f.flat(corners[1]), c = f.flat(corners[2]);
    const Vec2 low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
    if ((low.array() > high_.array()).any() || (high.array() < low_.array()).any()) return;
    surface_.push_back(corners);
    surface_low_.push_back(low);
    surface_high_.push_back(high);
  }

  /// The surface's triangles as near to the plane as the cap.
  void collectSurface() {
    double reach = 0.0;
    for (const double height : heights_) reach = std::max(reach, std::abs(height));
    reach *= 1.001;
    for (const Triangle& t : split_.triangles) addSurface(t, reach);
    grid_ = std::make_unique<PlaneGrid>(low_, high_, 2.0 * core_.spacing);
    for (Index s = 0; s < surface_.size(); ++s) grid_->add(surface_low_[s], surface_high_[s], s);
  }

  bool meetsSurface(Index t) {
    bool moved = false;
    for (const Index v : cap_[t]) moved |= inCore(v) && heights_[v - first_] != 0.0;
    if (!moved) return false;
    Corners corners;
    for (int k = 0; k < 3; ++k) corners[k] = wound_.position(split_, cap_[t][k]);
    const Frame& f = split_.frame;
    const Vec2 a = f.flat(corners[0]), b = f.flat(corners[1]), c = f.flat(corners[2]);
    grid_->find(a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c), near_);
    return std::any_of(near_.begin(), near_.end(), [&](Index s) { return meet(corners, surface_[s]); });
  }

  const SplitSurface& split_;
  const std::vector<Vec2>& nodes_;
  const std::vector<OutlineSegment>& outline_;
  const CapCore& core_;
  const Index first_;
  Wound& wound_;
  std::vector<Triangle> cap_;    // those with a point of the core
  Vec2 low_, high_;              // of the outline
  std::vector<double> heights_;  // [m] of the core's points
  std::vector<Corners> surface_;
  std::vector<Vec2> surface_low_, surface_high_;
  std::unique_ptr<PlaneGrid> grid_;
  std::vector<Index> near_;
};

}  // namespace

void roughen(const SplitSurface& surface, const std::vector<Vec2>& places, const std::vector<OutlineSegment>& outline,
             const CapCore& core, Index first_node, std::size_t first_triangle, double amplitude, std::uint32_t seed,
             Wound& wound) {
  if (core.places.empty()) return;
  Roughness roughness(surface, places, outline, core, first_node, first_triangle, wound);
  roughness.chooseHeights(amplitude, seed);
  roughness.stayWithin();
}

}  // namespace surgery
}  // namespace meshless
