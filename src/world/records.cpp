#include "records.h"

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
  if (length > kMostRecord) throw ArchiveFault("it claims " + std::to_string(length) + " bytes");
  record.body = readUpTo(file, length);
  if (record.body.size() < length) {
    record.lost_bytes = header.size() + record.body.size();
    return record;
  }
  if (checksum(record.body) != sum) throw ArchiveFault("its checksum is wrong");
  record.there = true;
  return record;
}

}  // namespace meshless
