#include "meshless_surgery/io/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace meshless {
namespace {

constexpr std::size_t kMostText = 200;  // bytes
constexpr int kMostTries = 100;         // against processes that remove the file just then

Error refused(const std::string& what, const std::string& path) {
  return {ErrorCode::kFailed, "cannot " + what + " '" + path + "': " + std::strerror(errno)};
}

bool leadsTo(const std::string& path, int descriptor) {
  struct stat there {
  }, here{};
  return ::lstat(path.c_str(), &there) == 0 && ::fstat(descriptor, &here) == 0 && there.st_ino == here.st_ino &&
         there.st_dev == here.st_dev;
}

std::string textIn(int descriptor) {
  std::string text(kMostText, '\0');
  const ssize_t got = ::pread(descriptor, text.data(), text.size(), 0);
  text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  return text;
}

}  // namespace

FileLock& FileLock::operator=(FileLock&& other) noexcept {
  if (this != &other) {
    letGo();
    descriptor_ = std::exchange(other.descriptor_, -1);
    path_ = std::move(other.path_);
  }
  return *this;
}

Result<bool> FileLock::take(const std::string& path) {
  letGo();
  for (int i = 0; i < kMostTries; ++i) {
    const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0644);
    if (descriptor < 0) return refused("write", path);
    if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
      const int error = errno;
      ::close(descriptor);
      if (error == EINTR) continue;
      if (error == EWOULDBLOCK) return false;
      errno = error;
      return refused("lock", path);
    }
    if (leadsTo(path, descriptor)) {
      descriptor_ = descriptor;
      path_ = path;
      return true;
    }
    ::close(descriptor);  // whoever had it has removed it meanwhile
  }
  return false;
}

bool FileLock::inPlace() const { return held() && leadsTo(path_, descriptor_); }

std::string FileLock::text() const { return held() ? textIn(descriptor_) : std::string(); }

Status FileLock::setText(const std::string& text) const {
  if (!held() || ::pwrite(descriptor_, text.data(), text.size(), 0) != static_cast<ssize_t>(text.size()) ||
      ::ftruncate(descriptor_, static_cast<off_t>(text.size())) != 0)
    return refused("write", path_);
  return Done{};
}

std::string FileLock::textOf(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return "";
  std::string text = textIn(descriptor);
  ::close(descriptor);
  return text;
}

void FileLock::letGo() {
  if (held()) ::close(std::exchange(descriptor_, -1));
}

void FileLock::remove() {
  if (inPlace()) ::unlink(path_.c_str());  // still locked: nobody can have taken it
  letGo();
}

}  // namespace meshless
