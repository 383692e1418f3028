#include "ros/force_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "ros/scene_support.h"

namespace meshless {
namespace force_model_test {

constexpr double kStep = 1.0 / 120.0;    // [s]
constexpr double kTick = 1.0 / 500.0;    // [s]
constexpr double kStream = 1.0 / 200.0;  // [s]

TEST(StepHold, GoesFromStepToStepWithoutAJump) {
  StepHold<Vec3> hold{Vec3::Zero()};
  hold.stepped(Vec3(12, 0, 0), kStep, 1.0);
  EXPECT_EQ(hold.at(1.0), Vec3::Zero());
  EXPECT_NEAR(hold.at(1.0 + 0.5 * kStep).x(), 6.0, 1e-9);
  EXPECT_NEAR(hold.at(1.0 + kStep).x(), 12.0, 1e-9);
  EXPECT_EQ(hold.at(5.0).x(), 12.0);  // the world stands still
  // The next step comes early: it goes on from where it is.
  hold.stepped(Vec3(12, 0, 0), kStep, 5.0);
  hold.stepped(Vec3(0, 0, 0), kStep, 5.0 + 0.5 * kStep);
  EXPECT_NEAR(hold.at(5.0 + 0.5 * kStep).x(), 12.0, 1e-9);
  EXPECT_EQ(hold.at(5.0 + 1.6 * kStep), Vec3::Zero());
  EXPECT_NE(hold.at(5.0 + 0.7 * kStep), Vec3::Zero());
}

TEST(StepHold, WithoutATimeItIsThereAtOnce) {
  StepHold<double> hold{1.0};
  hold.stepped(3.0, 0.0, 2.0);
  EXPECT_EQ(hold.at(2.0), 3.0);
  hold.stepped(7.0, kStep, 2.0);
  hold.set(5.0);
  EXPECT_EQ(hold.at(2.0), 5.0);
}

/// The force that is reported to a hand on a fixed spring of `stiffness` [N/m] on its way x(t) along x, and what it
/// should be.
struct Reported {
  double error = 0.0;     // root of the mean square [N]
  double without = 0.0;   // the same of the straight line between steps alone
  double steepest = 0.0;  // change in a tick [N]
};

Reported reportSpring(double stiffness, double known, double step, bool pulls, const std::function<double(double)>& x) {
  ForceModel model;
  StepHold<double> line{0.0};
  Reported reported;
  double next_step = 0.0, before = 0.0;
  int ticks = 0;
  for (double time = 0.0; time < 2.0; time += kTick, ++ticks) {
    while (next_step <= time) {
      const double heard = x(std::floor(next_step / kStream) * kStream);
      const Vec3 force(-stiffness * heard, 0, 0);
      model.stepped({true, 1, pulls, force, Vec3(heard, 0, 0), known, 5.0}, step, next_step);
      line.stepped(force.x(), step, next_step);
      next_step += step;
    }
    const Vec3 hand(x(std::floor(time / kStream) * kStream), 0, 0);
    const double force = model.at(time, hand).x();
    EXPECT_EQ(model.at(time, hand).y(), 0.0);
    const double wanted = -stiffness * x(time);
    if (time > 0.2) {
      reported.error += std::pow(force - wanted, 2);
      reported.without += std::pow(line.at(time) - wanted, 2);
      reported.steepest = std::max(reported.steepest, std::abs(force - before));
    }
    before = force;
  }
  reported.error = std::sqrt(reported.error / ticks);
  reported.without = std::sqrt(reported.without / ticks);
  return reported;
}

TEST(ForceModel, TheHandFeelsItsMotionBeforeTheNextStep) {
  for (const bool pulls : {true, false})
    for (const double step : {1.0 / 120.0, 1.0 / 30.0}) {
      // Eight steps a wave.
      const auto waves = [&](double t) { return 0.01 + 0.002 * std::sin(2.0 * M_PI * t / (8.0 * step)); };
      const Reported reported = reportSpring(300.0, pulls ? 300.0 : 5000.0, step, pulls, waves);
      EXPECT_LT(reported.error, 0.6 * reported.without) << "pulls " << pulls << ", step " << step;
      EXPECT_GT(reported.without, 0.05);
      // The wave's own is 0.11 N a tick at most, and up to as much again where a step corrects.
      EXPECT_LT(reported.steepest, 0.25) << "pulls " << pulls << ", step " << step;
    }
}

TEST(ForceModel, AMoveIsReportedAtOnceAndCorrectedWithoutAJump) {
  ForceModel model;
  const ForceModel::Step held{true, 1, true, Vec3::Zero(), Vec3::Zero(), 200.0, 5.0};
  for (int i = 0; i < 10; ++i) model.stepped(held, kStep, i * kStep);
  double time = 9 * kStep;
  EXPECT_EQ(model.at(time, Vec3(0, 0, 0)), Vec3::Zero());
  // The stream jumps by a centimetre right after a step. Before the next, most of it is there.
  const Vec3 hand(0.01, 0, 0);
  double before = 0.0, steepest = 0.0;
  const auto feel = [&] {
    const double force = model.at(time, hand).x();
    steepest = std::max(steepest, std::abs(force - before));
    before = force;
  };
  for (; time < 10 * kStep; time += 0.0005) feel();
  EXPECT_LT(before, -1.0);
  EXPECT_GE(before, -2.0);
  // The step finds tissue that gave way: half of the force. It settles there.
  for (int i = 10; i < 130; ++i) {
    model.stepped({true, 1, true, Vec3(-1, 0, 0), hand, 200.0, 5.0}, kStep, i * kStep);
    for (; time < (i + 1) * kStep; time += 0.0005) feel();
  }
  EXPECT_LT(steepest, 0.4);
  EXPECT_NEAR(before, -1.0, 0.01);
}

TEST(ForceModel, ItIsBoundedWhateverTheHandSays) {
  ForceModel pick, push;
  for (int i = 0; i < 240; ++i) {
    const double sign = i % 2 ? 1.0 : -1.0;
    pick.stepped({true, 1, true, Vec3(-1, 0, 0), Vec3::Zero(), 200.0, 5.0}, kStep, i * kStep);
    push.stepped({true, 0, false, Vec3(-1, 0.5 * sign, 0), Vec3(1e-3 * sign, 0, 0), 5000.0, 5.0}, kStep, i * kStep);
    for (int k = 0; k < 4; ++k) {
      const double time = (i + 0.25 * k) * kStep;
      const Vec3 hand(sign * 1e3, -1e3, 0);
      EXPECT_LT(pick.at(time, hand).norm(), 1.0 + 2.0 * 200.0 * 0.02);
      const Vec3 pushed = push.at(time, hand);
      EXPECT_LE(pushed.x(), 0.0) << "a sphere that only pushes must not pull";
      EXPECT_LT(pushed.norm(), 1.5 * std::sqrt(1.25) + 1e-9);
    }
  }
  // Nothing is foreseen while no step comes: of 5 s.
  double time = 240 * kStep;
  for (; time < 240 * kStep + 5.0; time += kTick) pick.at(time, Vec3(1, 0, 0));
  EXPECT_NEAR((pick.at(time, Vec3(1, 0, 0)) - Vec3(-1, 0, 0)).norm(), 0.0, 1e-6);
}

TEST(ForceModel, FreeIsExactlyZero) {
  ForceModel model;
  const Vec3 hand(0.5, 0, 0);
  EXPECT_TRUE(model.isZero(0.0));
  // A sphere in the air, with the hand ahead of it.
  for (int i = 0; i < 10; ++i) {
    model.stepped({true, 0, false, Vec3::Zero(), Vec3(0.01 * i, 0, 0), 5000.0, 5.0}, kStep, i * kStep);
    EXPECT_EQ(model.at((i + 0.5) * kStep, hand), Vec3::Zero());
  }
  // It touches, leaves, and is free a step later.
  model.stepped({true, 0, false, Vec3(-3, 0, 0), Vec3(0.11, 0, 0), 5000.0, 5.0}, kStep, 10 * kStep);
  EXPECT_NE(model.at(10.5 * kStep, hand), Vec3::Zero());
  EXPECT_FALSE(model.isZero(10.5 * kStep));
  model.stepped({true, 0, false, Vec3::Zero(), Vec3(0.12, 0, 0), 5000.0, 5.0}, kStep, 11 * kStep);
  EXPECT_NE(model.at(11.5 * kStep, hand), Vec3::Zero());
  EXPECT_EQ(model.at(12 * kStep, hand), Vec3::Zero());
  EXPECT_TRUE(model.isZero(12 * kStep));
  // A spring that is let go between two steps.
  model.stepped({true, 1, true, Vec3(-3, 0, 0), Vec3::Zero(), 200.0, 5.0}, kStep, 13 * kStep);
  EXPECT_NE(model.at(14 * kStep, hand), Vec3::Zero());
  model.stepped({}, 0.0, 14 * kStep);
  const double just = model.at(14 * kStep, hand).norm();
  EXPECT_GT(just, 1.0);
  EXPECT_LT(model.at(15 * kStep, std::nullopt).norm(), 0.5 * just);
  EXPECT_EQ(model.at(19 * kStep, std::nullopt), Vec3::Zero());
  EXPECT_TRUE(model.isZero(19 * kStep));
}

/// A hand with a stream of 200 Hz acts on a free body; the model reports its force at 500 Hz.
struct Touch {
  Vec3 reported = Vec3::Zero();  // [N s]
  Vec3 momentum = Vec3::Zero();  // of the body
  double strongest = 0.0, steepest = 0.0;
  bool zero_at_end = false;
};

/// `act` does to the world what the stream said at a time, and says where the hand is (nothing: gone).
Touch touch(World& world, double step, int steps, const std::function<std::optional<Vec3>(double)>& act,
            const std::function<ForceModel::Step()>& measured) {
  ForceModel model;
  Touch touch;
  Vec3 before = Vec3::Zero();
  double tick = 0.0;
  std::optional<Vec3> hand;
  double heard = -1.0;
  const auto hear = [&](double time) {
    for (; heard + kStream <= time; heard += kStream) {
      hand = act(heard + kStream);
      model.stepped(measured(), 0.0, std::max(0.0, heard + kStream));
    }
  };
  for (int i = 0; i < steps; ++i) {
    const double now = i * step;
    hear(now);
    world.step();
    model.stepped(measured(), step, now);
    for (; tick < now + step; tick += kTick) {
      hear(tick);
      const Vec3 force = model.at(tick, hand);
      touch.reported += kTick * force;
      touch.strongest = std::max(touch.strongest, force.norm());
      touch.steepest = std::max(touch.steepest, (force - before).norm());
      before = force;
    }
  }
  touch.zero_at_end = model.isZero(steps * step) && before.isZero(0.0);
  SnapshotWants measures{false, false, true};
  touch.momentum = world.snapshot(measures).bodies[0].measures.linear_momentum;
  return touch;
}

TEST(ForceModel, TheSumOverAPullIsTheChangeOfMomentum) {
  for (const double rate : {120.0, 30.0}) {
    const auto boxes = twoBoxes(rate);
    World& world = *boxes;
    PickCommand pick;
    pick.point = Vec3(-0.05, 0, 0);
    pick.max_distance = 0.1;
    const auto reply = world.apply(pick);
    ASSERT_TRUE(reply.ok());
    const PickReply picked = std::get<PickReply>(*reply);
    const auto act = [&](double time) -> std::optional<Vec3> {
      if (time > 0.6) {
        (void)world.apply(Command(ReleaseCommand{picked.pick}));  // gone already the second time
        return std::nullopt;
      }
      const double way = std::max(0.0, time);
      const Vec3 target = picked.position + Vec3(0.06 * way, 0.024 * way, 0.004 * std::sin(20.0 * way));
      EXPECT_TRUE(world.apply(Command(MovePickCommand{picked.pick, target})).ok());
      return target;
    };
    const auto measured = [&] {
      ForceModel::Step step;
      if (const auto held = world.heldPick())
        step = {true, held->id, true, -held->force, held->target, world.heldStiffness(), 5.0};
      return step;
    };
    const Touch pull = touch(world, 1.0 / rate, static_cast<int>(rate), act, measured);
    ASSERT_GT(pull.momentum.norm(), 0.01);
    EXPECT_LT((pull.reported + pull.momentum).norm(), 0.04 * pull.momentum.norm()) << rate << " Hz";  // 0.032
    EXPECT_TRUE(pull.zero_at_end) << rate << " Hz";
    EXPECT_LE(pull.steepest, 2.0 * pull.strongest * kTick * rate) << rate << " Hz";
  }
}

// The sphere goes into a free box and back out.
TEST(ForceModel, TheSumOverAPressIsTheChangeOfMomentum) {
  for (const double rate : {120.0, 30.0}) {
    const auto boxes = twoBoxes(rate);
    World& world = *boxes;
    const double radius = 0.03;
    const auto act = [&](double time) -> std::optional<Vec3> {
      const double depth = 0.025 * std::sin(M_PI * std::clamp(time / 0.8, 0.0, 1.0)) - 0.005;
      PushCommand push;
      push.position = Vec3(-0.05 - radius + depth, 0, 0);
      push.radius = radius;
      push.streamed = true;
      if (world.push().enabled) push.speed = 1.0;
      EXPECT_TRUE(world.apply(Command(push)).ok());
      return push.position;
    };
    const auto measured = [&] {
      const PushSphere& push = world.push();
      return ForceModel::Step{push.enabled, 0, false, push.force, push.position, 5000.0, 1.0};
    };
    const Touch press = touch(world, 1.0 / rate, static_cast<int>(1.2 * rate), act, measured);
    ASSERT_GT(press.momentum.norm(), 0.01);
    // The touch is an impact within one step or two: what is foreseen after it misses a part of it.
    const double missed = rate < 60.0 ? 0.4 : 0.15;
    EXPECT_LT((press.reported + press.momentum).norm(), missed * press.momentum.norm()) << rate << " Hz";
    EXPECT_TRUE(press.zero_at_end) << rate << " Hz";
    EXPECT_LE(press.steepest, 2.0 * press.strongest * kTick * rate) << rate << " Hz";
  }
}

}  // namespace force_model_test
}  // namespace meshless
