#include "progress.h"

namespace meshless {

bool Progress::cancel() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (cancelled_) return false;
  cancelled_ = true;
  return !begun_;
}

bool Progress::cancelled() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return cancelled_;
}

bool Progress::begin() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (cancelled_) {
    ended_ = true;
    return false;
  }
  begun_ = true;
  return true;
}

bool Progress::finish() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (cancelled_ && !begun_) return false;
  begun_ = true;
  return true;
}

}  // namespace meshless
