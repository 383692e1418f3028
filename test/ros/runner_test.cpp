#include "ros/runner.h"

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include "ros/publishers.h"
#include "ros/hand_clock.h"
#include "ros/scene_support.h"

namespace meshless {
namespace runner_test {

RunnerSettings pausedAtStart() {
  RunnerSettings settings;
  settings.paused = true;
  return settings;
}

std::uint64_t stepCount(WorldRunner& runner) {
  std::uint64_t steps = 0;
  EXPECT_TRUE(runner.look([&](World& world) { steps = world.stepCount(); }).ok());
  return steps;
}

/// Looks until `true_at_last` holds: how long that takes is not for a test to say.
void waitUntil(const std::function<bool()>& true_at_last) {
  while (!true_at_last()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

TEST(Runner, APausedWorldAnswersAndDoesNotStep) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  runner.start();
  PickCommand pick;
  pick.point = Vec3(0.05, 0.05, 0.05);
  const auto reply = runner.apply(pick);
  ASSERT_TRUE(reply.ok()) << reply.error().detail;
  EXPECT_EQ(1u, std::get<PickReply>(*reply).pick);
  EXPECT_EQ(0u, stepCount(runner));
  EXPECT_TRUE(runner.status().paused);
}

TEST(Runner, StepsAreDoneExactlyPausedOrNot) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  runner.start();
  const auto time = runner.doSteps(30);
  ASSERT_TRUE(time.ok());
  EXPECT_DOUBLE_EQ(0.25, *time);
  EXPECT_EQ(30u, stepCount(runner));
  ASSERT_TRUE(runner.doSteps(1).ok());
  EXPECT_EQ(31u, stepCount(runner));
}

TEST(Runner, StepsFollowTheClockAndNotTheWall) {
  HandClock hand;
  WorldRunner runner(twoBoxes(), {}, hand.clock);
  runner.start();
  waitUntil([&] { return stepCount(runner) == 1; });  // the first is due at once
  hand.time = 100.0 + 5.5 / 120.0;
  waitUntil([&] { return stepCount(runner) == 6; });
  hand.time = 100.0 + 6.5 / 120.0;
  waitUntil([&] { return stepCount(runner) == 7; });
  EXPECT_EQ(0.0, runner.status().dropped);
}

TEST(Runner, StepsAreDueFromTheMomentWhenAPauseEnds) {
  HandClock hand;
  WorldRunner runner(twoBoxes(), pausedAtStart(), hand.clock);
  // Time passes after the pause has ended and before the runner looks what is due.
  runner.setStepSink([&](const World&, double simulated) {
    if (simulated == 0.0) hand.time = 100.0 + 0.5 / 120.0;
  });
  runner.start();
  ASSERT_TRUE(runner.setPaused(false).ok());
  waitUntil([&] { return stepCount(runner) == 1; });
  hand.time = 100.0 + 1.25 / 120.0;
  waitUntil([&] { return stepCount(runner) == 2; });
}

TEST(Runner, ABacklogBeyondItsBoundIsDroppedAndCounted) {
  HandClock hand;
  RunnerSettings settings;
  settings.max_backlog = 0.1;
  WorldRunner runner(twoBoxes(), settings, hand.clock);
  runner.start();
  waitUntil([&] { return stepCount(runner) == 1; });
  hand.time = 200.0;
  // One step finds the clock far ahead, the rest is the bound's: 0.1 s of 1/120 s.
  waitUntil([&] { return stepCount(runner) >= 13; });
  EXPECT_NEAR(100.0 - 0.1 - 2.0 / 120.0, runner.status().dropped, 1e-6);
  EXPECT_LE(stepCount(runner), 15u);
}

TEST(Runner, AClockThatIsSetBackDoesNotStopTheWorld) {
  HandClock hand;
  WorldRunner runner(twoBoxes(), {}, hand.clock);
  runner.start();
  waitUntil([&] { return stepCount(runner) == 1; });
  hand.time = 5.0;
  hand.clock.now();
  hand.time = 5.0 + 2.5 / 120.0;
  waitUntil([&] { return stepCount(runner) == 3; });
  EXPECT_EQ(0.0, runner.status().dropped);
}

TEST(Runner, ACutWaitsForItsBladesAndHoldsNobodyUp) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  runner.start();
  ASSERT_TRUE(runner.setPaused(false).ok());
  CutCommand command = cutAcross(0.01);
  command.close_time = 0.25;
  auto cut = std::async(std::launch::async, [&] { return runner.cut(command); });
  waitUntil([&] {
    bool shown = false;
    EXPECT_TRUE(runner.look([&](World& world) { shown = world.scissors().shown; }).ok());
    return shown || cut.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  });
  ASSERT_TRUE(runner.apply(ClearPicksCommand{}).ok());
  const auto answer = cut.get();
  ASSERT_TRUE(answer.ok()) << answer.error().detail;
  EXPECT_FALSE(answer->closed_at_once);
  EXPECT_EQ(std::vector<std::string>{"a"}, answer->reply.cut_bodies);
  EXPECT_EQ(2u, answer->reply.new_bodies.size());
  EXPECT_GE(stepCount(runner), 30u);
}

TEST(Runner, WhilePausedTheBladesMeetAtOnce) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  runner.start();
  CutCommand command = cutAcross(0.01);
  command.close_time = 30.0;
  const auto answer = runner.cut(command);
  ASSERT_TRUE(answer.ok()) << answer.error().detail;
  EXPECT_TRUE(answer->closed_at_once);
  EXPECT_EQ(2u, answer->reply.new_bodies.size());
  EXPECT_EQ(0u, stepCount(runner));
}

