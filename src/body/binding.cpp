#include "meshless_surgery/body/binding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <mutex>
#include <optional>

#include <tbb/enumerable_thread_specific.h>
#include <Eigen/Eigenvalues>

#include "meshless_surgery/geometry/nearest.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr std::size_t kCarriers = 12;
constexpr std::size_t kEnoughCarriers = 9;    // left of a rider's by a cut: no others are looked for
constexpr std::size_t kMostCarriers = 40;     // of a rider that twelve would amplify
constexpr double kSoft[] = {0.01, 0.1, 1.0};  // the softer, the less do the nearest carriers outweigh the others
constexpr std::size_t kChunk = 256;           // riders
constexpr std::size_t kWalk = 64;             // particles looked at around the nearest one, along the body
constexpr double kLever = 1e-9;               // of the distance to the farthest carrier: less is rounding
constexpr double kRank = 0.03;  // of the moment's eigenvalues to the largest: below it, extrapolation is wild

// Puts the `count` least first and in order. (A sixth of the time of std::partial_sort: the order is nearly right.)
void firstInOrder(std::vector<std::pair<double, Index>>& order, std::size_t count) {
  for (std::size_t i = 1; i < order.size(); ++i) {
    const auto entry = order[i];
    std::size_t k = std::min(i, count);
    if (i >= count) {
      if (!(entry < order[count - 1])) continue;
      order[i] = order[--k];
    }
    for (; k > 0 && entry < order[k - 1]; --k) order[k] = order[k - 1];
    order[k] = entry;
  }
}

double magnitudeOf(const std::vector<double>& weights) {
  double sum = 0.0;
  for (double w : weights) sum += std::abs(w);
  return sum;
}

// Weights of the best affine map through the carriers, at p.
void leastSquaresWeights(const Points& rest, const Vec3& p, const std::vector<Index>& carriers, double soft,
                         std::vector<double>& weights) {
  const double reach = 1.1 * (rest[carriers.back()] - p).norm() + 1e-300;
  const std::size_t n = carriers.size();
  std::array<double, kMostCarriers> share;
  std::array<std::array<double, 3>, kMostCarriers> arms;  // from p, in units of the reach
  double total = 0.0;
  Vec3 mean = Vec3::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    const Vec3 arm = (rest[carriers[k]] - p) / reach;
    const double squared = arm.squaredNorm();
    share[k] = (1.0 - squared) * (1.0 - squared) / (soft + squared);
    total += share[k];
    mean += share[k] * arm;
    arms[k] = {arm.x(), arm.y(), arm.z()};
  }
  mean /= total;
  // About the mean: what the particles do not span then drops out by itself.
  double xx = 0.0, xy = 0.0, xz = 0.0, yy = 0.0, yz = 0.0, zz = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    share[k] /= total;
    for (int axis = 0; axis < 3; ++axis) arms[k][axis] -= mean[axis];
    const double x = share[k] * arms[k][0], y = share[k] * arms[k][1], z = share[k] * arms[k][2];
    xx += x * arms[k][0], xy += x * arms[k][1], xz += x * arms[k][2];
    yy += y * arms[k][1], yz += y * arms[k][2], zz += z * arms[k][2];
  }
  Mat3 moment;
  moment << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  Vec3 slope = Vec3::Zero();  // of the weights, along what is spanned
  const double trace = moment.trace();
  // 4 det / trace^2 is below the smallest eigenvalue, and the largest is below the trace.
  if (4.0 * moment.determinant() > kRank * trace * trace * trace) {
    slope = moment.inverse() * -mean;
  } else {
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(moment);
    const double least = kRank * std::max(solver.eigenvalues()[2], 1e-300);
    for (int axis = 0; axis < 3; ++axis)
      if (solver.eigenvalues()[axis] > least)
        slope +=
            solver.eigenvectors().col(axis) * (solver.eigenvectors().col(axis).dot(-mean) / solver.eigenvalues()[axis]);
  }
  weights.resize(n);
  for (std::size_t k = 0; k < n; ++k)
    weights[k] = share[k] * (1.0 + slope[0] * arms[k][0] + slope[1] * arms[k][1] + slope[2] * arms[k][2]);
  // Too much still: part of the way to the mean, which amplifies nothing. The lever takes what is missing then.
  const double most = magnitudeOf(weights);
  if (soft < kSoft[2] || !(most > kMostWeight)) return;
  double low = 0.0, high = 1.0;  // of the slope
  const auto at = [&](double part) {
    double sum = 0.0;
    for (std::size_t k = 0; k < n; ++k) sum += std::abs(share[k] + part * (weights[k] - share[k]));
    return sum;
  };
  for (int halving = 0; halving < 30; ++halving) {
    const double middle = 0.5 * (low + high);
    (at(middle) > kMostWeight ? high : low) = middle;
  }
  for (std::size_t k = 0; k < n; ++k) weights[k] = share[k] + low * (weights[k] - share[k]);
}

