// The node. Everything that it offers is private to its name; see docs/interface.md.
#include <csignal>

#include <malloc.h>
#include <ros/ros.h>

#include "end_on_signal.h"
#include "meshless_surgery/ros/node.h"

constexpr int kKeptPiece = 8 << 20;  // bytes
constexpr int kThreads = 16;         // some of which may wait for a transform; see Frames

int main(int argc, char** argv) {
  // Memory that a cut has used is kept for the next one: fetching it anew costs more than the cut. Larger pieces are
  // those of requests of many megabytes: kept, each thread would hold on to the largest that it has had.
  mallopt(M_MMAP_THRESHOLD, kKeptPiece);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  // A disk quota must refuse, not kill.
  std::signal(SIGXFSZ, SIG_IGN);
  // Before there are other threads, which take over what is blocked.
  meshless::EndOnSignal end;
  ros::init(argc, argv, "deformer", ros::init_options::NoSigintHandler);
  const ros::NodeHandle private_handle("~");
  // Streams and services that answer at once; those that wait have threads of their own.
  ros::AsyncSpinner spinner(kThreads);
  spinner.start();
  auto node = meshless::DeformerNode::start(private_handle);
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
