#include "ros/streamed_tools.h"

#include "ros/tool_bench.h"

namespace meshless {
namespace streamed_tools_test {

constexpr double kSpeed = 0.5;  // [m/s]
constexpr std::size_t kPick = 0, kPush = 1, kScissors = 2;

NodeSettings slowTools() {
  NodeSettings settings;
  settings.pick_max_speed = settings.push_max_speed = settings.scissors_max_speed = kSpeed;
  settings.scissors_length = settings.scissors_width = 0.3;
  return settings;
}

ToolBench::Hand still(const Vec3& place) {
  return [place](double) { return poseAt(place); };
}

/// Blades in the plane x = const, reaching along y.
Pose acrossX(double x) {
  Mat3 axes;
  axes.col(0) = Vec3::UnitY();
  axes.col(1) = Vec3::UnitZ();
  axes.col(2) = Vec3::UnitX();
  Pose pose;
  pose.rotation = Quat(axes);
  pose.translation = Vec3(x, -0.15, 0.0);
  return pose;
}

TEST(StreamedTools, ThePickFollowsACircleAndIsLetGoWhenItsStreamHasBeenSilent) {
  ToolBench bench(slowTools());
  const PickReply picked = bench.pick();
  const auto circle = [&](double time) {
    const double angle = 2.0 * M_PI * time;
    return Vec3(picked.position + 0.02 * Vec3(0, std::sin(angle), 1.0 - std::cos(angle)));
  };
  bench.hands[kPick] = [&](double time) { return poseAt(circle(time)); };
  double farthest = 0.0;
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();
  bench.after_each = [&](double time) {
    if (time < 0.1) return;
    const auto held = bench.world->heldPick();
    ASSERT_TRUE(held);
    farthest = std::max(farthest, (held->target - circle(time)).norm());
    low = low.cwiseMin(held->target - picked.position);
    high = high.cwiseMax(held->target - picked.position);
  };
  bench.run(1.25);
  EXPECT_LT(farthest, 0.02 * 2.0 * M_PI * 2.0 * ToolBench::kStream);  // two messages late at most
  EXPECT_LT(low.y(), -0.019);
  EXPECT_GT(high.y(), 0.019);
  EXPECT_GT(high.z(), 0.039);

  bench.hands[kPick] = {};
  bench.after_each = [](double) {};
  bench.run(bench.settings.tools_silence - 0.01);
  EXPECT_TRUE(bench.world->heldPick());
  EXPECT_TRUE(bench.tools.hand(ToolKind::kPick));
  bench.run(0.02);
  EXPECT_FALSE(bench.world->heldPick());
  EXPECT_FALSE(bench.tools.hand(ToolKind::kPick));
  const auto lifted = bench.said(EventType::kLifted);
  ASSERT_EQ(lifted.size(), 1u);
  EXPECT_EQ(lifted[0].pick, picked.pick);
  EXPECT_NE(lifted[0].text.find("the pick was lifted off: its stream was silent for 0.5 s"), std::string::npos);
}

TEST(StreamedTools, AJumpIsMadeAtABoundedSpeed) {
  for (const std::size_t tool : {kPick, kPush, kScissors}) {
    ToolBench bench(slowTools());
    const Vec3 start = tool == kPick ? bench.pick().position : Vec3(0, 0, 1.0);
    const auto place = [&]() -> Vec3 {
      if (tool == kPick) return bench.world->heldPick()->target;
      return tool == kPush ? bench.world->push().position : bench.world->scissors().blades.origin;
    };
    bench.hands[tool] = still(start);
    bench.run(0.1);
    bench.hands[tool] = still(start + Vec3(0, 0, 0.3));
    const double begun = bench.now();
    double steepest = 0.0, before = place().z(), arrived = 0.0;
    bench.after_each = [&](double time) {
      steepest = std::max(steepest, place().z() - before);
      before = place().z();
      if (arrived == 0.0 && place().z() > start.z() + 0.3 - 1e-9) arrived = time;
    };
    bench.run(1.0);
    // A message's or a step's worth at once, and a look's and a stream's gap more at the begin.
    EXPECT_LT(steepest, kSpeed * 0.0125) << tool;
    EXPECT_NEAR(arrived - begun, 0.3 / kSpeed, 0.02) << tool;
  }
}

TEST(StreamedTools, AToolGoesOnToWhereItsStreamLastWantedIt) {
  for (const std::size_t tool : {kPick, kScissors}) {
    ToolBench bench(slowTools());
    const Vec3 start = tool == kPick ? bench.pick().position : Vec3(0, 0, 1.0);
    const Vec3 end = start + Vec3(0, 0, 0.15);  // 0.3 s away
    ASSERT_TRUE(bench.tools.hear(static_cast<ToolKind>(tool), poseAt(start), 0.0).ok());
    bench.run(0.01);
    ASSERT_TRUE(bench.tools.hear(static_cast<ToolKind>(tool), poseAt(end), 0.0).ok());
    bench.run(0.35);
    const Vec3 place = tool == kPick ? bench.world->heldPick()->target : bench.world->scissors().blades.origin;
    EXPECT_LT((place - end).norm(), 1e-9) << tool;
  }
}

TEST(StreamedTools, AGapInAStreamIsNoLeaveToJump) {
  ToolBench bench(slowTools());
  const Vec3 start = bench.pick().position;
  bench.hands[kPick] = still(start);
  bench.run(0.1);
  bench.hands[kPick] = {};
  bench.run(0.4);
  double before = start.y(), steepest = 0.0;
  bench.after_each = [&](double) {
    const double place = bench.world->heldPick()->target.y();
    steepest = std::max(steepest, place - before);
    before = place;
  };
  bench.hands[kPick] = still(start + Vec3(0, 0.3, 0));
  bench.run(1.0);
  EXPECT_LE(steepest, kSpeed * ToolMotion::kLongestTick + 1e-9);
  EXPECT_NEAR(before, start.y() + 0.3, 1e-9);
}

TEST(StreamedTools, LateMessagesChangeNothingAndAreRefused) {
  for (const std::size_t tool : {kPick, kPush, kScissors}) {
    ToolBench bench(slowTools());
    const Vec3 start = tool == kPick ? bench.pick().position : Vec3(0, 0, 1.0);
    bench.hands[tool] = [&](double time) {
      EXPECT_FALSE(time > 0.02 &&
                   bench.tools.hear(static_cast<ToolKind>(tool), poseAt(Vec3(0, -5, 0)), 100.0 + time - 0.1).ok());
      return poseAt(start);
    };
    bench.run(0.5);
    EXPECT_LT((bench.tools.hand(static_cast<ToolKind>(tool))->translation - start).norm(), 1e-12);
    if (tool == kPick) EXPECT_LT((bench.world->heldPick()->target - start).norm(), 1e-12);
    if (tool == kPush) EXPECT_LT((bench.world->push().position - start).norm(), 1e-12);
    if (tool == kScissors) EXPECT_LT((bench.world->scissors().blades.origin - start).norm(), 1e-12);
  }
}

TEST(StreamedTools, APickIsHeldWhateverTheClockOfItsStreamDoes) {
  for (const double jump : {-20.0, -0.95, -0.6, 0.6, 0.95, 20.0})
    for (const bool once : {true, false}) {
      SCOPED_TRACE(::testing::Message() << jump << (once ? " s once" : " s for good"));
      ToolBench bench(slowTools());
      const Vec3 start = bench.pick().position;
      bench.hands[kPick] = [&](double time) { return poseAt(start + Vec3(0, 0.1 * time, 0)); };
      bench.stamp = [&](double time) {
        const bool jumps = once ? std::abs(time - 1.0) < 0.5 * ToolBench::kStream : time > 1.0;
        return 100.0 + time + (jumps ? jump : 0.0);
      };
      double behind = 0.0;
      bench.after_each = [&](double time) {
        ASSERT_TRUE(bench.world->heldPick());
        behind = std::max(behind, start.y() + 0.1 * time - bench.world->heldPick()->target.y());
      };
      bench.run(3.0);
      EXPECT_TRUE(bench.said(EventType::kLifted).empty());
      EXPECT_TRUE(bench.warned.empty());
      // It stands still while late ones may be late, and one way of a message or two.
      EXPECT_LT(behind, 0.1 * (StampOrder::kLongestLate + 4.0 * ToolBench::kStream));
    }
}

// Two senders of one tool, 20 cm apart.
TEST(StreamedTools, AJumpThatNoHandMakesIsNamed) {
  for (const bool stamped : {true, false})
    for (const std::size_t tool : {kPick, kPush, kScissors}) {
      ToolBench bench(slowTools());
      const Vec3 start = tool == kPick ? bench.pick().position : Vec3(0, 0, 1.0);
      if (!stamped) bench.stamp = [](double) { return 0.0; };
      // As fast as a hand goes, and a node that stands still for a moment.
      bench.hands[tool] = [&](double time) { return poseAt(start + Vec3(0, 0.5 * std::sin(10.0 * time), 0)); };
      bench.stands_still = [](double time) { return time > 0.4 && time < 0.42; };
      bench.run(1.0);
      EXPECT_TRUE(bench.warned.empty()) << bench.warned.size() << ": " << bench.warned[0];
      bench.hands[tool] = still(start);
      bench.run(0.1);
      bench.warned.clear();
      bool other = false;
      bench.hands[tool] = [&](double) { return poseAt(start + Vec3(0, (other = !other) ? 0.2 : 0.0, 0)); };
      bench.run(0.1);
      ASSERT_GT(bench.warned.size(), 10u);
      EXPECT_NE(bench.warned[1].find("the pose jumps by 0.2 m in 0.005 s"), std::string::npos) << bench.warned[1];
      EXPECT_NE(bench.warned[1].find("up to 0.5 m/s (tools/"), std::string::npos) << bench.warned[1];
    }
}

TEST(StreamedTools, GapsBelowTheSilenceLiftNothing) {
  ToolBench bench(slowTools());
  const Vec3 start = bench.pick().position;
  bench.hands[kPick] = [&](double time) {
    return std::fmod(time, 0.5) < 0.02 ? std::optional<Pose>(poseAt(start)) : std::nullopt;
  };
  bench.run(5.0);
  EXPECT_TRUE(bench.world->heldPick());
  EXPECT_TRUE(bench.said(EventType::kLifted).empty());
}

TEST(StreamedTools, WhileTheClockStandsNobodyIsSilent) {
  ToolBench bench(slowTools());
  bench.hands[kPush] = still(Vec3(0, 0, 1.0));
  bench.run(0.1);
  for (int i = 0; i < 10000; ++i) bench.tools.look();
  EXPECT_TRUE(bench.tools.hand(ToolKind::kPush));
  EXPECT_TRUE(bench.world->push().enabled);
  // Nor is silence made up for where the clock was set: forth, and back.
  bench.hand_clock.time = 1e6;
  bench.tools.look();
  bench.hand_clock.time = 50.0;
  for (int i = 0; i < 100; ++i) bench.tools.look();
  EXPECT_TRUE(bench.tools.hand(ToolKind::kPush));
}

// Its messages wait in a queue of ten while the stream goes on.
TEST(StreamedTools, ANodeThatStoodStillLiftsNobodyOffAndDoesNotJump) {
  for (const double seconds : {0.3, 0.7, 5.0}) {
    ToolBench bench(slowTools());
    const Vec3 start = bench.pick().position;
    bench.hands[kPick] = [&](double time) { return poseAt(start + Vec3(0, 0.1 * time, 0)); };
    bench.hands[kPush] = still(Vec3(0, 0, 1.0));
    bench.stands_still = [&](double time) { return time > 1.0 && time < 1.0 + seconds; };
    double before = start.y(), steepest = 0.0;
    bench.after_each = [&](double) {
      const double place = bench.world->heldPick()->target.y();
      steepest = std::max(steepest, place - before);
      before = place;
    };
    bench.run(1.0 + seconds + 2.0);
    EXPECT_TRUE(bench.said(EventType::kLifted).empty()) << seconds;
    EXPECT_LE(steepest, kSpeed * ToolMotion::kLongestTick + 1e-9) << seconds;
    EXPECT_NEAR(before, start.y() + 0.1 * (3.0 + seconds), 0.002) << seconds;
  }
}

TEST(StreamedTools, ALockedPickAndOneThatOthersMovedAreNotLifted) {
  ToolBench bench(slowTools());
  const PickReply locked = bench.pick();
  bench.hands[kPick] = still(locked.position + Vec3(0, 0.01, 0));
  bench.run(0.1);
  bench.hands[kPick] = {};
  LockCommand lock;
  lock.pick = locked.pick;
  ASSERT_TRUE(bench.world->apply(lock).ok());
  const PickReply free = bench.pick();
  MovePickCommand move;
  move.pick = free.pick;
  move.target = Vec3(-0.15, 0, 0.02);
  ASSERT_TRUE(bench.world->apply(move).ok());
  bench.run(1.5);
  EXPECT_FALSE(bench.tools.hand(ToolKind::kPick));
  EXPECT_EQ(bench.world->snapshot({}).picks.size(), 2u);
  EXPECT_TRUE(bench.said(EventType::kLifted).empty());
}

TEST(StreamedTools, TheSphereAppearsPushesAndIsLiftedOff) {
  ToolBench bench(slowTools());
  SnapshotWants measures{false, false, true};
  const auto place = [&] { return bench.world->snapshot(measures).bodies[0].measures.centre_of_mass.x(); };
  const double before = place();
  bench.hands[kPush] = [](double time) { return poseAt(Vec3(-0.12 + 0.2 * time, 0, 0)); };
  bench.run(0.5);
  EXPECT_GT(place(), before + 0.005);
  EXPECT_FALSE(bench.said(EventType::kTouched).empty());
  bench.hands[kPush] = {};
  bench.run(0.6);
  EXPECT_FALSE(bench.world->push().enabled);
  EXPECT_EQ(bench.said(EventType::kLifted).size(), 1u);
}

TEST(StreamedTools, WhoSleepsUnderAToolWakesWhenItsStreamFallsSilent) {
  for (const std::size_t tool : {kPick, kPush}) {
    ToolBench bench(slowTools());
    const PickReply picked = bench.pick();
    if (tool == kPush) ASSERT_TRUE(bench.world->apply(LockCommand{picked.pick, {}}).ok());
    bench.hands[tool] = still(tool == kPick ? picked.position : Vec3(0.06999, 0, 0));
    bench.run(1.5);
    EXPECT_TRUE(bench.world->snapshot({}).bodies[0].asleep) << tool;
    EXPECT_TRUE(bench.said(EventType::kAwake).empty()) << tool;
    bench.hands[tool] = {};
    bench.run(bench.settings.tools_silence + 0.1);
    EXPECT_FALSE(bench.world->snapshot({}).bodies[0].asleep) << tool;
  }
}

TEST(StreamedTools, ASphereThatAServicePlacedStays) {
  ToolBench bench(slowTools());
  bench.hands[kPush] = still(Vec3(0, 0, 1.0));
  bench.run(0.1);
  bench.hands[kPush] = {};
  PushCommand push;
  push.position = Vec3(0, 0, 1.2);
  ASSERT_TRUE(bench.world->apply(push).ok());
  bench.run(1.5);
  EXPECT_TRUE(bench.world->push().enabled);
  EXPECT_EQ(bench.world->push().position.z(), 1.2);
  EXPECT_TRUE(bench.said(EventType::kLifted).empty());
}

TEST(StreamedTools, TheScissorsCutOnceWhenTheJawClosesAndAreLiftedOff) {
  ToolBench bench(slowTools());
  EXPECT_TRUE(bench.tools.hearJaw(0.6).ok());  // nobody has said where the blades are
  EXPECT_TRUE(bench.tools.hearJaw(0.0).ok());
  bench.run(0.1);
  EXPECT_TRUE(bench.said(EventType::kCut).empty());
  bench.hands[kScissors] = [](double) { return acrossX(0.01); };
  bench.run(0.1);
  for (const double angle : {0.05, 0.0}) EXPECT_TRUE(bench.tools.hearJaw(angle).ok());  // was never open
  bench.run(0.1);
  EXPECT_TRUE(bench.said(EventType::kCut).empty());
  for (const double angle : {0.6, 0.3, 0.05, 0.01, 0.0, 0.01, 0.05, 0.0}) {
    EXPECT_TRUE(bench.tools.hearJaw(angle).ok());
    bench.run(0.01);
  }
  EXPECT_EQ(bench.said(EventType::kCut).size(), 1u);
  EXPECT_EQ(bench.world->snapshot({}).bodies.size(), 3u);
  // The jaw's messages are a sign of life too.
  bench.hands[kScissors] = {};
  for (int i = 0; i < 10; ++i) {
    bench.run(0.2);
    EXPECT_TRUE(bench.tools.hearJaw(0.6).ok());
  }
  EXPECT_TRUE(bench.world->scissors().shown);
  bench.run(0.6);
  EXPECT_FALSE(bench.world->scissors().shown);
  EXPECT_EQ(bench.said(EventType::kLifted).size(), 1u);
  // A jaw that was open when they were lifted does not cut where they come back.
  bench.hands[kScissors] = [](double) { return acrossX(0.51); };
  bench.run(0.1);
  EXPECT_TRUE(bench.tools.hearJaw(0.0).ok());
  bench.run(0.1);
  EXPECT_EQ(bench.said(EventType::kCut).size(), 1u);
  EXPECT_TRUE(bench.refused.empty());
}

TEST(StreamedTools, APausedToolStaysWhereItIsUntilItIsResumed) {
  ToolBench bench(slowTools());
  const Vec3 start = bench.pick().position;
  bench.hands[kPick] = [&](double time) { return poseAt(start + Vec3(0, 0, 0.1 * time)); };
  bench.run(0.3);
  EXPECT_EQ(Operating::kEnabled, bench.tools.condition(ToolKind::kPick).state);
  ASSERT_TRUE(bench.tools.command(ToolKind::kPick, "pause").ok());
  const Vec3 stopped = bench.world->heldPick()->target;
  EXPECT_GT(stopped.z(), start.z() + 0.02);
  EXPECT_TRUE(bench.refused.empty());
  bench.run(0.3);
  bench.hands[kPick] = {};
  bench.run(2.0 * bench.settings.tools_silence);
  EXPECT_EQ(Operating::kPaused, bench.tools.condition(ToolKind::kPick).state);
  EXPECT_FALSE(bench.tools.condition(ToolKind::kPick).busy);
  ASSERT_TRUE(bench.world->heldPick());
  EXPECT_EQ(stopped, bench.world->heldPick()->target);
  EXPECT_TRUE(bench.said(EventType::kLifted).empty());
  ASSERT_FALSE(bench.refused.empty());
  EXPECT_NE(std::string::npos, bench.refused[0].find("PAUSED"));
  // Once it is resumed it hears, and is silent, as before.
  ASSERT_TRUE(bench.tools.command(ToolKind::kPick, "resume").ok());
  bench.hands[kPick] = still(start);
  bench.run(0.5);
  EXPECT_EQ(start, bench.world->heldPick()->target);
  bench.hands[kPick] = {};
  bench.run(bench.settings.tools_silence + 0.1);
  EXPECT_EQ(1u, bench.said(EventType::kLifted).size());
}

TEST(StreamedTools, APausedSphereStopsOnItsWay) {
  ToolBench bench(slowTools());
  bench.hands[kPush] = still(Vec3(0, 0, 1.0));
  bench.run(0.1);
  bench.hands[kPush] = still(Vec3(0, 0, 2.0));
  bench.run(0.2);
  ASSERT_TRUE(bench.tools.command(ToolKind::kPush, "pause").ok());
  const Vec3 stopped = bench.world->push().position;
  EXPECT_GT(stopped.z(), 1.05);
  EXPECT_LT(stopped.z(), 1.15);
  bench.run(0.5);
  EXPECT_EQ(stopped, bench.world->push().position);
  ASSERT_TRUE(bench.tools.command(ToolKind::kPush, "resume").ok());
  bench.run(0.2);
  EXPECT_GT(bench.world->push().position.z(), stopped.z() + 0.05);
}

// A reset and a loaded state know nothing of the states of tools: what is left of them has to be said.
TEST(StreamedTools, WhichToolsDoNotHearIsSaid) {
  ToolBench bench(slowTools());
  EXPECT_EQ("", bench.tools.notEnabled());
  bench.tools.noteInstrument("left", Operating::kPaused);
  EXPECT_EQ("; the instrument left stays PAUSED until its state_command is resume", bench.tools.notEnabled());
  bench.tools.noteInstrument("left", Operating::kEnabled);
  bench.tools.noteInstrument("right", Operating::kDisabled);
  bench.tools.noteInstrument("right", std::nullopt);
  EXPECT_EQ("", bench.tools.notEnabled());
  ASSERT_TRUE(bench.tools.command(ToolKind::kPick, "pause").ok());
  ASSERT_TRUE(bench.tools.command(ToolKind::kScissors, "disable").ok());
  EXPECT_EQ(
      "; the pick stays PAUSED until its state_command is resume; the scissors stays DISABLED until its "
      "state_command is enable",
      bench.tools.notEnabled());
}

TEST(StreamedTools, ADisabledToolIsLiftedAndHearsNothing) {
  ToolBench bench(slowTools());
  bench.hands[kPush] = still(Vec3(0, 0, 1.0));
  bench.run(0.1);
  ASSERT_TRUE(bench.world->push().enabled);
  ASSERT_TRUE(bench.tools.command(ToolKind::kPush, "disable").ok());
  bench.run(0.1);
  EXPECT_FALSE(bench.world->push().enabled);
  ASSERT_EQ(1u, bench.said(EventType::kLifted).size());
  EXPECT_EQ("the push was lifted off: it was disabled", bench.said(EventType::kLifted)[0].text);
  ASSERT_TRUE(bench.tools.command(ToolKind::kPush, "enable").ok());
  bench.run(0.1);
  EXPECT_TRUE(bench.world->push().enabled);
}

TEST(StreamedTools, ScissorsThatArePausedDoNotCut) {
  ToolBench bench(slowTools());
  bench.hands[kScissors] = [](double) { return acrossX(0.0); };
  bench.run(0.1);
  EXPECT_TRUE(bench.tools.hearJaw(0.5).ok());
  ASSERT_TRUE(bench.tools.command(ToolKind::kScissors, "pause").ok());
  const Status paused = bench.tools.hearJaw(0.0);
  ASSERT_FALSE(paused.ok());
  EXPECT_NE(paused.error().detail.find("accepted once its state_command was resume"), std::string::npos);
  bench.run(0.1);
  EXPECT_TRUE(bench.said(EventType::kCut).empty());
  ASSERT_TRUE(bench.tools.command(ToolKind::kScissors, "resume").ok());
  EXPECT_TRUE(bench.tools.hearJaw(0.0).ok());
  bench.run(0.1);
  EXPECT_EQ(1u, bench.said(EventType::kCut).size());
}

TEST(StreamedTools, CommandsThatDoNotFitAreRefusedWithThoseThatDo) {
  ToolBench bench(slowTools());
  const auto refusal = [&](const std::string& word) {
    const Status done = bench.tools.command(ToolKind::kPick, word);
    return done.ok() ? std::string() : done.error().detail;
  };
  EXPECT_NE(std::string::npos,
            refusal("jump").find("ENABLED and the command is 'jump'; accepted: disable, pause, home"));
  EXPECT_NE(std::string::npos, refusal("resume").find("accepted: disable, pause, home"));
  EXPECT_EQ("", refusal("pause"));
  EXPECT_NE(std::string::npos, refusal("enable").find("PAUSED"));
  EXPECT_EQ("", refusal("disable"));
  EXPECT_NE(std::string::npos, refusal("pause").find("DISABLED and the command is 'pause'; accepted: enable, home"));
  EXPECT_EQ("", refusal("enable"));
  EXPECT_EQ("", refusal("home"));
}

TEST(StreamedTools, BladesFitABodyHoweverItLies) {
  Quat turned;
  turned = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized());
  for (const Vec3& size : {Vec3(0.006, 0.05, 0.007), Vec3(0.05, 0.008, 0.007), Vec3(0.3, 0.2, 0.1)}) {
    Points corners;
    for (const double x : {-0.5, 0.5})
      for (const double y : {-0.5, 0.5})
        for (const double z : {-0.5, 0.5}) corners.push_back(Vec3(1, 2, 3) + turned * size.cwiseProduct(Vec3(x, y, z)));
    Vec3 sorted = size;
    std::sort(sorted.data(), sorted.data() + 3);
    // A square section has no axes of its own: its width is that of a side or of the diagonal.
    const double square = std::abs(sorted[1] - sorted[0]) < 1e-9 ? std::sqrt(2.0) : 1.0;
    EXPECT_GE(bladesFor(corners), std::min(3.0 * sorted[1], kBlades) - 1e-12) << size.transpose();
    EXPECT_LE(bladesFor(corners), std::min(3.0 * square * sorted[1], kBlades) + 1e-12) << size.transpose();
  }
}

}  // namespace streamed_tools_test
}  // namespace meshless
