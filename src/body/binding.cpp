#include "meshless_surgery/body/binding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>

#include <tbb/enumerable_thread_specific.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "meshless_surgery/geometry/query/nearest.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr std::size_t kCarriers = 12;
constexpr std::size_t kEnoughCarriers = 9;    // that a cut leaves of a vertex: no others are searched for
constexpr std::size_t kFewCarriers = 8;       // as a cell has corners: smooth surfaces have three times as many
constexpr std::size_t kMostCarriers = 40;     // of a vertex that twelve would amplify
constexpr double kSoft[] = {0.01, 0.1, 1.0};  // the softer, the less do the nearest carriers outweigh the others
constexpr std::size_t kChunk = 64;            // embedded vertices
constexpr std::size_t kWalk = 64;             // particles tried around the nearest one, along the body
constexpr double kLever = 1e-9;               // of the distance to the farthest carrier: less is rounding
constexpr double kRank = 0.03;  // of the moment's eigenvalues to the largest: below it, extrapolation is wild

double magnitudeOf(const std::vector<double>& weights) {
  double sum = 0.0;
  for (double w : weights) sum += std::abs(w);
  return sum;
}

// Squared distances in the order of integers, of which comparing takes half the time: their last bits say what it is.
std::uint64_t orderedKey(double squared, std::size_t which) {
  std::uint64_t bits;
  std::memcpy(&bits, &squared, sizeof bits);
  return bits / kWalk * kWalk + which;
}
double squaredOf(std::uint64_t key) {
  double squared;
  std::memcpy(&squared, &key, sizeof squared);
  return squared;
}

using OfCarriers = Eigen::Array<double, Eigen::Dynamic, 1, 0, static_cast<int>(kMostCarriers), 1>;

// Weights of the best affine map through the carriers, at p.
void leastSquaresWeights(const Points& rest, const Vec3& p, const std::vector<Index>& carriers, double soft,
                         std::vector<double>& weights) {
  const Eigen::Index n = static_cast<Eigen::Index>(carriers.size());
  const double scale = 1.0 / (1.1 * (rest[carriers.back()] - p).norm() + 1e-300);
  OfCarriers x(n), y(n), z(n);  // of the arms from p, in units of the reach
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vec3& at = rest[carriers[static_cast<std::size_t>(k)]];
    x[k] = scale * (at.x() - p.x());
    y[k] = scale * (at.y() - p.y());
    z[k] = scale * (at.z() - p.z());
  }
  const OfCarriers squared = x.square() + y.square() + z.square();
  OfCarriers share = (1.0 - squared).square() / (soft + squared);
  share *= 1.0 / share.sum();
  const Vec3 mean((share * x).sum(), (share * y).sum(), (share * z).sum());
  // About the mean: what the particles do not span then drops out by itself.
  x -= mean.x();
  y -= mean.y();
  z -= mean.z();
  const OfCarriers share_x = share * x, share_y = share * y;
  const double xx = (share_x * x).sum(), xy = (share_x * y).sum(), xz = (share_x * z).sum();
  const double yy = (share_y * y).sum(), yz = (share_y * z).sum(), zz = (share * z.square()).sum();
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
  weights.resize(carriers.size());
  Eigen::Map<Eigen::ArrayXd> found(weights.data(), n);
  const OfCarriers beyond = share * (slope.x() * x + slope.y() * y + slope.z() * z);
  found = share + beyond;
  if (soft < kSoft[2] || !(found.abs().sum() > kMostWeight)) return;
  // Too much still: part of the way to the mean, which amplifies nothing. The lever takes what is missing then.
  double low = 0.0, high = 1.0;  // of the slope
  for (int halving = 0; halving < 30; ++halving) {
    const double middle = 0.5 * (low + high);
    ((share + middle * beyond).abs().sum() > kMostWeight ? high : low) = middle;
  }
  found = share + low * beyond;
}

