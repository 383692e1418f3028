/// The main function of a node, whichever: nothing of it may depend on what another one remembers to set up.
#pragma once

#include <csignal>
#include <cstdio>
#include <string>

#include <malloc.h>
#include <ros/ros.h>

#include "end_on_signal.h"

namespace meshless {

/// `Node` has start(private_handle). Returns the exit code.
template <class Node>
int runNode(int argc, char** argv, const char* name) {
  // Before anything waits for a master.
  for (int k = 1; k < argc; ++k)
    if (const std::string option = argv[k]; option == "--help" || option == "-h") {
      std::printf(
          "Usage: %s [__name:=NAME] [_PARAMETER:=VALUE ...]\n\nNeeds a roscore. The parameters of the node '%s' are in "
          "docs/reference/parameters.md.\n",
          argv[0], name);
      return 0;
    }
  constexpr int kKeptPiece = 8 << 20;  // bytes
  constexpr int kThreads = 16;         // some of which may wait for a transform; see Frames
  // Memory that a cut has used is kept for the next one: fetching it anew costs more than the cut. Larger pieces are
  // those of requests of many megabytes: kept, each thread would hold on to the largest that it has had.
  mallopt(M_MMAP_THRESHOLD, kKeptPiece);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  // A disk quota must refuse, not kill.
  std::signal(SIGXFSZ, SIG_IGN);
  // Before there are other threads, which take over what is blocked.
  EndOnSignal end;
  ros::init(argc, argv, name, ros::init_options::NoSigintHandler);
  const ros::NodeHandle private_handle("~");
  // Streams, services that answer at once, and who begins to listen; services that wait have threads of their own.
  ros::AsyncSpinner spinner(kThreads);
  spinner.start();
  auto node = Node::start(private_handle);
  if (!node.ok()) {
    ROS_FATAL_STREAM(node.error().detail);
    ros::shutdown();
    return 1;
  }
  end.wait();
  // While callers can still be answered.
  node->reset();
  spinner.stop();
  ros::shutdown();
  return 0;
}

}  // namespace meshless
