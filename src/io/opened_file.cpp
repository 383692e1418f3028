#include "opened_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <new>

#include "descriptor.h"

namespace meshless {
namespace {

Descriptor opened(const std::string& path, int flags) {
  return Descriptor(::open(path.c_str(), flags | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK));
}

std::string accepted(std::uint64_t most_bytes) {
  return "; accepted: up to " + std::to_string(most_bytes) + " (" + std::to_string(most_bytes >> 20) + " MiB)";
}

}  // namespace

FileKind fileKind(const std::string& real_path) {
  const Descriptor file = opened(real_path, O_PATH);
  struct stat info {};
  if (!file.liesAt(real_path) || ::fstat(file.get(), &info) != 0) return FileKind::kElsewhere;
  return S_ISREG(info.st_mode) ? FileKind::kRegular : FileKind::kOther;
}

Result<FileBytes> readFile(const std::string& real_path, std::uint64_t most_bytes) {
  const auto unreadable = [](const std::string& what) { return Error{ErrorCode::kUnreadable, what}; };
  const Descriptor file = opened(real_path, O_RDONLY);
  struct stat info {};
  if (!file.liesAt(real_path) || ::fstat(file.get(), &info) != 0)
    return unreadable("is missing, cannot be opened, or was replaced meanwhile");
  if (!S_ISREG(info.st_mode)) return unreadable("is no file; accepted: a regular file");
  const auto size = static_cast<std::uint64_t>(info.st_size);
  if (size > most_bytes) return unreadable("has " + std::to_string(size) + " bytes" + accepted(most_bytes));

  // Not set to zero first: that alone would take as long as reading.
  std::unique_ptr<char[]> bytes(new (std::nothrow) char[size + 1]);
  if (!bytes)
    return Error{ErrorCode::kFailed, "has " + std::to_string(size) + " bytes, and there is no memory for them"};
  std::size_t have = 0;
  while (have < size) {
    const ssize_t got = ::read(file.get(), bytes.get() + have, size - have);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return unreadable(std::string("cannot be read: ") + std::strerror(errno));
    if (got == 0) break;  // it became shorter
    have += static_cast<std::size_t>(got);
  }
  return FileBytes(std::move(bytes), have);
}

}  // namespace meshless