// Finds the carriers of embedded vertices, one after the other.
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

  /// From here on vertices are bound into `part`; its `particle` and `embedded` stay empty.
  void begin(std::size_t count, SurfaceBinding& part) {
    part_ = &part;
    part.offsets.reserve(count + 1);
    part.offsets.push_back(0);
    part.levers.reserve(count);
    part.turners.reserve(count);
    part.carriers.reserve(kCarriers * count);
    part.weights.reserve(kCarriers * count);
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
    const Walk& walk = walkFrom(startOf(v));
    choose(v, walk, kCarriers);
    leastSquaresWeights(rest, p, near_, kSoft[0], weights_);
    for (const double soft : {kSoft[1], kSoft[2]}) {
      if (!(magnitudeOf(weights_) > kMostWeight)) break;
      if (soft == kSoft[1]) choose(v, walk, kMostCarriers);
      leastSquaresWeights(rest, p, near_, soft, weights_);
    }
    finishAt(p);
  }

 private:
  bool isSeparated(Index v, Index particle) const {
    return task_.inherited && task_.inherited->separated && task_.inherited->separated(v, particle);
  }

  bool inherit(Index v) {
    const Index r = task_.inherited ? task_.inherited->embedded[v] : kNoIndex;
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
    const Index r = task_.inherited ? task_.inherited->embedded[v] : kNoIndex;
    if (r == kNoIndex || task_.inherited->separated) return false;
    const SurfaceBinding& parent = task_.inherited->parent;
    near_.clear();
    for (Index k = parent.offsets[r]; k < parent.offsets[r + 1] && near_.size() < kCarriers; ++k)
      if (const Index kept = task_.inherited->renumbered[parent.carriers[k]]; kept != kNoIndex) near_.push_back(kept);
    return near_.size() >= kEnoughCarriers;
  }

  /// The particle nearest to the vertex along the body that it may follow.
  Index startOf(Index v) {
    const Vec3& p = task_.surface_rest[v];
    if (const Index r = task_.inherited ? task_.inherited->embedded[v] : kNoIndex; r != kNoIndex) {
      // Carriers are sorted by distance: the first that is left is the nearest.
      const SurfaceBinding& parent = task_.inherited->parent;
      for (Index k = parent.offsets[r]; k < parent.offsets[r + 1]; ++k)
        if (const Index kept = task_.inherited->renumbered[parent.carriers[k]];
            kept != kNoIndex && !isSeparated(v, kept))
          return kept;
    }
    if (task_.inherited && !task_.inherited->start.empty())
      if (const Index known = task_.inherited->start[v]; known != kNoIndex && !isSeparated(v, known))
        return climbFrom(known, v);
    if (task_.inherited && task_.inherited->separated) {
      std::array<Index, kWalk> near;
      for (const std::size_t most : {std::size_t{4}, kWalk}) {
        const std::size_t count = task_.nearest().nearest(p, most, near.data());
        for (std::size_t k = 0; k < count; ++k)
          if (!isSeparated(v, near[k])) return near[k];
      }
    }
    return task_.nearest().nearest(p);
  }

  // Particles around one, by steps along the graph, the nearest first. The next vertex starts there too.
  struct Walk {
    std::size_t count = 0;
    std::array<std::pair<double, Index>, kWalk> found;  // [m] from the first
  };
  const Walk& walkFrom(Index start) {
    if (walk_of_[start] != kNoIndex) return walks_[walk_of_[start]];
    walk_of_[start] = static_cast<Index>(walks_.size());
    Walk& walk = walks_.emplace_back();
    const auto find = [&](Index i) {
      if (walk.count == kWalk || seen_[i] == start) return;
      seen_[i] = start;
      walk.found[walk.count++] = {(task_.rest[i] - task_.rest[start]).norm(), i};
    };
    find(start);
    const ParticleGraph& graph = task_.graph;
    for (std::size_t at = 0; at < walk.count && walk.count < kWalk; ++at) {
      const Index from = walk.found[at].second;
      for (Index k = graph.offsets[from]; k < graph.offsets[from + 1]; ++k) find(graph.neighbours[k]);
    }
    std::sort(walk.found.begin() + 1, walk.found.begin() + static_cast<std::ptrdiff_t>(walk.count));
    return walk;
  }

  /// Nearer and nearer along the body; a blade may have met an edge far from both of its ends.
  Index climbFrom(Index at, Index v) {
    for (;;) {
      const Index next = nearestOf(walkFrom(at), v);
      if (next == at) return at;
      at = next;
    }
  }

  Index nearestOf(const Walk& walk, Index v) const {
    const Vec3& p = task_.surface_rest[v];
    Index nearest = walk.found[0].second;
    const double aside = (task_.rest[nearest] - p).norm();
    double least = aside;
    for (std::size_t k = 1; k < walk.count && walk.found[k].first < aside + least; ++k) {
      const Index i = walk.found[k].second;
      const double here = (task_.rest[i] - p).norm();
      if (!(here < least) || isSeparated(v, i)) continue;
      least = here;
      nearest = i;
    }
    return nearest;
  }

  // The particles nearest to the vertex in order, up to `most` of those that it may follow.
  void choose(Index v, const Walk& walk, std::size_t most) {
    const Vec3& p = task_.surface_rest[v];
    const double aside = (task_.rest[walk.found[0].second] - p).norm();
    std::array<std::uint64_t, kMostCarriers> order;
    std::size_t count = 0;
    double farthest = std::numeric_limits<double>::infinity();  // squared, once there are enough
    for (std::size_t k = 0; k < walk.count; ++k) {
      const auto& [away, i] = walk.found[k];
      // No other can be nearer than this.
      if (const double least = away - aside; least > 0.0 && least * least > farthest) break;
      const double squared = (task_.rest[i] - p).squaredNorm();
      if (squared > farthest || (k > 0 && isSeparated(v, i))) continue;
      const std::uint64_t entry = orderedKey(squared, k);
      if (count == most && entry > order[most - 1]) continue;  // as far, but for rounding
      std::size_t at = count < most ? count++ : most - 1;
      for (; at > 0 && entry < order[at - 1]; --at) order[at] = order[at - 1];
      order[at] = entry;
      if (count == most) farthest = squaredOf(order[most - 1]);
    }
    near_.clear();
    for (std::size_t k = 0; k < count; ++k) near_.push_back(walk.found[order[k] % kWalk].second);
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
    if (binding.particle[v] == kNoIndex) binding.embedded.push_back(v);
  if (binding.embedded.empty()) return binding;

  std::vector<Index> cluster_of(rest.size(), 0);
  for (Index c = clusters.size(); c-- > 0;)
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) cluster_of[clusters.members[k]] = c;
  std::optional<NearestPoints> nearest;
  std::once_flag once;
  const Binder::Task task{rest, graph, surface_rest, cluster_of, inherited, [&]() -> const NearestPoints& {
                            std::call_once(once, [&] { nearest.emplace(rest); });
                            return *nearest;
                          }};
  const std::size_t count = binding.embedded.size();
  std::vector<SurfaceBinding> parts((count + kChunk - 1) / kChunk);
  tbb::enumerable_thread_specific<Binder> binders([&] { return Binder(task); });
  inChunks(count, kChunk, [&](std::size_t from, std::size_t to) {
    Binder& binder = binders.local();
    binder.begin(to - from, parts[from / kChunk]);
    for (std::size_t r = from; r < to; ++r) binder.bind(binding.embedded[r]);
  });
  binding.carriers.reserve(kCarriers * count);
  binding.weights.reserve(kCarriers * count);
  for (const SurfaceBinding& part : parts) appendPart(part, binding);
  std::sort(binding.lever_clusters.begin(), binding.lever_clusters.end());
  binding.lever_clusters.erase(std::unique(binding.lever_clusters.begin(), binding.lever_clusters.end()),
                               binding.lever_clusters.end());
  return binding;
}

