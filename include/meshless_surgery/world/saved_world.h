// The whole state of a world as a value, and as bytes that a file can hold. World::capture makes it, World::restore
// becomes it again: every later step is the same to the bit, on the same build of this package.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "meshless_surgery/base/result.h"

namespace meshless {

/// Constant once made, so that another thread may encode it while the world goes on; models are shared with the world.
/// Left out: what could be undone, events, the last report, which run it is.
struct SavedWorld;
using SavedWorldPtr = std::shared_ptr<const SavedWorld>;

/// `origin` is any text, to be found again by decode: where the state comes from.
std::string encode(const SavedWorld& world, const std::string& origin = "");

struct DecodedWorld {
  SavedWorldPtr world;
  std::string origin;
};
/// Refuses (kUnreadable) whatever encode did not write: other files, newer versions, truncated and damaged ones. Sizes
/// are checked before memory is taken, and indices before they are used.
Result<DecodedWorld> decode(std::string_view bytes);

/// Of the encoded form: magic, version, checksum and length come first.
constexpr std::size_t kStateHeaderBytes = 24;
/// Refuses, as decode would, what the header of a file of that size says; before the rest of it is read.
Status checkStateHeader(std::string_view header, std::uint64_t file_bytes);
/// A longer file is no state. A body of 50,000 vertices takes 20 to 30 MB.
constexpr std::size_t kMostStateBytes = std::size_t{512} << 20;

}  // namespace meshless
