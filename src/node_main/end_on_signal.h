/// SIGINT, SIGTERM and SIGHUP end the node in good order, within some seconds whatever it is doing.
#pragma once

#include <csignal>

#include <condition_variable>
#include <mutex>
#include <thread>

namespace meshless {

class EndOnSignal {
 public:
  /// Blocks the signals in this thread and all that it starts from now on.
  EndOnSignal();
  ~EndOnSignal();
  EndOnSignal(const EndOnSignal&) = delete;
  EndOnSignal& operator=(const EndOnSignal&) = delete;

  /// Until a signal came, or ROS has shut down. Before it, while a scene is read or the master is waited for, a signal
  /// ends the process within a second; after it who has not ended within eight seconds, as a body is being prepared, is
  /// ended. The exit status is 1 then; what a session keeps is whole at any time.
  void wait();

 private:
  void listen();

  sigset_t signals_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool started_ = false, ending_ = false, over_ = false;
  std::thread thread_;
};

}  // namespace meshless
