// An open file, closed with its owner.
#pragma once

#include <limits.h>
#include <sys/stat.h>
#include <unistd.h>

#include <string>
#include <string_view>
#include <utility>

namespace meshless {

class Descriptor {
 public:
  explicit Descriptor(int descriptor) : descriptor_(descriptor) {}
  ~Descriptor() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int get() const { return descriptor_; }
  /// The errors of a late write come with close.
  bool close() { return ::close(std::exchange(descriptor_, -1)) == 0; }
  /// O_NOFOLLOW looks at the last part of a path alone; the kernel knows where the file lies, or lay before it was
  /// replaced. False where it does not say (no /proc).
  bool liesAt(const std::string& path) const {
    char real[PATH_MAX];
    const std::string link = "/proc/self/fd/" + std::to_string(descriptor_);
    const ssize_t size = descriptor_ < 0 ? -1 : ::readlink(link.c_str(), real, sizeof real);
    if (size < 0 || size >= static_cast<ssize_t>(sizeof real)) return false;
    const std::string_view at(real, static_cast<std::size_t>(size));
    struct stat info {};
    return at == path || (at == path + " (deleted)" && ::fstat(descriptor_, &info) == 0 && info.st_nlink == 0);
  }

 private:
  int descriptor_;
};

}  // namespace meshless
