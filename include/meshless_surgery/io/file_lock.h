// A file that one process at a time holds. The kernel lets go of it when the process ends, however it ends.
#pragma once

#include <string>
#include <utility>

#include "meshless_surgery/base/result.h"

namespace meshless {

class FileLock {
 public:
  FileLock() = default;
  ~FileLock() { letGo(); }
  FileLock(FileLock&& other) noexcept { *this = std::move(other); }
  FileLock& operator=(FileLock&& other) noexcept;

  /// Makes the file where it is missing. False: another process (or another FileLock) has it. Errors are the disk's.
  Result<bool> take(const std::string& path);
  bool held() const { return descriptor_ >= 0; }
  /// Held, and nobody has removed or replaced the file since: who looks for it there finds this lock.
  bool inPlace() const;

  /// What the file says, and what it is to say: kept when the lock is let go.
  std::string text() const;
  Status setText(const std::string& text) const;
  static std::string textOf(const std::string& path);

  void letGo();
  /// Lets go, and removes the file.
  void remove();

 private:
  int descriptor_ = -1;
  std::string path_;
};

}  // namespace meshless
