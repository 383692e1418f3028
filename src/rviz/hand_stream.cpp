#include "hand_stream.h"

#include <chrono>
#include <utility>

namespace meshless {
namespace {

constexpr std::chrono::milliseconds kSayAgain(100);

}  // namespace

HandStream::HandStream() : thread_([this] { loop(); }) {}

HandStream::~HandStream() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void HandStream::say(std::function<void()> publish) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    publish_ = std::move(publish);
    publish_();
  }
  changed_.notify_one();
}

void HandStream::hush() {
  const std::lock_guard<std::mutex> lock(mutex_);
  publish_ = nullptr;
}

void HandStream::loop() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    if (!publish_) {
      changed_.wait(lock);
    } else if (changed_.wait_for(lock, kSayAgain) == std::cv_status::timeout && publish_) {
      publish_();
    }
  }
}

}  // namespace meshless
