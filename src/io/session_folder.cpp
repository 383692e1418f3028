#include "meshless_surgery/io/session_folder.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>

#include "descriptor.h"
#include "meshless_surgery/io/files.h"

namespace meshless {
namespace {

constexpr std::size_t kLongestName = 100;
constexpr int kMostNumbered = 9999;  // files of one name
const std::string kPart = ".part";   // of files that are being written: .NAME.PROCESS-CALL.part

Error refused(const std::string& what, const std::string& path, int error) {
  return {ErrorCode::kFailed, "cannot " + what + " '" + path + "': " + std::strerror(error)};
}

/// The process in the name of a file that is being written; 0 of any other file.
long writerOf(const std::string& name) {
  if (name.size() <= kPart.size() || name.front() != '.' ||
      name.compare(name.size() - kPart.size(), kPart.size(), kPart) != 0)
    return 0;
  const std::size_t dash = name.rfind('-');
  const std::size_t dot = dash == std::string::npos ? dash : name.rfind('.', dash);
  if (dot == std::string::npos || dot == 0 || dash - dot > 10) return 0;
  const std::string digits = name.substr(dot + 1, dash - dot - 1);
  if (digits.empty() || digits.find_first_not_of("0123456789") != std::string::npos) return 0;
  return std::stol(digits);
}

/// Closed when it goes out of scope.
/// Reads on until there are so many, or the file ends. False: errno says why.
bool readUpTo(int descriptor, std::string& bytes, std::size_t size) {
  std::size_t have = bytes.size();
  bytes.resize(size);
  while (have < size) {
    const ssize_t got = ::read(descriptor, bytes.data() + have, size - have);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return false;
    if (got == 0) break;
    have += static_cast<std::size_t>(got);
  }
  bytes.resize(have);
  return true;
}

}  // namespace

Status writeAll(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return Error{ErrorCode::kFailed, std::strerror(errno)};
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return Done{};
}

Status SessionFolder::checkName(const std::string& name, const std::string& field) {
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
           c == '-';
  };
  if (!name.empty() && name.size() <= kLongestName && name.front() != '.' &&
      std::all_of(name.begin(), name.end(), plain))
    return Done{};
  std::string shown = name.substr(0, kLongestName);
  std::replace_if(
      shown.begin(), shown.end(), [&](char c) { return !plain(c) && c != '/' && c != ' '; }, '?');
  return Error{ErrorCode::kInvalidArgument, field + " is '" + shown + (name.size() > shown.size() ? "...'" : "'") +
                                                "; accepted: a name of 1 to " + std::to_string(kLongestName) +
                                                " letters, digits and ._- that does not begin with a dot, no path"};
}

Status SessionFolder::make() const {
  if (folder_.empty())
    return Error{ErrorCode::kForbidden, "no session directory is set; accepted: the parameter session_directory"};
  std::error_code failed, none;
  std::filesystem::create_directories(folder_, failed);
  if (!std::filesystem::is_directory(folder_, none))
    return Error{ErrorCode::kFailed, "cannot make the folder '" + folder_ + "'" +
                                         (failed ? ": " + failed.message() : std::string(": it is no folder"))};
  return Done{};
}

Status SessionFolder::write(const std::string& name, std::string_view bytes) const {
  if (Status valid = checkName(name); !valid) return valid;
  if (Status made = make(); !made) return made;
  const std::string path = pathOf(name);
  // Of this process and this call: two who save at once do not mix.
  static std::atomic<unsigned> calls{0};
  const std::string temporary =
      folder_ + "/." + name + "." + std::to_string(::getpid()) + "-" + std::to_string(++calls) + kPart;
  Descriptor file(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0644));
  if (file.get() < 0) return refused("write", path, errno);
  Status written = writeAll(file.get(), bytes);
  if (!written)
    written = Error{ErrorCode::kFailed, "cannot write '" + path + "': " + written.error().detail};
  else if (::fsync(file.get()) != 0)
    written = refused("write", path, errno);
  if (!file.close() && written) written = refused("write", path, errno);
  if (written && ::rename(temporary.c_str(), path.c_str()) != 0) written = refused("write", path, errno);
  if (!written) {
    ::unlink(temporary.c_str());
    return written;
  }
  // The new name itself. Some file systems cannot, and some folders may not be opened: only a disk's fault is one.
  const Descriptor folder(::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  const auto isOfTheDisk = [](int fault) { return fault == EIO || fault == ENOSPC || fault == EDQUOT; };
  if ((folder.get() < 0 || ::fsync(folder.get()) != 0) && isOfTheDisk(errno))
    return Error{ErrorCode::kFailed,
                 "'" + path +
                     "' is written, but may not outlive a power failure: cannot bring the folder to the disk: " +
                     std::strerror(errno)};
  return Done{};
}

