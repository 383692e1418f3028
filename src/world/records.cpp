#include "records.h"

#include <limits>

namespace meshless {
namespace {

constexpr std::size_t kReadAtOnce = 1 << 20;

}  // namespace

std::string readUpTo(std::istream& file, std::size_t count) {
  std::string bytes;
  while (bytes.size() < count && file) {
    const std::size_t have = bytes.size(), want = std::min(kReadAtOnce, count - have);
    bytes.resize(have + want);
    file.read(bytes.data() + have, static_cast<std::streamsize>(want));
    bytes.resize(have + static_cast<std::size_t>(file.gcount()));
  }
  return bytes;
}

ReadRecord readRecord(std::istream& file) {
  ReadRecord record;
  const std::string header = readUpTo(file, kRecordHeader);
  if (header.size() < kRecordHeader) {
    record.lost_bytes = header.size();
    return record;
  }
  std::uint32_t length = 0, sum = 0;
  InArchive archive(header);
  archive(length, sum);
  const bool possible = length > 0 && length <= kMostRecord;  // zeros have the checksum of nothing
  if (possible) record.body = readUpTo(file, length);
  const bool torn = possible && record.body.size() < length;
  if (!torn && (!possible || checksum(record.body) != sum))
    record.damage = possible ? "its checksum is wrong" : "it claims " + std::to_string(length) + " bytes";
  if (torn || !record.damage.empty()) {
    record.lost_bytes = header.size() + record.body.size() + restOf(file);
    record.body.clear();
  }
  return record;
}

std::uint64_t restOf(std::istream& file) {
  file.ignore(std::numeric_limits<std::streamsize>::max());
  return static_cast<std::uint64_t>(file.gcount());
}

}  // namespace meshless
