// What the hand of a tool says while it holds something: again and again, by a thread of its own. Between two pictures
// more time may pass than the node waits for a stream.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace meshless {

class HandStream {
 public:
  HandStream();
  ~HandStream();

  /// Calls `publish` now, and then on its own thread ten times a second, until there is another one or hush().
  void say(std::function<void()> publish);
  /// Once it returns, nothing is said any more.
  void hush();

 private:
  void loop();

  std::mutex mutex_;  // held while it publishes
  std::condition_variable changed_;
  std::function<void()> publish_;  // none: silent
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace meshless
