// The node's services: checks at the border, one command each, an answer that always says why.
#pragma once

#include <memory>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

#include "body_loader.h"
#include "frames.h"
#include "live_training.h"
#include "rejections.h"
#include "runner.h"
#include "session.h"
#include "streamed_tools.h"

namespace meshless {

class Services {
 public:
  /// Services that may wait (cut, step, spawn, save and load) have threads of their own: a waiting one holds nobody
  /// else up.
  Services(const ros::NodeHandle& private_handle, WorldRunner& runner, Frames& frames, const BodyLoader& loader,
           Rejections& rejections, Session& session, const StreamedTools& tools, const LiveTraining& training);
  ~Services();

 private:
  struct Handlers;
  std::unique_ptr<Handlers> handlers_;
};

}  // namespace meshless
