#include "node_link.h"

#include <chrono>

#include <QMetaObject>

namespace meshless {

NodeLink::NodeLink(QObject* parent) : QObject(parent), thread_([this] { loop(); }) {}

NodeLink::~NodeLink() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void NodeLink::setNode(const std::string& node) {
  std::string error;
  node_ = ros::names::validate(node, error) && !node.empty() ? ros::names::resolve(node) : "/deformer";
}

void NodeLink::forget(const std::string& name) {
  const std::lock_guard<std::mutex> lock(mutex_);
  clients_.erase(name);
}

void NodeLink::put(double delay, std::function<void()> work) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    jobs_.push_back({delay, std::move(work)});
  }
  changed_.notify_all();
}

void NodeLink::answer(std::function<void()> done) {
  // Queued with this object as its receiver: dropped where it is gone.
  QMetaObject::invokeMethod(this, std::move(done), Qt::QueuedConnection);
}

void NodeLink::loop() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || !jobs_.empty(); });
    if (jobs_.empty()) return;
    Job job = std::move(jobs_.front());
    jobs_.pop_front();
    if (job.delay > 0.0)
      changed_.wait_for(lock, std::chrono::duration<double>(job.delay), [this] { return stopping_; });
    lock.unlock();
    job.work();
    lock.lock();
  }
}

}  // namespace meshless
