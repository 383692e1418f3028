#include "meshless_surgery/dynamics/summed_batch.h"

#include <cassert>
#include <cstdint>

#include "match_batch_core.h"

namespace meshless {

using match_sets::Lattice;

namespace {

constexpr double kOnSite = 1e-3;       // of the spacing: how far a particle may lie from its site
constexpr double kSameWeight = 1e-12;  // relative
constexpr double kMostEmpty = 8.0;     // sites a particle: where more are empty, pairs are as cheap

// Along one axis: lowest coordinate, spacing and number of sites. False where coordinates are in no even row.
struct Axis {
  double low = 0.0, spacing = 1.0;
  double count = 1.0;
};
bool findAxis(const Points& rest, int axis, Axis& found) {
  std::vector<double> values;
  for (const Vec3& p : rest) values.push_back(p[axis]);
  std::sort(values.begin(), values.end());
  const double extent = values.back() - values.front();
  if (!(extent >= 0.0 && extent <= 1e300)) return false;  // NaN too
  found.low = values.front();
  double least = extent;
  // A gap below this share of the extent is rounding: no lattice that is summed has so many sites along an axis.
  for (std::size_t i = 1; i < values.size(); ++i)
    if (values[i] - values[i - 1] > 1e-6 * extent) least = std::min(least, values[i] - values[i - 1]);
  if (least > 0.0) {
    found.count = std::round(extent / least) + 1.0;
    found.spacing = extent / (found.count - 1.0);
  }
  for (double v : values) {
    const double place = (v - found.low) / found.spacing;
    if (!(std::abs(place - std::round(place)) <= kOnSite)) return false;
  }
  return true;
}

using Place = std::array<std::int64_t, 3>;

// Number of particles in a box of sites, from sums over all boxes that begin at the first site.
class BoxCount {
 public:
  BoxCount(const Place& size, const std::vector<std::uint32_t>& sites) : size_(size) {
    sums_.assign((size[0] + 1) * (size[1] + 1) * (size[2] + 1), 0);
    for (const std::uint32_t s : sites)
      sums_[at(s % size[0] + 1, s / size[0] % size[1] + 1, s / (size[0] * size[1]) + 1)] = 1;
    for (std::int64_t z = 1; z <= size[2]; ++z)
      for (std::int64_t y = 1; y <= size[1]; ++y)
        for (std::int64_t x = 1; x <= size[0]; ++x)
          sums_[at(x, y, z)] += sums_[at(x - 1, y, z)] + sums_[at(x, y - 1, z)] + sums_[at(x, y, z - 1)] -
                                sums_[at(x - 1, y - 1, z)] - sums_[at(x, y - 1, z - 1)] - sums_[at(x - 1, y, z - 1)] +
                                sums_[at(x - 1, y - 1, z - 1)];
  }
  // At most `width` sites from p along each axis.
  std::int64_t around(const Place& p, std::int64_t width) const {
    std::int64_t count = 0;
    for (int corner = 0; corner < 8; ++corner) {
      Place q;
      int sign = 1;
      for (int k = 0; k < 3; ++k) {
        const bool upper = corner >> k & 1;
        q[k] = upper ? std::min(p[k] + width + 1, size_[k]) : std::max<std::int64_t>(p[k] - width, 0);
        if (!upper) sign = -sign;
      }
      count += sign * sums_[at(q[0], q[1], q[2])];
    }
    return count;
  }

