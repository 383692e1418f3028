// A log of commands that is played: step by step from its start, or from any state that was kept of it.
#pragma once

#include <string_view>
#include <vector>

#include "meshless_surgery/world/command_log.h"
#include "meshless_surgery/world/saved_world.h"

namespace meshless {

class LogPlayer {
 public:
  /// Reads all of it up to the first record that is not whole, which the report tells of; refuses (kUnreadable) what
  /// World::record did not write, and a damaged start.
  static Result<LogPlayer> open(std::istream& log);
  LogPlayer(LogPlayer&&) noexcept;
  LogPlayer& operator=(LogPlayer&&) noexcept;
  ~LogPlayer();

  double stepRate() const { return step_rate_; }  // [Hz] at the start
  std::uint64_t end() const { return end_; }      // steps that it has
  std::uint64_t at() const { return at_; }  // steps since its start, which resets and loaded states do not set back

  /// The state at the log's start. The world keeps its number of threads.
  void begin(World& world);
  /// A state that was captured right after so many steps. What could be undone then cannot be now: see undoesNext.
  void resume(World& world, const SavedWorld& state, std::uint64_t at);
  /// A cut is undone before the next step.
  bool undoesNext() const;
  /// The commands that come next, and a step; false at the end, where nothing is left but the last commands.
  bool step(World& world);

  /// Of what was played since it was opened; without the last step and hash.
  const ReplayReport& report() const { return report_; }

 private:
  struct Record;
  LogPlayer();
  /// A record, `step` being of the one before and `most` steps accepted between the two; throws ArchiveFault.
  void add(std::string_view body, std::uint64_t& step, double& most);

  SavedWorldPtr start_;
  std::vector<Record> records_;  // that follow it
  std::size_t next_ = 0;
  std::uint64_t at_ = 0, end_ = 0;
  double step_rate_ = 0.0;
  ReplayReport report_;
};

}  // namespace meshless
