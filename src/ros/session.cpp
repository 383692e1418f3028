#include "session.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <utility>

#include <ros/console.h>

#include "meshless_surgery/world/command_log.h"

namespace meshless {
namespace {

constexpr std::chrono::milliseconds kSaveAfterChange{500};     // while time stands still
constexpr std::chrono::milliseconds kWriteEvery{200};          // so much of the log is lost when the node is killed
constexpr std::size_t kWriteAtOnce = 1 << 20;                  // bytes
constexpr std::size_t kMostBuffered = std::size_t{256} << 20;  // bytes that a slow disk may be behind
constexpr double kTryAgainFirst = 0.5, kTryAgainLast = 10.0;   // [s] after an autosave that failed; between: its period
constexpr std::chrono::seconds kPatience{5};                   // with an older node of the same name

bool beginsAsAutosave(const std::string& name) { return name.compare(0, kAutosavePrefix.size(), kAutosavePrefix) == 0; }

}  // namespace

std::string sessionFolderOf(const std::string& session_directory) {
  if (!session_directory.empty()) return session_directory;
  const char* ros_home = std::getenv("ROS_HOME");
  if (ros_home != nullptr && *ros_home != '\0') return std::string(ros_home) + "/meshless_surgery";
  const char* home = std::getenv("HOME");
  return home != nullptr && *home != '\0' ? std::string(home) + "/.ros/meshless_surgery" : std::string();
}

Session::Session(SessionSettings settings)
    : settings_(std::move(settings)), folder_(settings_.folder), autosave_(folder_, settings_.autosave_name) {}

Session::~Session() { stop(); }

Result<std::string> Session::takeUp(World& world) {
  if (!(settings_.autosave_period > 0.0)) return std::string();
  const auto left =
      autosave_.claim(settings_.origin, kPatience, [](const std::string& text) { ROS_WARN_STREAM(text); });
  if (!left.ok()) return left.error();
  if (!*left) return std::string();
  world.restore(**left);
  return "took up the session from the autosave at step " + std::to_string(world.stepCount()) + ", " +
         std::to_string(world.simTime()) + " s";
}

Result<std::string> Session::startLog(World& world) {
  if (settings_.command_log.empty()) return std::string();
  if (beginsAsAutosave(settings_.command_log))
    return Error{ErrorCode::kForbidden, "it is '" + settings_.command_log +
                                            "', as autosaves are named; accepted: a name " +
                                            "that does not begin with " + kAutosavePrefix};
  const auto file = folder_.create(settings_.command_log);
  if (!file.ok()) return file.error();
  log_.descriptor = file->descriptor;
  log_name_ = file->name;
  folder_.remove(log_name_ + kLogIndexSuffix);  // of an older log of that name, which is gone
  const auto index = folder_.create(log_name_ + kLogIndexSuffix);
  if (!index.ok()) return index.error();
  index_.descriptor = index->descriptor;
  logger_ = std::thread([this] { writeLoop(); });
  world.record([this](std::string bytes) { append(log_, std::move(bytes)); });
  index_writer_ =
      std::make_unique<LogIndexWriter>(world, [this](std::string bytes) { append(index_, std::move(bytes)); });
  return file->name;
}

void Session::start(WorldRunner& runner) {
  runner_ = &runner;
  autosave_.keep();
  folder_.removeLeftovers();
  if (settings_.autosave_period > 0.0) saver_ = std::thread([this] { saveLoop(); });
}

void Session::endLog(WorldRunner& runner) {
  if (!logger_.joinable()) return;
  (void)runner.look([this](World& world) {
    world.record(nullptr);
    if (const auto writer = std::exchange(index_writer_, nullptr)) writer->end();
  });
}

void Session::stop() {
  {
    const std::lock_guard<std::mutex> lock(save_mutex_);
    stopping_ = true;
  }
  save_wanted_.notify_all();
  if (saver_.joinable()) {
    saver_.join();
    autosave_.remove();
  }
  {
    const std::lock_guard<std::mutex> lock(log_mutex_);
    log_ending_ = true;
  }
  log_grown_.notify_all();
  if (logger_.joinable()) logger_.join();
  for (GrowingFile* file : {&log_, &index_})
    if (file->descriptor >= 0) ::close(std::exchange(file->descriptor, -1));
}

Result<std::size_t> Session::save(WorldRunner& runner, const std::string& name) {
  if (Status valid = SessionFolder::checkName(name); !valid.ok()) return valid.error();
  if (beginsAsAutosave(name) || (!log_name_.empty() && (name == log_name_ || name == log_name_ + kLogIndexSuffix)))
    return Error{ErrorCode::kForbidden, "file is '" + name + "', which the node itself writes; accepted: another name"};
  if (folder_.beginsWith(name, kCommandLogMagic))
    return Error{ErrorCode::kForbidden, "file is '" + name + "', which is a log of commands; accepted: another name"};
  SavedWorldPtr saved;
  const Status done = runner.look([&](World& world) { saved = world.capture(); });
  if (!done.ok()) return done.error();
  const auto bytes = encoded(*saved);
  if (!bytes.ok()) return bytes.error();
  if (Status written = folder_.write(name, *bytes); !written.ok()) return written.error();
  return bytes->size();
}

Result<std::string> Session::encoded(const SavedWorld& world) const {
  std::string bytes = encode(world, settings_.origin);
  if (bytes.size() > kMostStateBytes) {
    return Error{ErrorCode::kFailed, "the state has " + std::to_string(bytes.size()) + " bytes; accepted: up to " +
                                         std::to_string(kMostStateBytes)};
  }
  return bytes;
}

Result<Session::Loaded> Session::load(WorldRunner& runner, const std::string& name) {
  const auto bytes = folder_.read(name, kMostStateBytes, kStateHeaderBytes, checkStateHeader);
  if (!bytes.ok()) return bytes.error();
  const auto decoded = decode(*bytes);
  if (!decoded.ok()) return Error{decoded.error().code, "'" + name + "': " + decoded.error().detail};
  Loaded loaded;
  loaded.bytes = bytes->size();
  const Status done = runner.restore(decoded->world, [&](World& world) {
    loaded.step = world.stepCount();
    loaded.bodies = world.bodyCount();
  });
  if (!done.ok()) return done.error();
  return loaded;
}

void Session::heard(const std::vector<Event>& events) {
  if (index_writer_) index_writer_->heard(events);
}

void Session::changed(World& world, double dt) {
  if (index_writer_ && dt > 0.0) index_writer_->stepped(world);
  if (!(settings_.autosave_period > 0.0)) return;
  since_save_ += dt;
  // Half a step early: so much is lost at most, whatever rounding does.
  const bool due = since_save_ >= settings_.autosave_period - 0.5 * dt && dt > 0.0;
  SavedWorldPtr saved;
  if (due) {
    since_save_ = 0.0;
    saved = world.capture();
  }
  {
    const std::lock_guard<std::mutex> lock(save_mutex_);
    if (dt > 0.0) ++steps_seen_;
    const bool known = unsaved_;
    unsaved_ = !due;
    if (due)
      to_save_ = std::move(saved);  // of two that wait the newer one
    else if (known)
      return;
  }
  save_wanted_.notify_all();
}

void Session::saveLoop() {
  bool failed = false;
  std::string said;  // of a failure that lasts
  SavedWorldPtr saved;
  while (waitForWork(failed, saved)) {
    failed = !saved && !runner_->look([&](World& world) { saved = world.capture(); }).ok();
    if (failed) continue;  // mostly the runner ends just now, and this thread is next
    const auto bytes = encoded(*saved);
    const Status written = bytes.ok() ? autosave_.write(*bytes) : Status(bytes.error());
    failed = bytes.ok() && !written.ok();  // what is too large is so until it changes
    const std::string why = written.ok() ? "" : written.error().detail;
    if (!written.ok() && why != said) ROS_ERROR_STREAM("the autosave failed, and is tried again: " << why);
    if (written.ok() && !said.empty()) ROS_WARN_STREAM("the autosave is written again");
    said = why;
  }
}

// Once time stands still, what is not saved yet is saved a little later, all at once; what failed is tried again.
// False: it is time to stop. Without `saved` the world is to be looked at.
bool Session::waitForWork(bool failed, SavedWorldPtr& saved) {
  std::unique_lock<std::mutex> lock(save_mutex_);
  const auto wanted = [this] { return stopping_ || to_save_; };
  if (failed) {
    const double pause = std::clamp(settings_.autosave_period, kTryAgainFirst, kTryAgainLast);
    save_wanted_.wait_for(lock, std::chrono::duration<double>(pause), wanted);
  } else {
    while (true) {
      save_wanted_.wait(lock, [&] { return wanted() || unsaved_; });
      const std::uint64_t seen = steps_seen_;
      // Where it runs the period decides.
      if (wanted() || save_wanted_.wait_for(lock, kSaveAfterChange, wanted) || seen == steps_seen_) break;
    }
  }
  saved = std::exchange(to_save_, nullptr);
  if (!saved) unsaved_ = false;
  return !stopping_;
}

void Session::append(GrowingFile& file, std::string bytes) {
  {
    const std::lock_guard<std::mutex> lock(log_mutex_);
    if (file.failed) return;
    if (file.buffer.size() + bytes.size() > kMostBuffered && !file.buffer.empty()) {
      file.failed = true;
      ROS_ERROR_STREAM(file.what << " ends here: the disk is too slow for it");
      return;
    }
    file.buffer += bytes;
    if (file.buffer.size() < kWriteAtOnce) return;
  }
  log_grown_.notify_all();
}

void Session::write(GrowingFile& file, const std::string& bytes) {
  const Status written = writeAll(file.descriptor, bytes);
  if (written.ok()) return;
  const std::lock_guard<std::mutex> lock(log_mutex_);
  if (!file.failed) ROS_ERROR_STREAM(file.what << " ends here: cannot write it: " << written.error().detail);
  file.failed = true;  // what follows a gap could not be replayed
  file.buffer.clear();
}

void Session::writeLoop() {
  while (true) {
    std::string log, index;
    bool ending = false;
    {
      std::unique_lock<std::mutex> lock(log_mutex_);
      log_grown_.wait_for(lock, kWriteEvery, [this] {
        return log_ending_ || std::max(log_.buffer.size(), index_.buffer.size()) >= kWriteAtOnce;
      });
      log.swap(log_.buffer);
      index.swap(index_.buffer);
      ending = log_ending_;
    }
    write(log_, log);
    write(index_, index);
    if (ending) break;
  }
  for (const GrowingFile* file : {&log_, &index_}) (void)::fsync(file->descriptor);
}

}  // namespace meshless