SurfaceBinding fewerCarriers(const SurfaceBinding& binding, const Points& rest, double spacing) {
  struct Carrier {
    Index particle;
    double weight;
    Eigen::Vector4d terms;  // 1, and where it is from the vertex
  };
  std::vector<Carrier> carriers;
  SurfaceBinding fewer = binding;
  fewer.carriers.clear();
  fewer.weights.clear();
  for (Index r = 0; r < binding.embedded.size(); ++r) {
    Vec3 place = Vec3::Zero();
    for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k)
      place += binding.weights[k] * rest[binding.carriers[k]];
    carriers.clear();
    for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k) {
      carriers.push_back({binding.carriers[k], binding.weights[k], Eigen::Vector4d::UnitX()});
      carriers.back().terms.tail<3>() = (rest[binding.carriers[k]] - place) / spacing;
    }
    std::stable_sort(carriers.begin(), carriers.end(),
                     [](const Carrier& a, const Carrier& b) { return std::abs(a.weight) > std::abs(b.weight); });
    Eigen::Vector4d lacking = Eigen::Vector4d::UnitX();
    Eigen::Matrix4d moments = Eigen::Matrix4d::Zero();
    const std::size_t count = std::min(carriers.size(), kFewCarriers);
    for (std::size_t k = 0; k < count; ++k) {
      lacking -= carriers[k].weight * carriers[k].terms;
      moments += std::abs(carriers[k].weight) * carriers[k].terms * carriers[k].terms.transpose();
    }
    const Eigen::LDLT<Eigen::Matrix4d> solver(moments);
    if (count < carriers.size() && solver.rcond() > kRank * kRank) {
      carriers.resize(count);
      const Eigen::Vector4d more = solver.solve(lacking);
      for (Carrier& carrier : carriers) carrier.weight += std::abs(carrier.weight) * more.dot(carrier.terms);
    }
    for (const Carrier& carrier : carriers) {
      fewer.carriers.push_back(carrier.particle);
      fewer.weights.push_back(carrier.weight);
    }
    fewer.offsets[r + 1] = static_cast<Index>(fewer.carriers.size());
  }
  return fewer;
}

void addToParticles(const SurfaceBinding& binding, const Points& of_vertices, Points& of_particles) {
  for (std::size_t v = 0; v < of_vertices.size(); ++v)
    if (binding.particle[v] != kNoIndex) of_particles[binding.particle[v]] += of_vertices[v];
  for (Index r = 0; r < binding.embedded.size(); ++r)
    for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k)
      of_particles[binding.carriers[k]] += binding.weights[k] * of_vertices[binding.embedded[r]];
}

void carriedPlaces(const SurfaceBinding& binding, const Points& positions, Points& places) {
  places.resize(binding.particle.size());
  for (std::size_t v = 0; v < places.size(); ++v)
    places[v] = binding.particle[v] != kNoIndex ? positions[binding.particle[v]] : Vec3(Vec3::Zero());
  for (Index r = 0; r < binding.embedded.size(); ++r)
    for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k)
      places[binding.embedded[r]] += binding.weights[k] * positions[binding.carriers[k]];
}

Points collisionPlaces(const BodyModel& model, const Points& positions) {
  Points places;
  carriedPlaces(model.collision->binding, positions, places);
  return places;
}

}  // namespace meshless
