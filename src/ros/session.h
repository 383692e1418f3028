// What outlives the node: saved states, the autosave, the log of commands and its index. All files are below one
// folder.
#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include "meshless_surgery/io/autosave_file.h"
#include "meshless_surgery/io/session_folder.h"
#include "runner.h"
#include "meshless_surgery/world/log_index.h"
#include "meshless_surgery/world/saved_world.h"

namespace meshless {

/// The parameter's, or where it is empty meshless_surgery below ROS_HOME or ~/.ros.
std::string sessionFolderOf(const std::string& session_directory);

struct SessionSettings {
  std::string folder;
  double autosave_period = 0.0;  // [s] of simulated time; 0: none
  std::string autosave_name;     // of the file
  std::string origin;            // an autosave of another origin is not taken up
  std::string command_log;       // a file's name; empty: none
};

class Session {
 public:
  explicit Session(SessionSettings settings);
  ~Session();

  /// Before the runner has the world: takes possession of the autosave's file, takes up what a process of the same
  /// origin left there when it was killed, and says so; empty where there is none. Refuses where the disk does.
  Result<std::string> takeUp(World& world);
  /// Likewise: opens the log of commands. Refuses where the disk does, and names that autosaves have.
  Result<std::string> startLog(World& world);

  /// From now on autosaves are made, of that runner's world.
  void start(WorldRunner& runner);
  /// Ends the log, by the runner, which still has to run.
  void endLog(WorldRunner& runner);
  /// After the runner has stopped. The autosave goes: whoever stops in good order wants to begin anew.
  void stop();

  /// The state as it is now, in a file; how many bytes it has.
  Result<std::size_t> save(WorldRunner& runner, const std::string& name);
  /// Becomes a state from a file, with its scene; on an error nothing has changed.
  struct Loaded {
    std::size_t bytes = 0;
    std::uint64_t step = 0;
    std::size_t bodies = 0;
  };
  Result<Loaded> load(WorldRunner& runner, const std::string& name);

  /// On the runner's thread, after every step and every job; see WorldRunner::StepSink.
  void changed(World& world, double dt);
  /// On the runner's thread: see WorldRunner::EventSink.
  void heard(const std::vector<Event>& events);

 private:
  Result<std::string> encoded(const SavedWorld& world) const;
  void saveLoop();
  bool waitForWork(bool failed, SavedWorldPtr& saved);
  void writeLoop();
  /// A file that grows as the session goes on.
  struct GrowingFile {
    explicit GrowingFile(const char* of) : what(of) {}
    const char* what;
    int descriptor = -1;
    std::string buffer;
    bool failed = false;
  };
  void append(GrowingFile& file, std::string bytes);
  void write(GrowingFile& file, const std::string& bytes);

  const SessionSettings settings_;
  const SessionFolder folder_;
  AutosaveFile autosave_;  // of the thread that writes it, while that runs
  WorldRunner* runner_ = nullptr;

  // autosaves: copied by the runner, written by a thread of their own
  double since_save_ = 0.0;  // [s] simulated
  std::mutex save_mutex_;
  std::condition_variable save_wanted_;
  SavedWorldPtr to_save_;
  bool unsaved_ = false;  // something has changed since the last copy
  std::uint64_t steps_seen_ = 0;
  bool stopping_ = false;
  std::thread saver_;

  // the log and its index
  std::mutex log_mutex_;
  std::condition_variable log_grown_;
  GrowingFile log_{"the log of commands"}, index_{"the index of the log"};
  std::unique_ptr<LogIndexWriter> index_writer_;  // of the runner's thread
  std::string log_name_;
  bool log_ending_ = false;
  std::thread logger_;
};

}  // namespace meshless
