#include "clock.h"

#include <algorithm>
#include <cmath>

namespace meshless {
namespace {

constexpr double kLookAgain = 1e-3;   // [s] between two looks at a source that may stand still
constexpr double kLongestBack = 1e3;  // [s]

// ros::Duration throws beyond 68 years, and a clock may be set by more.
double secondsFrom(const ros::Time& from, const ros::Time& to) {
  return (static_cast<double>(to.sec) - from.sec) + 1e-9 * (static_cast<double>(to.nsec) - from.nsec);
}

}  // namespace

Clock::Clock() : Clock([] { return ros::Time::now(); }, ros::Time::isSimTime()) {}

Clock::Clock(Source source, bool may_stand) : source_(std::move(source)), may_stand_(may_stand) {}

Clock Clock::steady() {
  const auto source = [] {
    const ros::SteadyTime now = ros::SteadyTime::now();
    return ros::Time(now.sec, now.nsec);
  };
  return Clock(source, false);
}

double Clock::now() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ros::Time said = source_();
  if (!said_.isZero()) elapsed_ += std::max(0.0, secondsFrom(said_, said));
  said_ = said;
  return elapsed_;
}

ros::Time Clock::stampOf(double time) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const double ahead = std::max(time - elapsed_, -kLongestBack);
  return said_.toSec() + ahead > kLookAgain ? said_ + ros::Duration(ahead) : said_;  // there is no time below 0
}

double Clock::wallUntil(double due) const {
  const double wait = std::max(0.0, due - now());
  return may_stand_ ? std::min(wait, kLookAgain) : wait;
}

}  // namespace meshless
