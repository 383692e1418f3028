#include "meshless_surgery/body/binding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>

#include "meshless_surgery/geometry/nearest.h"

namespace meshless {
namespace {

constexpr std::size_t kCarriers = 12;
constexpr std::size_t kMostCarriers = 40;  // of a rider that twelve would amplify
constexpr double kSoft[] = {0.01, 0.1, 1.0};  // the softer, the less do the nearest carriers outweigh the others
constexpr std::size_t kWalk = 64;  // particles looked at around the nearest one, along the body
constexpr double kLever = 1e-9;    // of the distance to the farthest carrier: less is rounding
constexpr double kRank = 0.03;     // of the moment's eigenvalues to the largest: below it, extrapolation is wild

// Up to kWalk particles around `start`, by steps along the graph.
void walk(const ParticleGraph& graph, Index start, std::vector<Index>& found, std::vector<Index>& seen, Index stamp) {
  found.assign(1, start);
  seen[start] = stamp;
  for (std::size_t at = 0; at < found.size() && found.size() < kWalk; ++at)
    for (Index k = graph.offsets[found[at]]; k < graph.offsets[found[at] + 1] && found.size() < kWalk; ++k) {
      const Index next = graph.neighbours[k];
      if (seen[next] == stamp) continue;
      seen[next] = stamp;
      found.push_back(next);
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
  std::array<double, kMostCarriers> share{};
  double total = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const double ratio = (rest[carriers[k]] - p).norm() / reach;
    share[k] = (1.0 - ratio * ratio) * (1.0 - ratio * ratio) / (soft + ratio * ratio);
    total += share[k];
  }
  // About the mean: what the particles do not span then drops out by itself.
  Vec3 mean = Vec3::Zero();
  for (std::size_t k = 0; k < n; ++k) mean += share[k] / total * (rest[carriers[k]] - p);
  Mat3 moment = Mat3::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    const Vec3 r = (rest[carriers[k]] - p - mean) / reach;
    moment += share[k] / total * r * r.transpose();
  }
  Vec3 slope = Vec3::Zero();  // of the weights, along what is spanned
  const double trace = moment.trace();
  // 4 det / trace^2 is below the smallest eigenvalue, and the largest is below the trace.
  if (4.0 * moment.determinant() > kRank * trace * trace * trace) {
    slope = moment.inverse() * (-mean / reach);
  } else {
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(moment);
    const double least = kRank * std::max(solver.eigenvalues()[2], 1e-300);
    for (int axis = 0; axis < 3; ++axis)
      if (solver.eigenvalues()[axis] > least)
        slope += solver.eigenvectors().col(axis) *
                 (solver.eigenvectors().col(axis).dot(-mean / reach) / solver.eigenvalues()[axis]);
  }
  weights.resize(n);
  for (std::size_t k = 0; k < n; ++k)
    weights[k] = share[k] / total * (1.0 + slope.dot((rest[carriers[k]] - p - mean) / reach));
  // Too much still: part of the way to the mean, which amplifies nothing. The lever takes what is missing then.
  const double most = magnitudeOf(weights);
  if (soft < kSoft[2] || !(most > kMostWeight)) return;
  double low = 0.0, high = 1.0;  // of the slope
  const auto at = [&](double part) {
    double sum = 0.0;
    for (std::size_t k = 0; k < n; ++k) sum += std::abs(share[k] / total + part * (weights[k] - share[k] / total));
    return sum;
  };
  for (int halving = 0; halving < 30; ++halving) {
    const double middle = 0.5 * (low + high);
    (at(middle) > kMostWeight ? high : low) = middle;
  }
  for (std::size_t k = 0; k < n; ++k) weights[k] = share[k] / total + low * (weights[k] - share[k] / total);
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
  std::optional<NearestPoints> nearest;  // made where one is bound anew
  std::vector<Index> near, seen(rest.size(), kNoIndex);
  std::vector<std::vector<Index>> walks;  // around a particle: the next rider starts there too
  std::vector<std::pair<double, Index>> order;
  std::vector<double> weights;
  Index stamp = 0;
  const auto finish = [&](const Vec3& lever) {
    binding.levers.push_back(lever);
    binding.turners.push_back(cluster_of[near[0]]);
    if (!lever.isZero(0.0)) binding.lever_clusters.push_back(binding.turners.back());
    binding.carriers.insert(binding.carriers.end(), near.begin(), near.end());
    binding.weights.insert(binding.weights.end(), weights.begin(), weights.end());
    binding.offsets.push_back(static_cast<Index>(binding.carriers.size()));
  };
  const auto inherit = [&](Index v) {
    const Index r = inherited ? inherited->rider[v] : kNoIndex;
    if (r == kNoIndex) return false;
    const SurfaceBinding& parent = inherited->parent;
    near.clear();
    for (Index k = parent.offsets[r]; k < parent.offsets[r + 1]; ++k) {
      near.push_back(inherited->renumbered[parent.carriers[k]]);
      if (near.back() == kNoIndex || (inherited->separated && inherited->separated(v, near.back()))) return false;
    }
    weights.assign(parent.weights.begin() + parent.offsets[r], parent.weights.begin() + parent.offsets[r + 1]);
    finish(parent.levers[r]);
    return true;
  };
  for (Index v : binding.riders) {
    if (inherit(v)) continue;
    ++binding.bound;
    const Vec3& p = surface_rest[v];
    if (!nearest) nearest.emplace(rest);
    const bool lips = inherited && inherited->separated;
    Index start = nearest->nearest(p);
    if (lips) {
      for (Index i : nearest->nearest(p, kWalk))
        if (!inherited->separated(v, i)) {
          start = i;
          break;
        }
    }
    if (walks.empty()) walks.resize(rest.size());
    if (walks[start].empty()) walk(graph, start, walks[start], seen, stamp++);
    order.clear();
    for (Index i : walks[start])
      if (i == start || !lips || !inherited->separated(v, i)) order.emplace_back((rest[i] - p).squaredNorm(), i);
    const auto bind = [&](std::size_t most, double soft) {
      const auto count = static_cast<std::ptrdiff_t>(std::min(order.size(), most));
      if (order.size() > most) std::nth_element(order.begin(), order.begin() + count - 1, order.end());
      std::sort(order.begin(), order.begin() + count);
      near.clear();
      for (auto at = order.begin(); at != order.begin() + count; ++at) near.push_back(at->second);
      leastSquaresWeights(rest, p, near, soft, weights);
    };
    bind(kCarriers, kSoft[0]);
    for (const double soft : {kSoft[1], kSoft[2]})
      if (magnitudeOf(weights) > kMostWeight) bind(kMostCarriers, soft);
    Vec3 lever = p;
    for (std::size_t k = 0; k < near.size(); ++k) lever -= weights[k] * rest[near[k]];
    const double span = (rest[near.back()] - p).norm();
    finish(lever.norm() > kLever * span ? lever : Vec3(Vec3::Zero()));
  }
  std::sort(binding.lever_clusters.begin(), binding.lever_clusters.end());
  binding.lever_clusters.erase(std::unique(binding.lever_clusters.begin(), binding.lever_clusters.end()),
                               binding.lever_clusters.end());
  return binding;
}

}  // namespace meshless
