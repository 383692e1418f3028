// Input that was refused, for the diagnostics.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

namespace meshless {

class Rejections {
 public:
  void count(const std::string& where, const std::string& why) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++total_;
    ++by_name_[where];
    last_ = where + ": " + why;
  }
  struct Summary {
    std::uint64_t total = 0;
    std::map<std::string, std::uint64_t> by_name;  // service or topic
    std::string last;
  };
  Summary summary() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return {total_, by_name_, last_};
  }

 private:
  mutable std::mutex mutex_;
  std::uint64_t total_ = 0;
  std::map<std::string, std::uint64_t> by_name_;
  std::string last_;
};

}  // namespace meshless
