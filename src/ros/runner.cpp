#include "runner.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <sstream>

namespace meshless {
namespace {

using Phase = Progress::Phase;
using SteadyClock = std::chrono::steady_clock;

double wallSeconds() { return std::chrono::duration<double>(SteadyClock::now().time_since_epoch()).count(); }

constexpr double kWindow = 1.0;           // [s] that rates are taken over
constexpr double kOverBudgetEvery = 1.0;  // [s] between two events
constexpr double kSayTimeEvery = 0.1;     // [s] between two times that are put into the log

constexpr std::chrono::milliseconds kTellEvery(50);

Error stoppedError() { return {ErrorCode::kFailed, "the node is shutting down"}; }
Error cancelledError(const std::string& when) { return {ErrorCode::kFailed, "cancelled " + when}; }

/// What comes later, telling meanwhile how far it is.
template <class Value>
Value awaited(std::future<Value>& later, Progress* progress) {
  while (progress != nullptr && later.wait_for(kTellEvery) != std::future_status::ready) progress->tell();
  return later.get();
}

}  // namespace

WorldRunner::WorldRunner(std::unique_ptr<World> world, const RunnerSettings& settings, const Clock& clock)
    : world_(std::move(world)),
      dt_(1.0 / world_->settings().step_rate),
      settings_(settings),
      clock_(clock),
      paused_(settings.paused),
      world_settings_(world_->settings()) {
  status_.paused = paused_;
}

WorldRunner::~WorldRunner() { stop(); }

void WorldRunner::start() {
  started_ = wallSeconds();
  epoch_ = std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count() - started_;
  due_ = clock_.now();
  thread_ = std::thread([this] { loop(); });
}

void WorldRunner::stop() {
  {
    const std::lock_guard<std::mutex> lock(jobs_mutex_);
    stopping_ = true;
  }
  jobs_changed_.notify_all();
  if (thread_.joinable()) thread_.join();
  std::deque<std::shared_ptr<Waiting>> left;
  {
    const std::lock_guard<std::mutex> lock(jobs_mutex_);
    stopped_ = true;
    left.swap(jobs_);
  }
  for (const auto& waiting : left) waiting->done.set_value(stoppedError());
  giveUp(stoppedError().detail);
}

Status WorldRunner::run(Job job, bool changes) {
  auto waiting = std::make_shared<Waiting>();
  waiting->job = std::move(job);
  waiting->changes = changes;
  auto done = waiting->done.get_future();
  {
    const std::lock_guard<std::mutex> lock(jobs_mutex_);
    if (stopping_) return stoppedError();
    jobs_.push_back(std::move(waiting));
  }
  jobs_changed_.notify_all();
  return done.get();
}

void WorldRunner::post(Job job) {
  auto waiting = std::make_shared<Waiting>();
  waiting->job = std::move(job);
  waiting->waited_for = false;
  {
    const std::lock_guard<std::mutex> lock(jobs_mutex_);
    if (stopping_) return;
    jobs_.push_back(std::move(waiting));
  }
  jobs_changed_.notify_all();
}

Status WorldRunner::look(const Job& job) { return run(job, false); }

Result<Reply> WorldRunner::apply(const Command& command, Progress* progress) {
  Result<Reply> reply = stoppedError();
  const Status done = run(
      [&](World& world) {
        if (progress != nullptr && !progress->begin()) {
          reply = cancelledError("before it began");
          return;
        }
        if (progress != nullptr)
          progress->enter(std::holds_alternative<SpawnCommand>(command) ? Phase::kAdding : Phase::kCutting);
        reply = world.apply(command);
      },
      true);
  if (!done.ok()) return done.error();
  return reply;
}

Result<WorldRunner::CutAnswer> WorldRunner::cut(CutCommand command, Progress* progress) {
  CutAnswer answer;
  std::optional<Error> error;
  std::future<Result<CutReply>> later;
  const Status done = run(
      [&](World& world) {
        if (progress != nullptr && !progress->begin()) {
          error = cancelledError("before it began");
          return;
        }
        answer.closed_at_once = paused_ && command.close_time > 0.0;
        if (paused_) command.close_time = 0.0;
        if (command.close_time > 0.0 && closing_.size() >= static_cast<std::size_t>(kMostClosing)) {
          error = Error{ErrorCode::kFailed,
                        std::to_string(closing_.size()) + " cuts wait for their blades; accepted: up to " +
                            std::to_string(kMostClosing) +
                            " at once, and any number with close_time 0 (open_scissors ends those that wait)"};
          return;
        }
        if (progress != nullptr) progress->enter(command.close_time > 0.0 ? Phase::kClosing : Phase::kCutting);
        auto reply = world.apply(command);
        if (!reply.ok()) {
          error = reply.error();
        } else if (const auto* started = std::get_if<CutStarted>(&*reply)) {
          closing_.emplace_back();
          closing_.back().ticket = started->ticket;
          closing_.back().progress = progress;
          closing_.back().begin = world.simTime();
          closing_.back().close_time = command.close_time;
          later = closing_.back().done.get_future();
        } else if (auto* cut = std::get_if<CutReply>(&*reply)) {
          if (progress != nullptr) progress->close(1.0);
          answer.reply = std::move(*cut);
        }
      },
      true);
  if (!done.ok()) return done.error();
  if (error) return *error;
  if (later.valid()) {
    auto reply = awaited(later, progress);
    if (!reply.ok()) return reply.error();
    answer.reply = std::move(*reply);
  }
  return answer;
}

std::string WorldRunner::OwedSteps::doneSoFar() const {
  return std::to_string(total - left) + " of " + std::to_string(total) + " steps were done";
}

Result<double> WorldRunner::doSteps(std::uint64_t count, Progress* progress) {
  std::future<Result<double>> later;
  const Status done = run(
      [&](World&) {
        if (progress != nullptr && !progress->begin()) return;
        owed_.emplace_back();
        owed_.back().progress = progress;
        owed_.back().total = owed_.back().left = count;
        later = owed_.back().done.get_future();
      },
      false);
  if (!done.ok()) return done.error();
  if (!later.valid()) return cancelledError("before it began");
  return awaited(later, progress);
}

void WorldRunner::endCancelled() {
  post([this](World& world) {
    for (ClosingCut& cut : closing_) {
      if (cut.progress == nullptr || !cut.progress->cancelled()) continue;
      if (!world.apply(OpenBladesCommand{cut.ticket}).ok()) continue;
      (void)world.finishedCut(cut.ticket);  // instead of its answer
      cut.progress->end();
      cut.done.set_value(cancelledError("before the blades met"));
      cut.ticket = 0;
    }
    closing_.erase(
        std::remove_if(closing_.begin(), closing_.end(), [](const ClosingCut& cut) { return cut.ticket == 0; }),
        closing_.end());
    for (OwedSteps& owed : owed_) {
      if (owed.progress == nullptr || !owed.progress->cancelled()) continue;
      owed.progress->end();
      owed.done.set_value(cancelledError("when " + owed.doneSoFar()));
      owed.total = 0;
    }
    owed_.erase(std::remove_if(owed_.begin(), owed_.end(), [](const OwedSteps& owed) { return owed.total == 0; }),
                owed_.end());
  });
}

Result<std::uint64_t> WorldRunner::setPaused(bool paused) {
  std::uint64_t step = 0;
  const Status done = run(
      [&](World& world) {
        if (paused_ && !paused) due_ = clock_.now();
        paused_ = paused;
        if (paused) sayTime(false);
        step = world.stepCount();
        if (!paused) mended();
        const std::lock_guard<std::mutex> lock(status_mutex_);
        status_.paused = paused;
      },
      true);
  if (!done.ok()) return done.error();
  return step;
}

Status WorldRunner::reset() {
  return run(
      [&](World& world) {
        world.reset();
        answerCuts();
        giveUp("the world was reset meanwhile");
        mended();
        due_ = clock_.now();
      },
      true);
}

Status WorldRunner::restore(std::shared_ptr<const SavedWorld> saved, const Job& then) {
  return change([&](World& world) {
    world.restore(*saved);
    then(world);
  });
}

Status WorldRunner::change(const Job& job) {
  return run(
      [&](World& world) {
        job(world);
        answerCuts();
        giveUp("another state was loaded meanwhile");
        mended();
        due_ = clock_.now();
        dt_ = 1.0 / world.settings().step_rate;
        const std::lock_guard<std::mutex> lock(status_mutex_);
        world_settings_ = world.settings();
      },
      true);
}

WorldSettings WorldRunner::worldSettings() const {
  const std::lock_guard<std::mutex> lock(status_mutex_);
  return world_settings_;
}

std::shared_ptr<const WorldSnapshot> WorldRunner::snapshot(const SnapshotWants& wants) {
  auto taken = std::make_shared<WorldSnapshot>();
  const Status done = run([&](World& world) { *taken = world.snapshot(wants); }, false);
  if (!done.ok()) return nullptr;
  return taken;
}

RunnerStatus WorldRunner::status() const {
  const double now = wallSeconds();
  const std::lock_guard<std::mutex> lock(status_mutex_);
  RunnerStatus status = status_;
  const double window = std::min(kWindow, std::max(now - started_, 1e-9));
  double simulated = 0.0;
  double busy = 0.0;
  std::size_t steps = 0;
  for (const Sample& sample : samples_) {
    if (sample.wall < now - window) continue;
    ++steps;
    simulated += sample.sim;
    busy += sample.step;
    status.worst_step = std::max(status.worst_step, sample.step);
  }
  status.step_rate = static_cast<double>(steps) / window;
  status.real_time_factor = simulated / window;
  status.mean_step = steps > 0 ? busy / static_cast<double>(steps) : 0.0;
  return status;
}

void WorldRunner::loop() {
  while (true) {
    doJobs();
    handOverEvents();
    {
      const std::lock_guard<std::mutex> lock(jobs_mutex_);
      if (stopping_) return;
    }
    if (!owed_.empty()) {
      stepOnce(false);
      due_ = std::max(due_, clock_.now());  // what they took is no backlog
      if (owed_.empty()) continue;          // the step failed
      OwedSteps& owed = owed_.front();
      --owed.left;
      if (owed.progress != nullptr) {
        owed.progress->enter(Phase::kStepping);
        owed.progress->step(owed.total - owed.left, world_->simTime());
      }
      if (owed.left == 0) {
        owed.done.set_value(world_->simTime());
        owed_.pop_front();
      }
      continue;
    }
    if (paused_) {
      std::unique_lock<std::mutex> lock(jobs_mutex_);
      jobs_changed_.wait(lock, [this] { return stopping_ || !jobs_.empty(); });
      continue;
    }
    if (clock_.now() < due_) {
      sleepUntil(due_);
      continue;
    }
    const double before = wallSeconds();
    stepOnce(true);
    const double took = wallSeconds() - before;
    due_ += dt_ / speed_;
    const double late = clock_.now() - due_ - settings_.max_backlog;
    {
      const std::lock_guard<std::mutex> lock(status_mutex_);
      if (took > dt_) ++status_.overruns;
      if (late > 0.0) status_.dropped += late;
    }
    if (late > 0.0) due_ += late;
    if (took > dt_ && before - last_over_budget_ > kOverBudgetEvery) {
      last_over_budget_ = before;
      std::ostringstream text;
      text << "a step took " << 1e3 * took << " ms for " << 1e3 * dt_ << " ms of simulated time; " << status().overruns
           << " steps did so far";
      Event event;
      event.type = EventType::kOverBudget;
      event.step = world_->stepCount();
      event.sim_time = world_->simTime();
      event.text = text.str();
      own_events_.push_back(std::move(event));
    }
  }
}

void WorldRunner::doJobs() {
  std::deque<std::shared_ptr<Waiting>> jobs;
  {
    const std::lock_guard<std::mutex> lock(jobs_mutex_);
    jobs.swap(jobs_);
  }
  for (const auto& waiting : jobs) {
    Status done = Done{};
    try {
      waiting->job(*world_);
    } catch (const std::exception& e) {
      done = Error{ErrorCode::kFailed, std::string("internal fault: ") + e.what()};
    }
    if (waiting->changes) {
      ++revision_;
      if (waiting->waited_for) ++commands_;
      if (step_sink_) step_sink_(*world_, 0.0);
    }
    answerCuts();
    // Events first: who waits for the answer finds them under way.
    handOverEvents();
    waiting->done.set_value(done);
  }
}

void WorldRunner::sayTime(bool paced) {
  if (!says_time_ || (!paced && std::isnan(said_time_))) return;
  const double now = epoch_ + wallSeconds();  // a clock that is set does not matter
  if (paced && now < said_time_ + kSayTimeEvery) return;
  said_time_ = paced ? now : std::numeric_limits<double>::quiet_NaN();
  world_->setWallTime(said_time_);
}

void WorldRunner::stepOnce(bool paced) {
  const double before = wallSeconds();
  tellCuts();
  try {
    sayTime(paced);
    if (!step_(*world_)) return pauseAtEnd();
    ++revision_;
    if (!paced) ++commands_;
    handOverEvents();
    if (step_sink_) step_sink_(*world_, dt_);
  } catch (const std::exception& e) {
    ++revision_;
    fail(e.what());
  }
  record(wallSeconds() - before);
  answerCuts();
}

void WorldRunner::pauseAtEnd() {
  paused_ = true;
  giveUp("there are no more steps");
  const std::lock_guard<std::mutex> lock(status_mutex_);
  status_.paused = true;
}

void WorldRunner::tellCuts() {
  for (const ClosingCut& cut : closing_) {
    if (cut.progress == nullptr) continue;
    const double share = (world_->simTime() - cut.begin) / cut.close_time;
    const bool meet = share > 1.0 - 1e-9;  // times are rounded
    cut.progress->close(meet ? 1.0 : std::max(share, 0.0));
    if (meet) cut.progress->enter(Phase::kCutting);
  }
}

void WorldRunner::answerCuts() {
  for (auto closing = closing_.begin(); closing != closing_.end();) {
    auto finished = world_->finishedCut(closing->ticket);
    if (finished) {
      closing->done.set_value(std::move(*finished));
      closing = closing_.erase(closing);
    } else {
      ++closing;
    }
  }
}

void WorldRunner::giveUp(const std::string& why) {
  for (ClosingCut& closing : closing_)
    closing.done.set_value(Error{ErrorCode::kFailed, "the cut was given up: " + why});
  closing_.clear();
  for (OwedSteps& owed : owed_) {
    owed.done.set_value(Error{ErrorCode::kFailed, owed.doneSoFar() + ": " + why});
  }
  owed_.clear();
}

void WorldRunner::handOverEvents() {
  std::vector<Event> events = world_->takeEvents();
  events.insert(events.end(), std::make_move_iterator(own_events_.begin()), std::make_move_iterator(own_events_.end()));
  own_events_.clear();
  if (!events.empty() && event_sink_) event_sink_(std::move(events));
}

void WorldRunner::sleepUntil(double due) {
  std::unique_lock<std::mutex> lock(jobs_mutex_);
  const double wait = clock_.wallUntil(due);
  if (!(wait > 0.0)) return;
  jobs_changed_.wait_for(lock, std::chrono::duration<double>(wait), [this] { return stopping_ || !jobs_.empty(); });
}

void WorldRunner::record(double step_time) {
  const double now = wallSeconds();
  const std::lock_guard<std::mutex> lock(status_mutex_);
  ++status_.steps;
  samples_.push_back({now, dt_, step_time});
  while (samples_.front().wall < now - kWindow) samples_.pop_front();
}

void WorldRunner::mended() {
  const std::lock_guard<std::mutex> lock(status_mutex_);
  status_.fault.clear();
}

void WorldRunner::fail(const std::string& what) {
  paused_ = true;
  const std::string why = "a step failed (" + what + "); the world is paused";
  {
    const std::lock_guard<std::mutex> lock(status_mutex_);
    status_.paused = true;
    status_.fault = why;
  }
  giveUp(why);
  Event event;
  event.type = EventType::kFault;
  event.step = world_->stepCount();
  event.sim_time = world_->simTime();
  event.text = why;
  own_events_.push_back(std::move(event));
}

}  // namespace meshless