Result<std::string> SessionFolder::read(const std::string& name, std::size_t most_bytes, std::size_t beginning_bytes,
                                        const Check& check) const {
  if (Status valid = checkName(name); !valid) return valid.error();
  if (folder_.empty())
    return Error{ErrorCode::kForbidden, "no session directory is set; accepted: the parameter session_directory"};
  FileAccess access;
  access.folders = {folder_};
  const Result<std::string> path = access.resolve(name, folder_);
  if (!path) return path.error();
  // Not a pipe that was put there meanwhile: opening one would wait.
  const Descriptor file(::open(path->c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  struct stat info {};
  if (file.get() < 0 || ::fstat(file.get(), &info) != 0)
    return Error{ErrorCode::kUnreadable, "cannot read '" + name + "': " + std::strerror(errno)};
  if (!file.liesAt(*path))  // a folder on the way was replaced meanwhile
    return Error{ErrorCode::kUnreadable, "there is no file '" + name + "'"};
  if (!S_ISREG(info.st_mode))
    return Error{ErrorCode::kUnreadable, "'" + name + "' is no file; accepted: a regular file"};
  if (static_cast<std::uint64_t>(info.st_size) > most_bytes)
    return Error{ErrorCode::kUnreadable, "'" + name + "' has " + std::to_string(info.st_size) +
                                             " bytes; accepted: up to " + std::to_string(most_bytes)};
  const auto unreadable = [&] {
    return Error{ErrorCode::kUnreadable, "cannot read '" + name + "': " + std::strerror(errno)};
  };
  const auto size = static_cast<std::size_t>(info.st_size);
  std::string bytes;
  if (!readUpTo(file.get(), bytes, std::min(size, beginning_bytes))) return unreadable();
  if (check) {
    const Status accepted = check(bytes, size);
    if (!accepted.ok()) return Error{accepted.error().code, "'" + name + "': " + accepted.error().detail};
  }
  try {
    if (!readUpTo(file.get(), bytes, size)) return unreadable();
  } catch (const std::bad_alloc&) {
    return Error{ErrorCode::kFailed, "there is not enough memory for '" + name + "'"};
  }
  return bytes;
}

bool SessionFolder::beginsWith(const std::string& name, std::string_view text) const {
  if (folder_.empty() || !checkName(name)) return false;
  const Descriptor file(::open(pathOf(name).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  struct stat info {};
  std::string bytes;
  return file.get() >= 0 && ::fstat(file.get(), &info) == 0 && S_ISREG(info.st_mode) &&
         readUpTo(file.get(), bytes, text.size()) && bytes == text;
}

bool SessionFolder::has(const std::string& name) const {
  struct stat info {};
  return !folder_.empty() && ::lstat(pathOf(name).c_str(), &info) == 0;
}

void SessionFolder::remove(const std::string& name) const {
  if (!folder_.empty() && checkName(name)) ::unlink(pathOf(name).c_str());
}

Status SessionFolder::rename(const std::string& from, const std::string& to) const {
  if (Status valid = checkName(from); !valid) return valid;
  if (Status valid = checkName(to); !valid) return valid;
  if (::rename(pathOf(from).c_str(), pathOf(to).c_str()) != 0) return refused("rename", pathOf(from), errno);
  return Done{};
}

void SessionFolder::removeLeftovers() const {
  std::error_code failed;
  for (std::filesystem::directory_iterator entry(folder_, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    const std::string name = entry->path().filename().string();
    const long writer = writerOf(name);
    if (writer > 0 && ::kill(static_cast<pid_t>(writer), 0) != 0 && errno == ESRCH) ::unlink(pathOf(name).c_str());
  }
}

Result<SessionFolder::NewFile> SessionFolder::create(const std::string& name) const {
  if (Status valid = checkName(name); !valid) return valid.error();
  if (Status made = make(); !made) return made.error();
  for (int number = 1; number <= kMostNumbered; ++number) {
    const std::string numbered = number == 1 ? name : name + "." + std::to_string(number);
    const int descriptor =
        ::open(pathOf(numbered).c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW | O_APPEND, 0644);
    if (descriptor >= 0) return NewFile{descriptor, numbered};
    if (errno != EEXIST) return refused("write", pathOf(numbered), errno);
  }
  return Error{ErrorCode::kFailed,
               "there are " + std::to_string(kMostNumbered) + " files '" + pathOf(name) + ".N' already; remove some"};
}

}  // namespace meshless