TEST(Runner, AResetAnswersACutThatWaits) {
  HandClock hand;
  WorldRunner runner(twoBoxes(), {}, hand.clock);
  runner.start();
  CutCommand command = cutAcross(0.01);
  command.close_time = 30.0;
  auto cut = std::async(std::launch::async, [&] { return runner.cut(command); });
  waitUntil([&] {
    bool shown = false;
    EXPECT_TRUE(runner.look([&](World& world) { shown = world.scissors().shown; }).ok());
    return shown;
  });
  ASSERT_TRUE(runner.reset().ok());
  const auto answer = cut.get();
  ASSERT_FALSE(answer.ok());
  EXPECT_NE(std::string::npos, answer.error().detail.find("reset")) << answer.error().detail;
  const auto snapshot = runner.snapshot({});
  ASSERT_EQ(2u, snapshot->bodies.size());
}

TEST(Runner, AnErrorComesBackAndNothingChanges) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  runner.start();
  std::uint64_t before = 0;
  std::uint64_t after = 0;
  ASSERT_TRUE(runner.look([&](World& world) { before = world.stateHash(); }).ok());
  EXPECT_FALSE(runner.cut(cutAcross(10.0)).ok());
  RemoveCommand remove;
  remove.body = "no such body";
  EXPECT_FALSE(runner.apply(remove).ok());
  ASSERT_TRUE(runner.look([&](World& world) { after = world.stateHash(); }).ok());
  EXPECT_EQ(before, after);
}

TEST(Runner, JobsThatThrowAreAnsweredAndTheNextOneRuns) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  runner.start();
  const Status thrown = runner.look([](World&) { throw std::runtime_error("a broken job"); });
  ASSERT_FALSE(thrown.ok());
  EXPECT_NE(std::string::npos, thrown.error().detail.find("a broken job"));
  EXPECT_EQ(0u, stepCount(runner));
}

TEST(Runner, WhoWaitsWhenItStopsIsAnswered) {
  HandClock hand;
  WorldRunner runner(twoBoxes(), {}, hand.clock);
  runner.start();
  CutCommand command = cutAcross(0.01);
  command.close_time = 30.0;
  auto cut = std::async(std::launch::async, [&] { return runner.cut(command); });
  waitUntil([&] {
    bool shown = false;
    EXPECT_TRUE(runner.look([&](World& world) { shown = world.scissors().shown; }).ok());
    return shown;
  });
  runner.stop();
  EXPECT_FALSE(cut.get().ok());
  EXPECT_FALSE(runner.apply(ClearPicksCommand{}).ok());
  EXPECT_FALSE(runner.doSteps(1).ok());
  EXPECT_EQ(nullptr, runner.snapshot({}));
}

