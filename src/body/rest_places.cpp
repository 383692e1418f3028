#include "meshless_surgery/body/rest_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <future>

#include <Eigen/Eigenvalues>

#include "meshless_surgery/dynamics/rotation.h"
#include "meshless_surgery/geometry/nearest.h"

namespace meshless {
namespace {

constexpr std::size_t kParticles = 16;
constexpr std::size_t kBlended = 4;  // maps of the nearest particles
constexpr std::size_t kKnown = 8;
constexpr std::size_t kWorthAThread = 300;  // points
constexpr double kSpanned = 1e-4;           // eigenvalue of the spread over the largest: flatter is not spanned
constexpr double kMostStretch = 10.0;       // of the map: beyond it the particles tell nothing about lengths

// The affine map of the particles around one, from the present shape to rest.
struct Map {
  Vec3 present = Vec3::Zero(), rest = Vec3::Zero();
  Mat3 linear = Mat3::Zero();
  bool made = false;
};

Map mapAround(const BodyModel& model, const BodyState& state, const std::vector<Index>& near) {
  Map map;
  map.made = true;
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
  return map;
}

// What the maps around the nearest particles say of a point. Maps are made when they are first needed.
class Guess {
 public:
  Guess(const BodyModel& model, const BodyState& state, const NearestPoints& particles)
      : model_(model), state_(state), particles_(particles), maps_(model.rest.size()) {}

  Vec3 operator()(const Vec3& p) {
    Vec3 sum = Vec3::Zero();
    double total = 0.0;
    std::array<Index, kBlended> near;
    const std::size_t count = particles_.nearest(p, kBlended, near.data());
    for (std::size_t k = 0; k < count; ++k) {
      const Index i = near[k];
      Map& map = maps_[i];
      if (!map.made) map = mapAround(model_, state_, particles_.nearest(state_.positions[i], kParticles));
      const double weight = 1.0 / ((state_.positions[i] - p).squaredNorm() + 1e-24);
      sum += weight * (map.rest + map.linear * (p - map.present));
      total += weight;
    }
    return sum / total;
  }

 private:
  const BodyModel& model_;
  const BodyState& state_;
  const NearestPoints& particles_;
  std::vector<Map> maps_;
};

}  // namespace

Points restPlaces(const BodyModel& model, const BodyState& state, const Points& present,
                  const std::vector<KnownPlace>& known) {
  Points places(present.size());
  if (present.empty()) return places;
  const NearestPoints particles(state.positions);
  Points known_at, missed(known.size());
  for (const KnownPlace& k : known) known_at.push_back(k.present);
  const NearestPoints rim(known_at);
  const auto inHalves = [](std::size_t count, const auto& work) {
    if (count < kWorthAThread) return work(0, count);
    auto half = std::async(std::launch::async, [&] { work(0, count / 2); });
    work(count / 2, count);
    half.get();
  };
  inHalves(known.size(), [&](std::size_t from, std::size_t to) {
    Guess guess(model, state, particles);
    for (std::size_t k = from; k < to; ++k) missed[k] = known[k].rest - guess(known[k].present);
  });
  inHalves(present.size(), [&](std::size_t from, std::size_t to) {
    Guess guess(model, state, particles);
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
      places[n] = guess(present[n]) + (total > 0.0 ? Vec3(residual / total) : residual);
    }
  });
  return places;
}

}  // namespace meshless
