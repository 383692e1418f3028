// Files of records: length (4), checksum (4), and so many bytes, at least one. What a process could not write in full
// when it was killed is the last one.
#pragma once

#include <istream>
#include <string>

#include "saved_world_impl.h"

namespace meshless {

constexpr std::size_t kRecordHeader = 8;
constexpr std::uint32_t kMostRecord = 0x7fffffffu;

template <class... Parts>
std::string recordOf(const Parts&... parts) {
  std::string record(kRecordHeader, '\0');
  OutArchive archive(record);
  archive(parts...);
  const std::string_view body = std::string_view(record).substr(kRecordHeader);
  std::string header;
  OutArchive head(header);
  head(static_cast<std::uint32_t>(body.size()), checksum(body));
  record.replace(0, kRecordHeader, header);
  return record;
}

/// Up to `count` bytes, as many as there are; memory is taken as they come.
std::string readUpTo(std::istream& file, std::size_t count);

struct ReadRecord {
  std::string body;              // empty: it is not there, or not whole
  std::uint64_t lost_bytes = 0;  // of a torn one; of a damaged one and all that follows
  std::string damage;            // what is wrong with it
};
/// The next one.
ReadRecord readRecord(std::istream& file);

/// How many bytes are left; goes to the end.
std::uint64_t restOf(std::istream& file);

}  // namespace meshless
