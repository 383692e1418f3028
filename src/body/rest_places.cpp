#include "rest_places.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "meshless_surgery/dynamics/rotation.h"
#include "meshless_surgery/geometry/query/nearest.h"
#include "side_by_side.h"

namespace meshless {
namespace {

constexpr std::size_t kParticles = 16;
constexpr std::size_t kKnown = 8;
constexpr std::size_t kChunk = 64;     // points
constexpr double kSpanned = 1e-4;      // eigenvalue of the spread over the largest: flatter is not spanned
constexpr double kMostStretch = 10.0;  // of the map: beyond it the particles tell nothing about lengths

// The affine map of the particles around one, from the present shape to rest.
struct Map {
  Vec3 present = Vec3::Zero(), rest = Vec3::Zero();
  Mat3 linear = Mat3::Zero();
  bool wanted = false;
};

void makeMap(const BodyModel& model, const BodyState& state, const std::vector<Index>& near, Map& map) {
  const double count = static_cast<double>(near.size());
  for (Index i : near) {
    map.present += state.positions[i] / count;
    map.rest += model.rest[i] / count;
  }
  Mat3 spread = Mat3::Zero(), cross = Mat3::Zero();
  for (Index i : near) {
    const Vec3 a = state.positions[i] - map.present, b = model.rest[i] - map.rest;
    spread += a * a.transpose() / count;
    cross += b * a.transpose() / count;
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(spread);
  const Vec3 values = solver.eigenvalues();
  const Mat3 rotation = nearestRotation(cross, Quat::Identity()).rotation.toRotationMatrix();
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3 direction = solver.eigenvectors().col(axis);
    Vec3 image = rotation * direction;
    if (values[axis] > kSpanned * values[2]) {
      const Vec3 fitted = cross * direction / values[axis];
      if (fitted.norm() < kMostStretch) image = fitted;
    }
    map.linear += image * direction.transpose();
  }
}

using Near = std::array<Index, FoundPlaces::kNear>;

}  // namespace

struct RestPlaces::Data {
  const BodyModel& model;
  const BodyState& state;
  NearestPoints particles;
  std::vector<Map> maps;  // of each particle; made where they are wanted

  Data(const BodyModel& m, const BodyState& s) : model(m), state(s), particles(s.positions), maps(m.rest.size()) {}

  void make(const std::vector<Index>& wanted) {
    inChunks(wanted.size(), kChunk, [&](std::size_t from, std::size_t to) {
      for (std::size_t n = from; n < to; ++n)
        makeMap(model, state, particles.nearest(state.positions[wanted[n]], kParticles), maps[wanted[n]]);
    });
  }

  std::vector<Near> nearest(const Points& points) const {
    std::vector<Near> near(points.size());
    inChunks(points.size(), kChunk, [&](std::size_t from, std::size_t to) {
      for (std::size_t n = from; n < to; ++n)
        for (std::size_t k = particles.nearest(points[n], near[n].size(), near[n].data()); k < near[n].size(); ++k)
          near[n][k] = kNoIndex;
    });
    return near;
  }

  void makeFor(const std::vector<Near>& points) {
    std::vector<Index> wanted;
    for (const Near& near : points)
      for (const Index particle : near) {
        if (particle == kNoIndex || maps[particle].wanted) continue;
        maps[particle].wanted = true;
        wanted.push_back(particle);
      }
    make(wanted);
  }

  // What the maps around the nearest particles say of a point.
  Vec3 guess(const Vec3& p, const Near& near) const {
    Vec3 sum = Vec3::Zero();
    double total = 0.0;
    for (const Index particle : near) {
      if (particle == kNoIndex) break;
      const Map& map = maps[particle];
      const double weight = 1.0 / ((state.positions[particle] - p).squaredNorm() + 1e-24);
      sum += weight * (map.rest + map.linear * (p - map.present));
      total += weight;
    }
    return sum / total;
  }
};

RestPlaces::RestPlaces(const BodyModel& model, const BodyState& state) : data_(std::make_unique<Data>(model, state)) {}
RestPlaces::~RestPlaces() = default;
RestPlaces::RestPlaces(RestPlaces&&) noexcept = default;

void RestPlaces::foresee(const std::function<bool(const Vec3& position)>& likely) {
  std::vector<Index> wanted;
  for (Index i = 0; i < data_->maps.size(); ++i) {
    if (!likely(data_->state.positions[i])) continue;
    data_->maps[i].wanted = true;
    wanted.push_back(i);
  }
  data_->make(wanted);
}

FoundPlaces RestPlaces::of(const Points& present, const std::vector<KnownPlace>& known) {
  FoundPlaces found;
  if (present.empty()) return found;
  found.rest.resize(present.size());
  Points known_at;
  for (const KnownPlace& k : known) known_at.push_back(k.present);
  const NearestPoints rim(known_at);
  found.nearest = data_->nearest(present);
  const std::vector<Near> near_known = data_->nearest(known_at);
  data_->makeFor(found.nearest);
  data_->makeFor(near_known);
  Points missed(known.size());
  for (std::size_t k = 0; k < known.size(); ++k) missed[k] = known[k].rest - data_->guess(known_at[k], near_known[k]);
  inChunks(present.size(), kChunk, [&](std::size_t from, std::size_t to) {
    for (std::size_t n = from; n < to; ++n) {
      Vec3 residual = Vec3::Zero();
      double total = 0.0;
      std::array<Index, kKnown> near;
      const std::size_t count = rim.nearest(present[n], kKnown, near.data());
      for (std::size_t i = 0; i < count; ++i) {
        const Index k = near[i];
        const double w = 1.0 / ((known_at[k] - present[n]).squaredNorm() + 1e-24);
        residual += w * missed[k];
        total += w;
      }
      found.rest[n] = data_->guess(present[n], found.nearest[n]) + (total > 0.0 ? Vec3(residual / total) : residual);
    }
  });
  return found;
}

}  // namespace meshless
