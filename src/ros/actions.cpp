#include "actions.h"

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <optional>
#include <thread>

#include <actionlib/server/action_server.h>
#include <meshless_surgery/CutAction.h>
#include <meshless_surgery/InciseAction.h>
#include <meshless_surgery/SpawnAction.h>
#include <meshless_surgery/StepAction.h>
#include <ros/spinner.h>

namespace meshless {
namespace {

using meshless_surgery::CutFeedback;
using meshless_surgery::InciseFeedback;
using meshless_surgery::SpawnFeedback;
using meshless_surgery::StepFeedback;
using SteadyClock = std::chrono::steady_clock;
using Phase = Progress::Phase;

constexpr std::size_t kMostGoals = 1000;  // of an action that are not done
constexpr std::chrono::seconds kLongestEnd(1);
constexpr std::chrono::milliseconds kSendingTime(100);  // roscpp does not say when a message is on its way

// --- feedback

CutFeedback feedbackOf(const Progress& progress, const meshless_surgery::CutGoal&) {
  CutFeedback feedback;
  const Phase phase = progress.phase();
  feedback.phase = phase == Phase::kCutting   ? CutFeedback::CUTTING
                   : phase == Phase::kClosing ? CutFeedback::CLOSING
                                              : CutFeedback::WAITING;
  feedback.closed = progress.closed();
  return feedback;
}

InciseFeedback feedbackOf(const Progress& progress, const meshless_surgery::InciseGoal&) {
  InciseFeedback feedback;
  feedback.phase = progress.phase() == Phase::kCutting ? InciseFeedback::CUTTING : InciseFeedback::WAITING;
  return feedback;
}

StepFeedback feedbackOf(const Progress& progress, const meshless_surgery::StepGoal& goal) {
  StepFeedback feedback;
  feedback.phase = progress.phase() == Phase::kStepping ? StepFeedback::STEPPING : StepFeedback::WAITING;
  feedback.steps_done = static_cast<std::uint32_t>(progress.stepsDone());
  feedback.steps = goal.steps;
  return feedback;
}

SpawnFeedback feedbackOf(const Progress& progress, const meshless_surgery::SpawnGoal&) {
  SpawnFeedback feedback;
  const Phase phase = progress.phase();
  feedback.phase = phase == Phase::kAdding      ? SpawnFeedback::ADDING
                   : phase == Phase::kPreparing ? SpawnFeedback::PREPARING
                   : phase == Phase::kReading   ? SpawnFeedback::READING
                                                : SpawnFeedback::WAITING;
  return feedback;
}

// --- goals

template <class Action>
class OpenGoal : public Progress {
 public:
  ACTION_DEFINITION(Action)
  using Handle = actionlib::ServerGoalHandle<Action>;

  explicit OpenGoal(const Handle& handle) : handle_(handle), wanted_(handle.getGoal()) {}

  const auto& wanted() const { return *wanted_; }
  std::string id() const { return handle_.getGoalID().id; }

  void tell() override {
    const Feedback now = feedbackOf(*this, *wanted_);
    if (told_ && *told_ == now) return;
    told_ = now;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!answered_) handle_.publishFeedback(now);
  }

  /// From now on it is active. False where it was answered before.
  bool accept() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!answered_) handle_.setAccepted();
    return !answered_;
  }

  void answer(const Result& result) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (answered_) return;
    answered_ = true;
    if (result.success)
      handle_.setSucceeded(result, result.message);
    else if (ended())
      handle_.setCanceled(result, result.message);
    else
      handle_.setAborted(result, result.message);
  }

  /// Cancels it, and answers where it has not begun; whether it has answered.
  bool answerUnlessBegun(const std::string& why, bool abort) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!cancel() || answered_) return answered_;
    answered_ = true;
    Result result;
    fillRefused(result, {ErrorCode::kFailed, why});
    if (!abort) {
      handle_.setCanceled(result, result.message);
    } else {
      const auto status = handle_.getGoalStatus().status;
      if (status == actionlib_msgs::GoalStatus::PENDING || status == actionlib_msgs::GoalStatus::RECALLING)
        handle_.setAccepted();
      handle_.setAborted(result, result.message);
    }
    return true;
  }

 private:
  std::mutex mutex_;  // of the handle
  Handle handle_;
  const boost::shared_ptr<const Goal> wanted_;
  bool answered_ = false;
  std::optional<Feedback> told_;
};

class Call : public ros::CallbackInterface {
 public:
  explicit Call(std::function<void()> call) : call_(std::move(call)) {}
  CallResult call() override {
    call_();
    return Success;
  }

 private:
  std::function<void()> call_;
};

// --- one action

template <class Action>
class Server {
 public:
  ACTION_DEFINITION(Action)
  using Handle = typename OpenGoal<Action>::Handle;
  using OpenGoalPtr = std::shared_ptr<OpenGoal<Action>>;
  using Work = std::function<void(const Goal&, Result&, Progress*)>;

