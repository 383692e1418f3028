// The node's actions: long work with feedback, that can be cancelled. Any number of goals at a time.
#pragma once

#include <memory>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include "long_work.h"

namespace meshless {

class Actions {
 public:
  /// Where goals wait for a thread, together with the calls of the services.
  struct Queues {
    ros::CallbackQueue& cut;  // incisions, too
    ros::CallbackQueue& step;
    ros::CallbackQueue& spawn;
  };
  /// `work` and the queues outlive it, the threads of the queues do not.
  Actions(const ros::NodeHandle& private_handle, const LongWork& work, const Queues& queues);
  ~Actions();

  /// After the runner has stopped: takes no more goals, and aborts those that have not begun. Waits a moment for the
  /// answers of the others, and until all answers have been sent.
  void end();

 private:
  struct Servers;
  std::unique_ptr<Servers> servers_;
};

}  // namespace meshless