// Looks for the carriers of riders, one after the other.
class Binder {
 public:
  struct Task {
    const Points& rest;
    const ParticleGraph& graph;
    const Points& surface_rest;
    const std::vector<Index>& cluster_of;
    const InheritedBinding* inherited;
    const std::function<const NearestPoints&()> nearest;
  };

  explicit Binder(const Task& task)
      : task_(task), seen_(task.rest.size(), kNoIndex), walk_of_(task.rest.size(), kNoIndex) {}

  /// From here on riders are bound into `part`, without particle and riders.
  void begin(std::size_t riders, SurfaceBinding& part) {
    part_ = &part;
    part.offsets.reserve(riders + 1);
    part.offsets.push_back(0);
    part.levers.reserve(riders);
    part.turners.reserve(riders);
    part.carriers.reserve(kCarriers * riders);
    part.weights.reserve(kCarriers * riders);
  }

  void bind(Index v) {
    if (inherit(v)) return;
    ++part_->bound;
    const Points& rest = task_.rest;
    const Vec3& p = task_.surface_rest[v];
    if (keepMost(v)) {
      leastSquaresWeights(rest, p, near_, kSoft[0], weights_);
      if (!(magnitudeOf(weights_) > kMostWeight)) return finishAt(p);
    }
    const Index start = startOf(v);
    order_.clear();
    for (Index i : walkFrom(start)) {
      if (i == kNoIndex) break;
      if (i == start || !isSeparated(v, i)) order_.emplace_back((rest[i] - p).squaredNorm(), i);
    }
    choose(kCarriers);
    leastSquaresWeights(rest, p, near_, kSoft[0], weights_);
    for (const double soft : {kSoft[1], kSoft[2]}) {
      if (!(magnitudeOf(weights_) > kMostWeight)) break;
      if (soft == kSoft[1]) choose(kMostCarriers);
      leastSquaresWeights(rest, p, near_, soft, weights_);
    }
    finishAt(p);
  }

 private:
  bool isSeparated(Index v, Index particle) const {
    return task_.inherited && task_.inherited->separated && task_.inherited->separated(v, particle);
  }

  bool inherit(Index v) {
    const Index r = task_.inherited ? task_.inherited->rider[v] : kNoIndex;
    if (r == kNoIndex) return false;
    const SurfaceBinding& parent = task_.inherited->parent;
    near_.clear();
    for (Index k = parent.offsets[r]; k < parent.offsets[r + 1]; ++k) {
      near_.push_back(task_.inherited->renumbered[parent.carriers[k]]);
      if (near_.back() == kNoIndex || isSeparated(v, near_.back())) return false;
    }
    weights_.assign(parent.weights.begin() + parent.offsets[r], parent.weights.begin() + parent.offsets[r + 1]);
    finish(parent.levers[r]);
    return true;
  }

  /// What a cut left of the carriers, where that is enough.
  bool keepMost(Index v) {
    const Index r = task_.inherited ? task_.inherited->rider[v] : kNoIndex;
    if (r == kNoIndex || task_.inherited->separated) return false;
    const SurfaceBinding& parent = task_.inherited->parent;
    near_.clear();
    for (Index k = parent.offsets[r]; k < parent.offsets[r + 1] && near_.size() < kCarriers; ++k)
      if (const Index kept = task_.inherited->renumbered[parent.carriers[k]]; kept != kNoIndex) near_.push_back(kept);
    return near_.size() >= kEnoughCarriers;
  }

  /// The nearest particle that the rider may follow.
  Index startOf(Index v) const {
    const Vec3& p = task_.surface_rest[v];
    if (const Index r = task_.inherited ? task_.inherited->rider[v] : kNoIndex; r != kNoIndex) {
      // Carriers are sorted by distance: the first that is left is the nearest.
      const SurfaceBinding& parent = task_.inherited->parent;
      for (Index k = parent.offsets[r]; k < parent.offsets[r + 1]; ++k)
        if (const Index kept = task_.inherited->renumbered[parent.carriers[k]];
            kept != kNoIndex && !isSeparated(v, kept))
          return kept;
    }
    if (task_.inherited && task_.inherited->separated) {
      std::array<Index, kWalk> near;
      for (const std::size_t looked : {std::size_t{4}, kWalk}) {
        const std::size_t count = task_.nearest().nearest(p, looked, near.data());
        for (std::size_t k = 0; k < count; ++k)
          if (!isSeparated(v, near[k])) return near[k];
      }
    }
    return task_.nearest().nearest(p);
  }

