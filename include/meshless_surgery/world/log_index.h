// What is kept beside a log of commands, so that any moment of it is found at once: states to go on from, what tools
// did, and what happened.
#pragma once

#include <functional>
#include <iosfwd>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "meshless_surgery/world/saved_world.h"
#include "meshless_surgery/world/world.h"

namespace meshless {

inline constexpr std::string_view kLogIndexMagic = "MLSINDEX";  // the first bytes
inline constexpr const char* kLogIndexSuffix = ".index";        // of the file's name, after the log's

struct LogTool {
  ToolKind kind = ToolKind::kPick;
  PickId pick = 0;               // of a pick; of an instrument its number
  Vec3 position = Vec3::Zero();  // [m] the free end, the centre, the pivot, the tip
  double force = 0.0;            // [N]
};

/// Ten times a simulated second.
struct LogMoment {
  std::uint64_t at = 0;  // steps since the log's start
  std::vector<LogTool> tools;
};

struct LogEvent {
  std::uint64_t at = 0;  // the step after which it was known
  Event event;
};

class LogIndexWriter {
 public:
  /// A state is kept after so much processor time of the thread that steps [s]: no moment takes longer to be computed.
  static constexpr double kStateEvery = 0.4;
  /// From each such length on half as many [bytes].
  static constexpr std::uint64_t kThinAfter = std::uint64_t{1} << 30;

  using Sink = std::function<void(std::string bytes)>;
  /// Of a world whose log begins now.
  LogIndexWriter(const World& world, Sink sink, double state_every = kStateEvery);
  ~LogIndexWriter();

  /// What World::takeEvents gave.
  void heard(const std::vector<Event>& events);
  /// After each step, before anything else is done with the world; always by the same thread.
  void stepped(World& world);
  /// The log ends here.
  void end();

 private:
  struct Known;
  void keepState(const World& world);
  void write(std::string record);

  Sink sink_;
  double state_every_;
  std::unique_ptr<Known> known_;  // models and scenes that are in the file
  std::uint64_t at_ = 0, bytes_ = 0;
  double since_state_ = 0.0, since_moment_ = 0.0;  // [s]
  std::optional<double> clock_;                    // [s] of the thread, at the last step
  bool undone_ = false;
  std::vector<Event> heard_;
};

class LogIndex {
 public:
  /// Of a file, which it keeps to read states from. Refuses kUnreadable what no writer wrote, and what was damaged;
  /// what was lost when the writer was killed is not there.
  static Result<LogIndex> read(std::unique_ptr<std::istream> file);
  LogIndex(LogIndex&&) noexcept;
  LogIndex& operator=(LogIndex&&) noexcept;
  ~LogIndex();

  std::uint64_t startHash() const;  // World::stateHash() at the log's start
  std::uint64_t end() const;        // steps that it tells of
  bool ended() const;               // by its writer; else the file breaks off
  const std::vector<LogMoment>& moments() const;
  const std::vector<LogEvent>& events() const;

  struct Kept {
    SavedWorldPtr state;
    std::uint64_t at = 0;  // steps since the log's start
  };
  /// The last one that was kept after so many steps or fewer, but after more than `above`; null where there is none, or
  /// the file has changed since it was read.
  Kept stateAt(std::uint64_t at, std::uint64_t above = 0);

 private:
  struct Contents;
  explicit LogIndex(std::unique_ptr<Contents> contents);
  std::unique_ptr<Contents> contents_;
};

}  // namespace meshless
