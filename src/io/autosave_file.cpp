#include "meshless_surgery/io/autosave_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <sstream>
#include <thread>

namespace meshless {
namespace {

constexpr int kMostProcesses = 9;     // processes with autosaves of one name
constexpr int kMostAside = 5;         // that are kept of one name
constexpr int kMostTimesTakenUp = 3;  // without anything being written since
constexpr std::size_t kLongestNode = 64, kKeptOfLong = 46;
constexpr std::chrono::milliseconds kLookAgain{50};
const std::string kState = ".state", kBefore = ".before";

std::string hex(std::uint64_t value, int digits) {
  std::string text;
  for (int shift = 4 * (digits - 1); shift >= 0; shift -= 4) text += "0123456789abcdef"[value >> shift & 15];
  return text;
}

/// FNV-1a; the same in every build.
std::uint64_t hashOf(const std::string& text) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return hash;
}

}  // namespace

// '/' becomes '-', which names of nodes cannot have; what they cannot have either is spelled, so that even then no two
// are the same. "..": only where a name was shortened.
std::string autosaveNameOf(const std::string& node_name) {
  std::string core;
  for (const char c : node_name.substr(node_name.find_first_not_of('/') == 1 ? 1 : 0)) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    if (plain)
      core += c;
    else
      core += c == '/' ? "-" : "." + hex(static_cast<unsigned char>(c), 2);
  }
  if (core.size() > kLongestNode) core = core.substr(0, kKeptOfLong) + ".." + hex(hashOf(core), 16);
  return kAutosavePrefix + core + kState;
}

std::string AutosaveFile::numbered(int number) const {
  return number == 1 ? base_ : base_ + "." + std::to_string(number);
}

std::optional<AutosaveFile::FileId> AutosaveFile::idOf(const std::string& name) const {
  struct stat info {};
  if (::lstat((folder_.folder() + "/" + name).c_str(), &info) != 0) return std::nullopt;
  return FileId{info.st_ino, std::int64_t{info.st_mtim.tv_sec} * 1000000000 + info.st_mtim.tv_nsec};
}

AutosaveFile::Note AutosaveFile::parse(const std::string& text) {
  Note note;
  std::istringstream in(text);
  if (!(in >> note.process >> note.times_taken_up >> note.file.inode >> note.file.changed)) note.times_taken_up = 0;
  note.times_taken_up = std::max(0, note.times_taken_up);  // else a state that kills would be taken up for ever
  return note;
}

// Without room on the disk only the count is lost.
void AutosaveFile::note(int times_taken_up, const FileId& file) const {
  (void)lock_.setText(std::to_string(::getpid()) + " " + std::to_string(times_taken_up) + " " +
                      std::to_string(file.inode) + " " + std::to_string(file.changed) + "\n");
}

Result<bool> AutosaveFile::tryName(int number) {
  name_ = numbered(number);
  const Result<bool> taken = lock_.take(lockPath(name_));
  if (taken.ok() && *taken) before_ = parse(lock_.text());
  return taken;
}

Result<SavedWorldPtr> AutosaveFile::readState(const std::string& name, const std::string& origin) const {
  const auto bytes = folder_.read(name, kMostStateBytes, kStateHeaderBytes, checkStateHeader);
  if (!bytes.ok()) return bytes.error();
  const auto decoded = decode(*bytes);
  if (!decoded.ok()) return decoded.error();
  if (decoded->origin != origin) return Error{ErrorCode::kFailed, "it is of another scene or launch"};
  return decoded->world;
}

// A node that had to go on under another name, and was killed, finds its own there.
bool AutosaveFile::findOwn(const std::string& origin) {
  for (int number = 1; number <= kMostProcesses; ++number) {
    if (!folder_.has(numbered(number))) continue;
    const Result<bool> taken = tryName(number);
    if (!taken.ok() || !*taken) continue;
    if (readState(name_, origin).ok()) return true;
    if (lock_.text().empty())
      lock_.remove();  // it was made just now
    else
      lock_.letGo();
  }
  return false;
}