  Server(const ros::NodeHandle& handle, const std::string& name, ros::CallbackQueue& queue, WorldRunner& runner,
         Work work)
      : queue_(queue),
        runner_(runner),
        work_(std::move(work)),
        server_(
            handle, name, [this](Handle goal) { receive(goal); }, [this](Handle goal) { cancel(goal); }, false) {
    server_.start();
  }

  void end() {
    std::unique_lock<std::mutex> lock(mutex_);
    ending_ = true;
    for (auto open = open_.begin(); open != open_.end();) {
      if (open->second->answerUnlessBegun("the node is shutting down", true)) {
        ROS_WARN_STREAM("aborted the goal " << open->first << ": the node is shutting down");
        open = closed(open);
      } else {
        ++open;
      }
    }
    all_done_.wait_for(lock, kLongestEnd, [this] { return open_.empty(); });
  }

  std::optional<SteadyClock::time_point> lastAnswer() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return last_answer_;
  }

 private:
  void receive(Handle handle) {
    const auto goal = std::make_shared<OpenGoal<Action>>(handle);
    std::unique_lock<std::mutex> lock(mutex_);
    if (ending_ || open_.size() >= kMostGoals) {
      const std::string many = std::to_string(open_.size()) + " goals are not done; accepted: up to " +
                               std::to_string(kMostGoals) + " at once";
      goal->answerUnlessBegun(ending_ ? "the node is shutting down" : many, true);
      last_answer_ = SteadyClock::now();
      return;
    }
    open_[goal->id()] = goal;
    lock.unlock();
    goal->tell();
    queue_.addCallback(ros::CallbackInterfacePtr(new Call([this, goal] { work(*goal); })));
  }

  void work(OpenGoal<Action>& goal) {
    if (!goal.accept()) return;
    Result result;
    work_(goal.wanted(), result, &goal);
    goal.tell();
    if (goal.finish()) goal.answer(result);
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto open = open_.find(goal.id());
    if (open != open_.end() && open->second.get() == &goal) closed(open);
  }

  void cancel(const Handle& handle) {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto open = open_.find(handle.getGoalID().id);
    if (open == open_.end()) return;
    if (open->second->answerUnlessBegun("cancelled before it began", false)) {
      closed(open);
      return;
    }
    lock.unlock();
    runner_.endCancelled();
  }

  auto closed(typename std::map<std::string, OpenGoalPtr>::iterator open) {
    last_answer_ = SteadyClock::now();
    const auto next = open_.erase(open);
    if (open_.empty()) all_done_.notify_all();
    return next;
  }

  ros::CallbackQueue& queue_;
  WorldRunner& runner_;
  const Work work_;
  mutable std::mutex mutex_;  // before that of a goal
  std::condition_variable all_done_;
  std::map<std::string, OpenGoalPtr> open_;  // by id
  std::optional<SteadyClock::time_point> last_answer_;
  bool ending_ = false;
  actionlib::ActionServer<Action> server_;
};

ros::NodeHandle handleOf(const ros::NodeHandle& private_handle, ros::CallbackQueue& queue) {
  ros::NodeHandle handle(private_handle, "actions");
  handle.setCallbackQueue(&queue);
  return handle;
}

}  // namespace

struct Actions::Servers {
  Servers(const ros::NodeHandle& private_handle, const LongWork& work, const Queues& queues)
      : handle(handleOf(private_handle, goals)),
        cut(handle, "cut", queues.cut, work.runner,
            [&work](const auto& goal, auto& result, Progress* progress) {
              work.cut(goal, result, "actions/cut", progress);
            }),
        incise(handle, "incise", queues.cut, work.runner,
               [&work](const auto& goal, auto& result, Progress* progress) {
                 work.incise(goal, result, "actions/incise", progress);
               }),
        step(handle, "step", queues.step, work.runner,
             [&work](const auto& goal, auto& result, Progress* progress) {
               work.step(goal, result, "actions/step", progress);
             }),
        spawn(handle, "spawn", queues.spawn, work.runner, [&work](const auto& goal, auto& result, Progress* progress) {
          work.spawn(goal, result, "actions/spawn", progress);
        }) {
    spinner.start();
  }

  void end() {
    cut.end();
    incise.end();
    step.end();
    spawn.end();
    for (const auto& last : {cut.lastAnswer(), incise.lastAnswer(), step.lastAnswer(), spawn.lastAnswer()})
      if (last) std::this_thread::sleep_until(*last + kSendingTime);
  }

  ros::CallbackQueue goals;
  ros::NodeHandle handle;
  Server<meshless_surgery::CutAction> cut;
  Server<meshless_surgery::InciseAction> incise;
  Server<meshless_surgery::StepAction> step;
  Server<meshless_surgery::SpawnAction> spawn;
  ros::AsyncSpinner spinner{1, &goals};
};

Actions::Actions(const ros::NodeHandle& private_handle, const LongWork& work, const Queues& queues)
    : servers_(std::make_unique<Servers>(private_handle, work, queues)) {}

Actions::~Actions() = default;

void Actions::end() { servers_->end(); }

}  // namespace meshless