TEST(Runner, ACutThatIsCancelledWhilePausedLeavesTheOther) {
  HandClock hand;
  WorldRunner runner(twoBoxes(), {}, hand.clock);
  runner.start();
  Progress first, second;
  CutCommand command = cutAcross(0.01);
  command.close_time = 0.5;
  command.bodies = {"a"};
  auto a = std::async(std::launch::async, [&] { return runner.cut(command, &first); });
  waitUntil([&] { return first.phase() == Progress::Phase::kClosing; });
  CutCommand other = cutAcross(0.51);
  other.close_time = 0.5;
  other.bodies = {"b"};
  auto b = std::async(std::launch::async, [&] { return runner.cut(other, &second); });
  waitUntil([&] { return second.phase() == Progress::Phase::kClosing; });
  ASSERT_TRUE(runner.setPaused(true).ok());
  EXPECT_FALSE(first.cancel()) << "it has begun: the runner answers";
  runner.endCancelled();
  const auto cancelled = a.get();
  ASSERT_FALSE(cancelled.ok());
  EXPECT_TRUE(first.ended());
  EXPECT_NE(std::string::npos, cancelled.error().detail.find("before the blades met")) << cancelled.error().detail;
  ASSERT_TRUE(runner.doSteps(62).ok());
  const auto done = b.get();
  ASSERT_TRUE(done.ok()) << done.error().detail;
  EXPECT_EQ(std::vector<std::string>{"b"}, done->reply.cut_bodies);
  EXPECT_FALSE(second.ended());
  EXPECT_EQ(Progress::Phase::kCutting, second.phase());
  EXPECT_EQ(1.0, second.closed());
  EXPECT_EQ(3u, runner.snapshot({})->bodies.size());
}

struct Told : Progress {
  void tell() override { told = true; }
  std::atomic<bool> told{false};
};

TEST(Runner, StepsThatAreCancelledEndAfterAWholeOneAndLeaveTheNext) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  runner.start();
  Told first, second;
  auto a = std::async(std::launch::async, [&] { return runner.doSteps(1u << 30, &first); });
  waitUntil([&] { return first.stepsDone() > 5; });
  auto b = std::async(std::launch::async, [&] { return runner.doSteps(20, &second); });
  waitUntil([&] { return second.told.load(); });  // it waits for the first
  EXPECT_EQ(0u, second.stepsDone());
  EXPECT_FALSE(first.cancel());
  runner.endCancelled();
  const auto cancelled = a.get();
  ASSERT_FALSE(cancelled.ok());
  EXPECT_TRUE(first.ended());
  ASSERT_TRUE(b.get().ok());
  EXPECT_EQ(20u, second.stepsDone());
  EXPECT_EQ(first.stepsDone() + 20, stepCount(runner));
  EXPECT_NEAR(static_cast<double>(first.stepsDone()) / 120.0, first.simTime(), 1e-9);
}

TEST(Runner, WhatIsCancelledBeforeItBeginsIsNotDone) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  runner.start();
  std::uint64_t before = 0, after = 0;
  ASSERT_TRUE(runner.look([&](World& world) { before = world.stateHash(); }).ok());
  const auto cancelled = [](Progress& progress) {
    EXPECT_TRUE(progress.cancel()) << "who cancels is to answer";
    EXPECT_FALSE(progress.cancel()) << "once";
    return &progress;
  };
  Progress cut, spawn, steps;
  EXPECT_FALSE(runner.cut(cutAcross(0.01), cancelled(cut)).ok());
  SpawnCommand command;
  command.body = softBox("c", Vec3(0, 0, 1));
  EXPECT_FALSE(runner.apply(command, cancelled(spawn)).ok());
  EXPECT_FALSE(runner.doSteps(3, cancelled(steps)).ok());
  for (Progress* progress : {&cut, &spawn, &steps}) {
    EXPECT_TRUE(progress->ended());
    EXPECT_FALSE(progress->finish()) << "it has been answered";
  }
  ASSERT_TRUE(runner.look([&](World& world) { after = world.stateHash(); }).ok());
  EXPECT_EQ(before, after);
}

TEST(Runner, WhatIsDoneCanNotBeCancelled) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  runner.start();
  Progress progress;
  ASSERT_TRUE(runner.cut(cutAcross(0.01), &progress).ok());
  EXPECT_FALSE(progress.cancel());
  runner.endCancelled();
  EXPECT_TRUE(progress.finish());
  EXPECT_FALSE(progress.ended());
  EXPECT_EQ(3u, runner.snapshot({})->bodies.size());
}

