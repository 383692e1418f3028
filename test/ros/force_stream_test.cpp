#include "ros/force_stream.h"

#include "ros/tool_bench.h"
#include "support/falls_short.h"

namespace meshless {
namespace force_stream_test {

constexpr std::size_t kPick = 0, kPush = 1;
constexpr double kRates[] = {120.0, 30.0};  // [Hz] of steps

/// A hand that goes there and back, twice a second.
ToolBench::Hand waves(const Vec3& start, double from) {
  return [start, from](double time) {
    const double way = time < from ? 0.0 : 0.01 * (1.0 - std::cos(2.0 * M_PI * 2.0 * (time - from)));
    return poseAt(start + Vec3(0, way, 0));
  };
}

struct Heard {
  std::vector<double> times, values;
  double low = 0.0, high = 0.0, steepest = 0.0, shortest = 1e9, longest = 0.0;
  double range() const { return high - low; }
};

Heard heard(const ToolBench& bench, std::size_t tool, int axis, double since) {
  Heard heard;
  for (const auto& tick : bench.ticks) {
    if (tick.time < since || !tick.forces[tool]) continue;
    const double value = (*tick.forces[tool])[axis];
    if (!heard.times.empty()) {
      heard.steepest = std::max(heard.steepest, std::abs(value - heard.values.back()));
      heard.shortest = std::min(heard.shortest, tick.time - heard.times.back());
      heard.longest = std::max(heard.longest, tick.time - heard.times.back());
    }
    heard.times.push_back(tick.time);
    heard.values.push_back(value);
    heard.low = std::min(heard.low, value);
    heard.high = std::max(heard.high, value);
  }
  return heard;
}

TEST(ForceStream, APullIsReportedEvenlyAndBetweenSteps) {
  for (const double rate : kRates) {
    ToolBench bench({}, rate);
    const PickReply picked = bench.pick();
    bench.hands[kPick] = waves(picked.position, 0.3);
    bench.run(2.3);
    const Heard pull = heard(bench, kPick, 1, 0.3);
    EXPECT_NEAR(pull.shortest, ToolBench::kTick, 1e-9);
    EXPECT_NEAR(pull.longest, ToolBench::kTick, 1e-9);
    EXPECT_LT(pull.low, -0.5);
    // No part of a way that takes the hand many ticks is reported in one.
    std::printf("%g Hz: the steepest tick has %.3f of the pull's range\n", rate, pull.steepest / pull.range());
    EXPECT_LT(pull.steepest, 0.05 * pull.range()) << rate;
    // The straight line between two steps has one slope; a hand that is followed between them has many.
    int slopes = 0;
    for (std::size_t i = 2; i < pull.values.size(); ++i)
      slopes += std::abs(pull.values[i] - 2.0 * pull.values[i - 1] + pull.values[i - 2]) > 1e-9;
    std::printf("%g Hz: %d slopes of %zu\n", rate, slopes, pull.values.size());
    EXPECT_GT(slopes, (rate < 60.0 ? 3.0 : 2.0) * 2.0 * rate) << rate;
    // Let go: zero, and then nothing but the hand in the air.
    ASSERT_TRUE(bench.world->apply(Command(ReleaseCommand{picked.pick})).ok());
    bench.hands[kPick] = [&](double) { return poseAt(picked.position); };
    const double released = bench.now();
    bench.run(0.5);
    const Heard after = heard(bench, kPick, 1, released + 6.0 / rate);
    EXPECT_GT(after.values.size(), 100u);
    EXPECT_EQ(after.low, 0.0);
    EXPECT_EQ(after.high, 0.0);
    // Without a hand either there is nothing to say.
    bench.hands[kPick] = {};
    bench.run(1.0);
    EXPECT_FALSE(bench.ticks.back().forces[kPick]);
  }
}

TEST(ForceStream, APressIsReportedFromTheTouchToThePartingAndNeverPulls) {
  bool smooth = true;
  for (const double rate : kRates) {
    ToolBench bench({}, rate);
    PickCommand far_side;
    far_side.point = Vec3(0.05, 0, 0);
    const auto picked = bench.world->apply(far_side);
    ASSERT_TRUE(picked.ok());
    LockCommand lock;
    lock.pick = std::get<PickReply>(*picked).pick;
    ASSERT_TRUE(bench.world->apply(lock).ok());
    PushCommand push;
    push.radius = 0.03;
    push.position = Vec3(-0.15, 0, 0);
    ASSERT_TRUE(bench.world->apply(push).ok());
    bench.hands[kPush] = [](double time) {
      return poseAt(Vec3(-0.15 + 0.1 * std::sin(M_PI * std::clamp(time - 0.3, 0.0, 1.0)), 0, 0));
    };
    bench.run(2.0);
    const Heard air = heard(bench, kPush, 0, 0.0);
    std::size_t touch = 0;
    while (touch < air.values.size() && air.values[touch] == 0.0) ++touch;
    EXPECT_GT(air.times[std::min(touch, air.times.size() - 1)], 0.3);
    const Heard press = heard(bench, kPush, 0, 0.3);
    EXPECT_NEAR(press.longest, ToolBench::kTick, 1e-9);
    EXPECT_LT(press.low, -0.2) << "the sphere reported nothing";
    EXPECT_LE(press.high, 0.0);
    std::printf("%g Hz: the press was %.2f N at most, its steepest tick has %.3f of it\n", rate, -press.low,
                press.steepest / press.range());
    smooth = smooth && press.steepest < 0.1 * press.range();
    const Heard after = heard(bench, kPush, 0, 1.7);
    EXPECT_EQ(after.low, 0.0);
  }
  EXPECT_TRUE(test::lawHolds("smooth force of the push sphere on appearance materials", smooth));
}

TEST(ForceStream, WhoStoodStillMakesNoJumpOfIt) {
  for (const double rate : kRates)
    for (const bool whole_node : {true, false}) {
      ToolBench bench({}, rate);
      const PickReply picked = bench.pick();
      bench.hands[kPick] = waves(picked.position, 0.3);
      const double lengths[] = {0.02, 0.04, 0.06, 0.08, 0.1};
      (whole_node ? bench.stands_still : bench.forces_stand_still) = [&](double time) {
        for (int i = 0; i < 5; ++i) {
          const double since = time - 0.7 - 0.33 * i;
          if (since > 0.0 && since < lengths[i]) return true;
        }
        return false;
      };
      bench.run(2.7);
      const Heard pull = heard(bench, kPick, 1, 0.3);
      EXPECT_LT(pull.low, -0.5);
      std::printf("%g Hz: %s stood still, the steepest tick has %.3f of the pull's range\n", rate,
                  whole_node ? "the node" : "the forces", pull.steepest / pull.range());
      EXPECT_LT(pull.steepest, 0.1 * pull.range()) << rate;
      // Ticks are made up for, of 50 ms: what a longer standstill leaves is a hole in the stamps.
      EXPECT_NEAR(pull.shortest, ToolBench::kTick, 1e-9);
      EXPECT_LT(pull.longest, 0.1 - ForceStream::kMostLate + 2.0 * ToolBench::kTick);
    }
}

// A clock that is told in steps of 10 ms, as a bag's is: each tick has its own time, and what is zero is exactly so.
TEST(ForceStream, ACoarseClockMakesNoHoles) {
  ForceStream stream(0.002);
  stream.begin(0.0);
  std::vector<double> times;
  for (int i = 0; i <= 100; ++i) {
    const Vec3 force = i < 50 ? Vec3(1, 0, 0) : Vec3::Zero();
    stream.stepped({ForceModel::Step{true, 1, true, force, Vec3::Zero(), 100.0, 1.0}, {}, {}}, 0.01, 0.01 * i);
    while (const auto tick = stream.next(0.01 * i, {})) {
      times.push_back(tick->time);
      if (i > 2 && i < 50) EXPECT_EQ(*tick->forces[kPick], Vec3(1, 0, 0)) << tick->time;
      if (i > 53) EXPECT_EQ(*tick->forces[kPick], Vec3::Zero()) << tick->time;
    }
  }
  ASSERT_GT(times.size(), 490u);
  for (std::size_t i = 1; i < times.size(); ++i) EXPECT_NEAR(times[i] - times[i - 1], 0.002, 1e-9);
  // And none while it stands.
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(stream.next(1.0, {}));
}

}  // namespace force_stream_test
}  // namespace meshless
