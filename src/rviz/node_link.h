// The node that a tool or the panel acts on. Its services are called by a thread of their own, one after the other, so
// that nothing in the GUI waits; answers come back in the GUI's thread.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include <ros/ros.h>
#include <QObject>

namespace meshless {

class NodeLink : public QObject {
 public:
  explicit NodeLink(QObject* parent);
  /// Does what is still to be done, without its delays: what a tool holds is let go.
  ~NodeLink() override;

  /// The node's name, such as /deformer. A remapping of this very name is followed: a launch file for a station moves
  /// every tool of a view with one line.
  void setNode(const std::string& node);
  const std::string& node() const { return node_; }
  std::string nameOf(const std::string& name) const { return node_ + "/" + name; }

  /// Calls ~name after `delay` [s], once: what was asked may have been done although the answer is lost. `done` runs in
  /// the GUI's thread, unless this link is gone by then. Where the node does not answer, `success` is false and the
  /// message says so; what has become of it ~state and ~events say.
  template <class Service>
  void call(const std::string& name, Service service, std::function<void(const typename Service::Response&)> done = {},
            double delay = 0.0) {
    const std::string full = nameOf(name);
    put(delay, [this, full, service = std::move(service), done = std::move(done)]() mutable {
      if (!clientOf<Service>(full).call(service)) {
        forget(full);  // a persistent connection does not come back by itself
        service.response = typename Service::Response();
        service.response.success = false;
        service.response.message = full + " does not answer: does the node run?";
      }
      if (done) answer([done, response = service.response] { done(response); });
    });
  }

  ros::NodeHandle& handle() { return handle_; }

 private:
  struct Job {
    double delay = 0.0;  // [s]
    std::function<void()> work;
  };

  template <class Service>
  ros::ServiceClient clientOf(const std::string& name) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ros::ServiceClient& client = clients_[name];
    if (!client.isValid()) client = handle_.serviceClient<Service>(name, true);
    return client;
  }
  void forget(const std::string& name);
  void put(double delay, std::function<void()> work);
  void answer(std::function<void()> done);
  void loop();

  std::string node_;
  ros::NodeHandle handle_;  // the global queue, which rviz serves in the GUI's thread
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  std::map<std::string, ros::ServiceClient> clients_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace meshless
