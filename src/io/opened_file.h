// A file opened once. What it is, where it lies, how long it is and what it holds are asked of the descriptor: behind
// the name there may be another file a moment later.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "meshless_surgery/base/result.h"

namespace meshless {

/// What a file held when it was read.
class FileBytes {
 public:
  FileBytes(std::unique_ptr<char[]> bytes, std::size_t size) : bytes_(std::move(bytes)), size_(size) {}
  std::string_view text() const { return {bytes_.get(), size_}; }

 private:
  std::unique_ptr<char[]> bytes_;
  std::size_t size_;
};

/// Whether there is a file of this name now. kElsewhere: none, or its name leads through a link.
enum class FileKind { kRegular, kOther, kElsewhere };
FileKind fileKind(const std::string& real_path);

/// Reads the file at `real_path`, a path without links as FileAccess::resolve gives it: what opens must lie at that
/// very path, so that a link put there meanwhile leads nowhere. Never waits for a pipe. The error's text wants the
/// file's name in front; it is the same whether what is there instead exists, may be read or is a link.
Result<FileBytes> readFile(const std::string& real_path, std::uint64_t most_bytes);

}  // namespace meshless
