// Any moment of a log of commands: forward as it was, or at once to another time.
#pragma once

#include "meshless_surgery/world/log_index.h"
#include "meshless_surgery/world/log_player.h"

namespace meshless {

class LogReview {
 public:
  /// The index is of that log.
  LogReview(LogPlayer player, LogIndex index) : player_(std::move(player)), index_(std::move(index)) {}

  const LogPlayer& player() const { return player_; }
  const LogIndex& index() const { return index_; }

  /// The state at the log's start.
  void begin(World& world) { player_.begin(world); }
  /// A step on; false at the end.
  bool step(World& world);
  /// The state after so many steps since the log's start, up to player().end(): from the last state that was kept
  /// before, or from the present one where that is nearer. How many steps were computed.
  Result<std::uint64_t> seek(World& world, std::uint64_t at);

 private:
  std::uint64_t goOn(World& world, std::uint64_t at);

  LogPlayer player_;
  LogIndex index_;
};

/// Plays a log to its end and writes its index; `done` of `end` steps is told now and then.
void writeLogIndex(LogPlayer& log, int threads, const LogIndexWriter::Sink& sink,
                   const std::function<void(std::uint64_t done, std::uint64_t end)>& tell = {});

}  // namespace meshless
