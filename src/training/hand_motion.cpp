#include "meshless_surgery/training/hand_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smoothness.h"

namespace meshless {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr double kLately = 0.1;                        // [s]
constexpr double kLongestMovement = 10.0;              // [s] one that goes on is another one, so that none costs much
constexpr double kTremorWindow = 2.0;                  // [s]
constexpr double kTremorFrom = 4.0, kTremorTo = 14.0;  // [Hz]

}  // namespace

void HandMotion::feed(const std::optional<Vec3>& position, const std::optional<Quat>& turned, double dt) {
  const double rate = 1.0 / dt;
  if (!position) {
    leave(dt);
    return;
  }
  if (!seen()) origin_ = *position;
  seen_for_ += dt;
  const Vec3 from = *position - origin_;
  sum_ += from;
  squares_ += from * from.transpose();
  count_ += 1.0;
  if (!last_) {
    start_ = last_ = position;
    last_turned_ = turned;
    lately_.assign(1, *position);
    window_.assign(1, *position);
    return;
  }
  const Vec3 way = *position - *last_;
  path_ += way.norm();
  fastest_ = std::max(fastest_, way.norm() * rate);
  last_ = position;
  if (turned && last_turned_) turn_ += last_turned_->angularDistance(*turned);
  last_turned_ = turned;

  lately_.push_back(*position);
  const auto most = static_cast<std::size_t>(std::max(1.0, std::round(kLately * rate)));
  while (lately_.size() > most + 1) lately_.pop_front();
  const double lately = static_cast<double>(lately_.size() - 1) * dt;
  const bool moves = (lately_.back() - lately_.front()).norm() > kMoving * lately;
  if (moves && !moves_) {
    ++movements_;
    // It began within that 0.1 s.
    for (std::size_t k = 1; k + 1 < lately_.size(); ++k) velocities_.push_back((lately_[k] - lately_[k - 1]) * rate);
  }
  if (!moves && moves_) endMovement(rate);
  moves_ = moves;
  if (moves_) {
    moved_for_ += dt;
    moved_path_ += way.norm();
    velocities_.push_back(way * rate);
    if (static_cast<double>(velocities_.size()) * dt >= kLongestMovement) endMovement(rate);
  }

  window_.push_back(*position);
  const auto size = static_cast<std::size_t>(std::round(kTremorWindow * rate));
  if (window_.size() >= size && 2.0 * kTremorTo < rate) {
    const double amplitude = bandAmplitude(window_, rate, kTremorFrom, kTremorTo);
    tremor_sum_ += amplitude * amplitude;
    tremor_windows_ += 1.0;
    window_.erase(window_.begin(), window_.begin() + static_cast<std::ptrdiff_t>(size / 2));
  } else if (window_.size() >= size) {
    window_.clear();
  }
}

void HandMotion::endMovement(double rate) {
  std::vector<double> speeds;
  for (const Vec3& v : velocities_) speeds.push_back(v.norm());
  const double duration = static_cast<double>(velocities_.size()) / rate;
  if (const double sparc = spectralArcLength(speeds, rate); std::isfinite(sparc)) {
    sparc_sum_ += duration * sparc;
    smooth_for_ += duration;
  }
  if (const double jerk = logDimensionlessJerk(velocities_, rate); std::isfinite(jerk)) {
    jerk_sum_ += duration * jerk;
    jerk_for_ += duration;
  }
  velocities_.clear();
}

void HandMotion::end(double dt) { leave(dt); }

void HandMotion::leaveAt(double rate) {
  if (moves_) endMovement(rate);
  moves_ = false;
  straight_ += (*last_ - *start_).norm();
  start_.reset();
  last_.reset();
  last_turned_.reset();
  lately_.clear();
  window_.clear();
}

double HandMotion::economy() const {
  const double straight = straight_ + (last_ ? (*last_ - *start_).norm() : 0.0);
  return path_ > 0.0 ? straight / path_ : kUnknown;
}

// An evenly filled ellipsoid of half axes a has the covariance a^2 / 5.
double HandMotion::workspace() const {
  if (!(count_ > 1.0)) return kUnknown;
  const Vec3 mean = sum_ / count_;
  const Mat3 covariance = squares_ / count_ - mean * mean.transpose();
  return 4.0 / 3.0 * M_PI * std::pow(5.0, 1.5) * std::sqrt(std::max(0.0, covariance.determinant()));
}

double HandMotion::meanSpeed() const { return moved_for_ > 0.0 ? moved_path_ / moved_for_ : kUnknown; }
double HandMotion::sparc() const { return smooth_for_ > 0.0 ? sparc_sum_ / smooth_for_ : kUnknown; }
double HandMotion::jerk() const { return jerk_for_ > 0.0 ? jerk_sum_ / jerk_for_ : kUnknown; }
double HandMotion::tremor() const {
  return tremor_windows_ > 0.0 ? std::sqrt(tremor_sum_ / tremor_windows_) : kUnknown;
}

}  // namespace meshless