  // Particles around one, by steps along the graph; fewer than kWalk end with kNoIndex. The next rider starts there
  // too.
  using Walk = std::array<Index, kWalk>;
  const Walk& walkFrom(Index start) {
    if (walk_of_[start] != kNoIndex) return walks_[walk_of_[start]];
    walk_of_[start] = static_cast<Index>(walks_.size());
    Walk& found = walks_.emplace_back();
    std::size_t count = 0;
    const auto find = [&](Index i) {
      if (count == kWalk || seen_[i] == start) return;
      seen_[i] = start;
      found[count++] = i;
    };
    find(start);
    const ParticleGraph& graph = task_.graph;
    for (std::size_t at = 0; at < count && count < kWalk; ++at)
      for (Index k = graph.offsets[found[at]]; k < graph.offsets[found[at] + 1]; ++k) find(graph.neighbours[k]);
    if (count < kWalk) found[count] = kNoIndex;
    return found;
  }

  void choose(std::size_t most) {
    const std::size_t count = std::min(order_.size(), most);
    const auto end = order_.begin() + static_cast<std::ptrdiff_t>(count);
    if (most <= kCarriers) {
      firstInOrder(order_, count);
    } else {
      if (order_.size() > most) std::nth_element(order_.begin(), end - 1, order_.end());
      std::sort(order_.begin(), end);
    }
    near_.clear();
    for (auto at = order_.begin(); at != end; ++at) near_.push_back(at->second);
  }

  void finishAt(const Vec3& p) {
    Vec3 lever = p;
    for (std::size_t k = 0; k < near_.size(); ++k) lever -= weights_[k] * task_.rest[near_[k]];
    const double span = (task_.rest[near_.back()] - p).norm();
    finish(lever.norm() > kLever * span ? lever : Vec3(Vec3::Zero()));
  }

  void finish(const Vec3& lever) {
    part_->levers.push_back(lever);
    part_->turners.push_back(task_.cluster_of[near_[0]]);
    if (!lever.isZero(0.0)) part_->lever_clusters.push_back(part_->turners.back());
    part_->carriers.insert(part_->carriers.end(), near_.begin(), near_.end());
    part_->weights.insert(part_->weights.end(), weights_.begin(), weights_.end());
    part_->offsets.push_back(static_cast<Index>(part_->carriers.size()));
  }

  const Task& task_;
  SurfaceBinding* part_ = nullptr;
  std::vector<Index> near_, seen_;  // seen_: the last walk that came by
  std::vector<Index> walk_of_;      // of a particle, in walks_
  std::vector<Walk> walks_;
  std::vector<std::pair<double, Index>> order_;
  std::vector<double> weights_;
};

template <class T>
void append(const std::vector<T>& from, std::vector<T>& to) {
  to.insert(to.end(), from.begin(), from.end());
}

void appendPart(const SurfaceBinding& part, SurfaceBinding& binding) {
  const Index carriers = static_cast<Index>(binding.carriers.size());
  for (std::size_t k = 1; k < part.offsets.size(); ++k) binding.offsets.push_back(carriers + part.offsets[k]);
  append(part.carriers, binding.carriers);
  append(part.weights, binding.weights);
  append(part.levers, binding.levers);
  append(part.turners, binding.turners);
  append(part.lever_clusters, binding.lever_clusters);
  binding.bound += part.bound;
}

}  // namespace

SurfaceBinding bindSurface(const Points& rest, const ParticleGraph& graph, const ClusterSet& clusters,
                           const Points& surface_rest, std::vector<Index> vertex_particle,
                           const InheritedBinding* inherited) {
  SurfaceBinding binding;
  binding.particle = std::move(vertex_particle);
  binding.offsets.push_back(0);
  for (Index v = 0; v < surface_rest.size(); ++v)
    if (binding.particle[v] == kNoIndex) binding.riders.push_back(v);
  if (binding.riders.empty()) return binding;

  std::vector<Index> cluster_of(rest.size(), 0);
  for (Index c = clusters.size(); c-- > 0;)
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) cluster_of[clusters.members[k]] = c;
  std::optional<NearestPoints> nearest;
  std::once_flag once;
  const Binder::Task task{rest, graph, surface_rest, cluster_of, inherited, [&]() -> const NearestPoints& {
                            std::call_once(once, [&] { nearest.emplace(rest); });
                            return *nearest;
                          }};
  const std::size_t riders = binding.riders.size();
  std::vector<SurfaceBinding> parts((riders + kChunk - 1) / kChunk);
  tbb::enumerable_thread_specific<Binder> binders([&] { return Binder(task); });
  inChunks(riders, kChunk, [&](std::size_t from, std::size_t to) {
    Binder& binder = binders.local();
    binder.begin(to - from, parts[from / kChunk]);
    for (std::size_t r = from; r < to; ++r) binder.bind(binding.riders[r]);
  });
  binding.carriers.reserve(kCarriers * riders);
  binding.weights.reserve(kCarriers * riders);
  for (const SurfaceBinding& part : parts) appendPart(part, binding);
  std::sort(binding.lever_clusters.begin(), binding.lever_clusters.end());
  binding.lever_clusters.erase(std::unique(binding.lever_clusters.begin(), binding.lever_clusters.end()),
                               binding.lever_clusters.end());
  return binding;
}

}  // namespace meshless
