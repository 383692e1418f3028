#include "meshless_surgery/world/log_review.h"

#include "world_impl.h"

namespace meshless {
namespace {

constexpr std::uint64_t kTellEvery = 1000;  // steps

}  // namespace

bool LogReview::step(World& world) {
  if (player_.at() >= player_.end()) return false;
  goOn(world, player_.at() + 1);
  return true;
}

Result<std::uint64_t> LogReview::seek(World& world, std::uint64_t at) {
  if (at > player_.end()) return outOfRange("at", static_cast<double>(at), "0 to " + std::to_string(player_.end()));
  const bool ahead = at > 0 && at >= player_.at();
  const LogIndex::Kept kept = index_.stateAt(at, ahead ? player_.at() : 0);
  if (kept.state) {
    player_.resume(world, *kept.state, kept.at);
  } else if (!ahead) {
    player_.begin(world);
  }
  return goOn(world, at);
}

// An undone cut needs the state before it, which only the log's start has for sure, or the state that was kept after
// it.
std::uint64_t LogReview::goOn(World& world, std::uint64_t at) {
  std::uint64_t done = 0;
  bool whole = false;  // played from the start
  while (player_.at() < at) {
    if (player_.undoesNext() && !whole) {
      const std::uint64_t next = player_.at() + 1;
      const LogIndex::Kept kept = index_.stateAt(next, player_.at());
      if (kept.state) {
        player_.resume(world, *kept.state, kept.at);
        continue;
      }
      player_.begin(world);
      whole = true;
    }
    const bool stepped = player_.step(world);
    (void)world.takeEvents();
    if (!stepped) break;
    ++done;
  }
  return done;
}

void writeLogIndex(LogPlayer& log, int threads, const LogIndexWriter::Sink& sink,
                   const std::function<void(std::uint64_t done, std::uint64_t end)>& tell) {
  WorldSettings settings;
  settings.threads = threads;
  World world(settings);
  log.begin(world);
  (void)world.takeEvents();
  LogIndexWriter writer(world, sink);
  while (log.step(world)) {
    writer.heard(world.takeEvents());
    writer.stepped(world);
    if (tell && log.at() % kTellEvery == 0) tell(log.at(), log.end());
  }
  writer.end();
}

}  // namespace meshless