TEST(Runner, EventsAreHandedOverBeforeTheAnswer) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  std::mutex mutex;
  std::vector<Event> events;
  runner.setEventSink([&](std::vector<Event> some) {
    const std::lock_guard<std::mutex> lock(mutex);
    events.insert(events.end(), some.begin(), some.end());
  });
  runner.start();
  PickCommand pick;
  pick.point = Vec3(0.05, 0.05, 0.05);
  ASSERT_TRUE(runner.apply(pick).ok());
  const std::lock_guard<std::mutex> lock(mutex);
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(EventType::kPicked, events.back().type);
}

TEST(Runner, TheRevisionTellsWhetherSomethingMayHaveChanged) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  runner.start();
  const auto start = runner.revision();
  stepCount(runner);
  runner.snapshot({});
  EXPECT_EQ(start, runner.revision());
  ASSERT_TRUE(runner.apply(ClearPicksCommand{}).ok());
  EXPECT_EQ(start + 1, runner.revision());
  ASSERT_TRUE(runner.doSteps(3).ok());
  EXPECT_EQ(start + 4, runner.revision());
}

TEST(Runner, AStepThatFailsPausesTheWorldAndSaysWhyUntilItRunsAgain) {
  WorldRunner runner(twoBoxes(), pausedAtStart(), wallClock());
  std::atomic<bool> broken{true};
  runner.setStepSink([&](const World&, double dt) {
    if (dt > 0.0 && broken) throw std::runtime_error("a broken part");
  });
  std::mutex mutex;
  std::vector<Event> events;
  runner.setEventSink([&](std::vector<Event> some) {
    const std::lock_guard<std::mutex> lock(mutex);
    events.insert(events.end(), some.begin(), some.end());
  });
  runner.start();
  const auto summary = [&] {
    diagnostic_updater::DiagnosticStatusWrapper status;
    summarize(runner.status(), 0, status);
    return std::pair<int, std::string>(status.level, status.message);
  };
  const std::pair<int, std::string> paused{diagnostic_msgs::DiagnosticStatus::OK, "paused"};
  EXPECT_EQ(paused, summary());
  const auto fail = [&] {
    broken = true;
    EXPECT_TRUE(runner.setPaused(false).ok());
    waitUntil([&] { return runner.status().paused; });
    EXPECT_EQ(diagnostic_msgs::DiagnosticStatus::ERROR, summary().first);
    EXPECT_NE(std::string::npos, summary().second.find("a broken part")) << summary().second;
    broken = false;
  };
  fail();
  ASSERT_TRUE(runner.setPaused(true).ok());  // mends nothing
  EXPECT_EQ(diagnostic_msgs::DiagnosticStatus::ERROR, summary().first);
  {
    const std::lock_guard<std::mutex> lock(mutex);
    EXPECT_TRUE(std::any_of(events.begin(), events.end(), [](const Event& e) { return e.type == EventType::kFault; }));
  }
  ASSERT_TRUE(runner.setPaused(false).ok());
  EXPECT_EQ("", runner.status().fault);
  ASSERT_TRUE(runner.setPaused(true).ok());
  EXPECT_EQ(paused, summary());
  fail();
  ASSERT_TRUE(runner.reset().ok());
  EXPECT_EQ(paused, summary());
}

TEST(Runner, StepsThatTakeLongerThanTheySimulateAreReported) {
  // 10,000 steps a second of ten boxes each: no machine of the day keeps up.
  WorldSettings settings;
  settings.step_rate = 10000.0;
  settings.substeps = 100;
  auto world = std::make_unique<World>(settings);
  for (int i = 0; i < 10; ++i) {
    const auto body = softBox("b" + std::to_string(i), Vec3(0.3 * i, 0.0, 0.2));
    ASSERT_TRUE(body && world->addSceneBody(body).ok());
  }
  WorldRunner runner(std::move(world), {}, wallClock());
  std::mutex mutex;
  bool said = false;
  runner.setEventSink([&](std::vector<Event> some) {
    const std::lock_guard<std::mutex> lock(mutex);
    for (const Event& event : some) said = said || event.type == EventType::kOverBudget;
  });
  runner.start();
  waitUntil([&] { return runner.status().overruns > 100 && runner.status().dropped > 0.0; });
  EXPECT_LT(runner.status().real_time_factor, 0.9);
  EXPECT_GT(runner.status().worst_step, 1e-4);
  const std::lock_guard<std::mutex> lock(mutex);
  EXPECT_TRUE(said);
}

}  // namespace runner_test
}  // namespace meshless
