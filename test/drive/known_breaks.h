// Scenes that are known to break a law, so that all others may be asked to hold.
#pragma once

#include <iosfwd>

#include "drive/drive.h"

namespace meshless {

struct KnownBreak {
  std::uint64_t seed = 0;
  Law law = Law::kFinite;
  std::string reason;
};

constexpr std::size_t kMostKnownBreaks = 4;

/// Lines "SEED | LAW | REASON"; empty ones and those that begin with # are left out. Refuses (kInvalidArgument) another
/// form, a law that is not there, no reason, and more than kMostKnownBreaks scenes.
Result<std::vector<KnownBreak>> readKnownBreaks(std::istream& in);

/// What is not as it is known: a law that breaks in a scene that is not listed, a listed scene that holds all laws it is
/// listed with, a scene that was refused. Scenes that did not finish are held to what they did; which laws a listed one
/// breaks then depends on how far it came. A sentence each; none: all is as known.
std::vector<std::string> unlikeKnown(const std::vector<DriveReport>& reports, const std::vector<KnownBreak>& known);

}  // namespace meshless
