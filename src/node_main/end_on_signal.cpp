#include "end_on_signal.h"

#include <unistd.h>

#include <chrono>
#include <cstring>

#include <ros/ros.h>

namespace meshless {
namespace {

constexpr std::chrono::seconds kLongestEnd(8);  // roslaunch waits 15 s before it kills
constexpr std::chrono::seconds kLongestStart(1);
constexpr long kPoll = 50000000;  // [ns] between looks at what the master asks for

}  // namespace

EndOnSignal::EndOnSignal() {
  sigemptyset(&signals_);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals_, signal);
  pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  thread_ = std::thread([this] { listen(); });
}

EndOnSignal::~EndOnSignal() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    over_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void EndOnSignal::wait() {
  std::unique_lock<std::mutex> lock(mutex_);
  started_ = true;
  changed_.notify_all();
  changed_.wait(lock, [this] { return ending_; });
}

void EndOnSignal::listen() {
  const timespec poll{0, kPoll};
  while (true) {
    // roscpp shuts down by itself where another node takes this one's name, or `rosnode kill` asks for it.
    if (sigtimedwait(&signals_, nullptr, &poll) > 0 || (ros::isInitialized() && ros::isShuttingDown())) break;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (over_) return;
  }
  std::unique_lock<std::mutex> lock(mutex_);
  ending_ = true;
  changed_.notify_all();
  if (!started_) {
    lock.unlock();
    ros::requestShutdown();  // also ends waiting for a master
    lock.lock();
    changed_.wait_for(lock, kLongestStart, [this] { return over_ || started_; });
  }
  if (started_) changed_.wait_for(lock, kLongestEnd, [this] { return over_; });
  if (over_) return;
  const char* why = started_
                        ? "not all has ended in time, such as a body that is being prepared: the node ends without it\n"
                        : "the node ends before its scene is ready\n";
  (void)!write(STDERR_FILENO, why, std::strlen(why));
  _exit(1);
}

}  // namespace meshless
