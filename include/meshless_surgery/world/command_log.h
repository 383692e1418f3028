// A session as a file: the state at its start, every command with the step before which it came, and hashes on the way.
// World::record writes it; replay does it again and compares.
#pragma once

#include <functional>
#include <iosfwd>
#include <optional>
#include <string_view>

#include "meshless_surgery/world/world.h"

namespace meshless {

inline constexpr std::string_view kCommandLogMagic = "MLSCOMND";  // the first bytes of every log

struct ReplayReport {
  std::uint64_t steps = 0;      // done
  std::uint64_t commands = 0;   // of all kinds: resets and loaded states too
  std::uint64_t checks = 0;     // hashes compared
  std::uint64_t last_step = 0;  // the world's count at the end
  std::uint64_t hash = 0;       // at the end
  bool ended = false;  // the recording was ended; else its process was: what came after the last record is lost
  std::uint64_t lost_bytes = 0;  // of a record that was not written in full, or from a damaged one on
  std::string damage;            // which record that is, and what is wrong with it
  /// A sentence for users where the log is not whole; else empty.
  std::string whatIsLost() const;

  /// The first hash that is not the recorded one; what follows was still done.
  struct Difference {
    std::uint64_t step = 0, recorded = 0, found = 0;
  };
  std::optional<Difference> difference;
};

/// Refuses (kUnreadable) what World::record did not write, and a log whose start is damaged. The same build gives the
/// same hashes on any number of threads (1..64). All whole records before a damaged one are replayed.
/// `after_step` may look at the world and take its events, those of the commands before the step too. It must not
/// change it otherwise.
Result<ReplayReport> replay(std::istream& log, int threads = 1,
                            const std::function<void(World& world)>& after_step = {});

}  // namespace meshless