// Where the master shuts an older node of the same name down, that one needs a moment to put its things in order.
Status AutosaveFile::takeName(std::chrono::milliseconds patience, const Say& say) {
  const auto end = std::chrono::steady_clock::now() + patience;
  Result<bool> taken = tryName(1);
  const auto holder = [&] {
    return "the autosave " + base_ + " in " + folder_.folder() + " is that of process " +
           std::to_string(parse(FileLock::textOf(lockPath(base_))).process) + ", which runs";
  };
  if (taken.ok() && !*taken) say(holder() + "; waiting for its end");
  while (taken.ok() && !*taken && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(kLookAgain);
    taken = tryName(1);
  }
  if (taken.ok() && *taken) return Done{};
  const std::string why = taken.ok() ? holder() : taken.error().detail;
  for (int number = 2; number <= kMostProcesses; ++number) {
    const Result<bool> other = tryName(number);
    if (!other.ok() || !*other) continue;
    say(why + "; this node's autosave is " + name_);
    return Done{};
  }
  return Error{ErrorCode::kFailed, why + "; no other name is free"};
}

Result<SavedWorldPtr> AutosaveFile::claim(const std::string& origin, std::chrono::milliseconds patience,
                                          const Say& say) {
  if (const Status made = folder_.make(); !made.ok()) return made.error();
  if (!findOwn(origin)) {
    const Status taken = takeName(patience, say);
    if (!taken.ok()) return taken.error();
  }
  return takeUp(origin, say);
}

Result<SavedWorldPtr> AutosaveFile::takeUp(const std::string& origin, const Say& say) {
  const std::optional<FileId> there = idOf(name_);
  int times = 0;
  if (there && before_.file == *there) times = before_.times_taken_up;
  SavedWorldPtr state;
  if (there) {
    Result<SavedWorldPtr> read = readState(name_, origin);
    if (read.ok() && times >= kMostTimesTakenUp)
      read = Error{ErrorCode::kFailed, "it was taken up " + std::to_string(times) +
                                           " times, and each time the node died before it wrote another one"};
    if (read.ok()) {
      state = *read;
      own_ = there;
      ++times;
    } else {
      const std::string why =
          "the autosave " + name_ + " in " + folder_.folder() + " is not taken up: " + read.error().detail + "; ";
      const Result<std::string> aside = setAside();
      // It would be overwritten.
      if (!aside.ok()) return Error{aside.error().code, why + "nor can it be set aside: " + aside.error().detail};
      say(why + "it is kept as " + *aside);
      times = 0;
    }
  }
  note(times, there.value_or(FileId{}));
  return state;
}

// The oldest goes where there are too many.
Result<std::string> AutosaveFile::setAside() const {
  std::string aside;
  std::optional<FileId> oldest;
  for (int number = 1; number <= kMostAside; ++number) {
    const std::string name = name_ + kBefore + (number == 1 ? "" : "." + std::to_string(number));
    const std::optional<FileId> there = idOf(name);
    if (there && oldest && there->changed >= oldest->changed) continue;
    aside = name;
    if (!there) break;
    oldest = there;
  }
  const Status moved = folder_.rename(name_, aside);
  if (!moved.ok()) return moved.error();
  return aside;
}

Status AutosaveFile::write(std::string_view bytes) {
  if (!lock_.inPlace()) {  // somebody has cleared the folder
    if (const Status made = folder_.make(); !made.ok()) return made;
    FileLock again;
    const Result<bool> taken = again.take(lockPath(name_));
    if (!taken.ok()) return taken.error();
    if (!*taken)
      return Error{ErrorCode::kFailed, "'" + lockPath(name_) + "' was removed, and is another process's now"};
    lock_ = std::move(again);
    own_.reset();
    note(0, FileId{});
  }
  const std::optional<FileId> before = idOf(name_);
  Status written = folder_.write(name_, bytes);
  const std::optional<FileId> after = idOf(name_);
  if (written.ok() || (after && !(before && *before == *after))) own_ = after;
  return written;
}

void AutosaveFile::remove() {
  if (lock_.inPlace() && own_ && idOf(name_) == own_) folder_.remove(name_);
  lock_.remove();
  own_.reset();
}

// A node that did not come to start has not worked with the state: its attempt does not count.
void AutosaveFile::giveBack() {
  if (!lock_.held()) return;
  if (kept_) return lock_.letGo();
  if (!folder_.has(name_)) return lock_.remove();
  note(before_.times_taken_up, before_.file);
  lock_.letGo();
}

}  // namespace meshless