 private:
  std::size_t at(std::int64_t x, std::int64_t y, std::int64_t z) const {
    return (z * (size_[1] + 1) + y) * (size_[0] + 1) + x;
  }
  Place size_;
  std::vector<std::int64_t> sums_;
};

std::optional<Lattice> sitesOf(const Points& rest) {
  Lattice lattice;
  Axis axes[3];
  double sites = 1.0;
  for (int k = 0; k < 3; ++k) {
    if (!findAxis(rest, k, axes[k])) return std::nullopt;
    sites *= axes[k].count;
    if (!(sites <= kMostEmpty * static_cast<double>(rest.size()) && sites < 1e9)) return std::nullopt;
    lattice.size[k] = static_cast<std::uint32_t>(axes[k].count);
  }
  std::vector<bool> taken(static_cast<std::size_t>(sites), false);
  for (const Vec3& p : rest) {
    std::size_t place[3];
    for (int k = 0; k < 3; ++k) place[k] = static_cast<std::size_t>(std::round((p[k] - axes[k].low) / axes[k].spacing));
    const std::size_t site = (place[2] * lattice.size[1] + place[1]) * lattice.size[0] + place[0];
    if (taken[site]) return std::nullopt;
    taken[site] = true;
    lattice.sites.push_back(static_cast<std::uint32_t>(site));
  }
  return lattice;
}

// The lattice whose neighbourhoods the clusters are, if they are.
std::optional<Lattice> latticeOf(const MatchInput& body) {
  const ClusterSet& set = body.clusters;
  if (body.rest.empty() || set.size() != body.rest.size()) return std::nullopt;
  std::vector<double> weight(body.rest.size(), -1.0);
  for (std::size_t k = 0; k < set.members.size(); ++k) {
    double& w = weight[set.members[k]];
    if (w < 0.0) w = set.weights[k];
    if (!(std::abs(w - set.weights[k]) <= kSameWeight * w)) return std::nullopt;
  }
  std::optional<Lattice> lattice = sitesOf(body.rest);
  if (!lattice) return lattice;
  const Place size = {lattice->size[0], lattice->size[1], lattice->size[2]};
  const auto placeOf = [&](Index i) -> Place {
    const std::int64_t s = lattice->sites[i];
    return {s % size[0], s / size[0] % size[1], s / (size[0] * size[1])};
  };
  std::int64_t width = 0;
  for (Index c = 0; c < set.size(); ++c) {
    const Place centre = placeOf(c);
    for (Index k = set.offsets[c]; k < set.offsets[c + 1]; ++k) {
      const Place p = placeOf(set.members[k]);
      for (int axis = 0; axis < 3; ++axis) width = std::max(width, std::abs(p[axis] - centre[axis]));
    }
  }
  // As many different members as there are within the width, and none beyond it: then they are the neighbourhood.
  const BoxCount box(size, lattice->sites);
  std::vector<Index> last(body.rest.size(), kNoIndex);
  for (Index c = 0; c < set.size(); ++c) {
    if (box.around(placeOf(c), width) != set.offsets[c + 1] - set.offsets[c]) return std::nullopt;
    for (Index k = set.offsets[c]; k < set.offsets[c + 1]; ++k) {
      if (last[set.members[k]] == c) return std::nullopt;
      last[set.members[k]] = c;
    }
  }
  lattice->width = static_cast<std::uint32_t>(width);
  return lattice;
}

}  // namespace

struct SummedBatch::Impl : match_sets::OverlapCore {
  explicit Impl(const MatchInput& body) : OverlapCore(body, latticeOf(body)) { assert(lattice); }
};

bool SummedBatch::holds(const MatchInput& body) { return match_sets::isUnplastic(body) && latticeOf(body).has_value(); }

SummedBatch::SummedBatch(const MatchInput& body) : impl_(std::make_unique<Impl>(body)) {}
SummedBatch::~SummedBatch() = default;
SummedBatch::SummedBatch(SummedBatch&&) noexcept = default;
SummedBatch& SummedBatch::operator=(SummedBatch&&) noexcept = default;

void SummedBatch::setState(const Points& positions, const Points& velocities, const std::vector<Quat>& rotations) {
  impl_->setState(positions, velocities, rotations);
}

void SummedBatch::getState(Points& positions, Points& velocities, std::vector<Quat>& rotations) const {
  impl_->getState(positions, velocities, rotations);
}

void SummedBatch::step(const BatchStep& step, MatchCounters& counters, const ForEach& for_each) {
  impl_->step(step, counters, for_each);
}

void SummedBatch::match(const Points& y, MatchMode mode, double beta, std::vector<ClusterPose>& poses, Points& goals,
                        MatchCounters& counters, const ForEach& for_each) {
  impl_->match(y, mode, beta, poses, goals, counters, for_each);
}

}  // namespace meshless
