#include "task_text.h"

#include <cmath>

#include <gtest/gtest.h>

namespace meshless {
namespace {

meshless_surgery::TaskState begun() {
  meshless_surgery::TaskState task;
  task.task = "resect";
  task.brief = "Cut the lump out.";
  task.running = true;
  task.stages = {"cut", "lay aside"};
  task.stage_brief = "nine tenths of the plane, <slowly>";
  task.time_limit = 300.0;
  task.force_limit = 2.5;
  task.plan_done = std::nan("");
  return task;
}

TEST(TaskText, SaysWhatIsToBeDoneNowAndWithinWhat) {
  auto task = begun();
  EXPECT_EQ(
      "<b>resect</b>: Cut the lump out.<br><b>Now, 1 of 2: cut</b>. nine tenths of the plane, &lt;slowly&gt;"
      "<br>Limits: 300 s, 2.5 N",
      taskText(task).toStdString());
  task.stage = 1;
  task.stage_brief.clear();
  task.time_limit = task.force_limit = 0.0;
  EXPECT_EQ("<b>resect</b>: Cut the lump out.<br><b>Now, 2 of 2: lay aside</b>", taskText(task).toStdString());
}

TEST(TaskText, SaysWhatShareOfThePlanIsCut) {
  auto task = begun();
  task.plan_done = 0.447;
  EXPECT_NE(std::string::npos, taskText(task).toStdString().find("<br>Plan: 45 % is cut"));
}

TEST(TaskText, SaysHowLongItHasRunAndWhyItDoesNotCount) {
  auto task = begun();
  EXPECT_NE(std::string::npos, taskText(task, 12.0).toStdString().find("<br>Time: 12 s<br>Limits"));
  task.settling = true;
  EXPECT_NE(std::string::npos, taskText(task, 0.0).toStdString().find("<br>The scene comes to rest first<br>Limits"));
  task.running = false;
  task.not_counted = {"a cut was <taken> back"};
  EXPECT_NE(std::string::npos, taskText(task).toStdString().find("<br><b>Does not count</b>: a cut was &lt;taken&gt; back"));
}

TEST(TaskText, SaysHowItEnded) {
  auto task = begun();
  task.running = false;
  task.score = 41.6;
  const auto last = [&] {
    return taskText(task).toStdString().substr(std::string("<b>resect</b>: Cut the lump out.").size());
  };
  EXPECT_EQ("<br><b>Stopped</b>, 42 of 100", last());
  task.stage = 2;
  EXPECT_EQ("<br><b>Not passed</b>, 42 of 100", last());
  task.passed = true;
  EXPECT_EQ("<br><b>Passed</b>, 42 of 100", last());
  task.passed = false;
  task.failed = "a force of 3 N";
  EXPECT_EQ("<br><b>Failed</b>: a force of 3 N", last());
}

}  // namespace
}  // namespace meshless
