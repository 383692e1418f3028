// The one folder that is written to: files by name, whole or not at all.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "meshless_surgery/base/result.h"

namespace meshless {

class SessionFolder {
 public:
  /// Made when the first file is written, or by make(), its parents too. Empty: nothing is written or read.
  explicit SessionFolder(std::string folder) : folder_(std::move(folder)) {}

  const std::string& folder() const { return folder_; }
  Status make() const;

  /// Why it is not a file's name, of what the message calls `field`; names are 1 to 100 letters, digits and ._- and do
  /// not begin with a dot.
  static Status checkName(const std::string& name, const std::string& field = "file");

  /// Written beside it, brought to the disk, and renamed: whoever reads finds the old file or the new one. On failure
  /// (kFailed: the disk refuses) the old one is still there, unless the detail says that the new one is.
  Status write(const std::string& name, std::string_view bytes) const;
  /// Refuses kUnreadable (missing, no regular file, a link to one elsewhere: kForbidden, longer than `most_bytes`)
  /// before memory is taken.
  Result<std::string> read(const std::string& name, std::size_t most_bytes) const {
    return read(name, most_bytes, 0, {});
  }
  /// Likewise, and refuses what `check` does: it is given the first bytes (fewer where there are no more) and how many
  /// the file has.
  using Check = std::function<Status(std::string_view beginning, std::uint64_t file_bytes)>;
  Result<std::string> read(const std::string& name, std::size_t most_bytes, std::size_t beginning_bytes,
                           const Check& check) const;
  /// False too where there is no such file, or only a link.
  bool beginsWith(const std::string& name, std::string_view text) const;
  bool has(const std::string& name) const;
  void remove(const std::string& name) const;
  Status rename(const std::string& from, const std::string& to) const;
  /// Halves that processes of this machine left when they were killed while they wrote. Others' are left alone.
  void removeLeftovers() const;

  /// A file to append to, that did not exist: `name`, or where that is taken name.2, name.3 ... The caller closes it.
  struct NewFile {
    int descriptor = -1;
    std::string name;
  };
  Result<NewFile> create(const std::string& name) const;

 private:
  std::string pathOf(const std::string& name) const { return folder_ + "/" + name; }
  std::string folder_;
};

/// All of it; an error says why not, with errno's words.
Status writeAll(int descriptor, std::string_view bytes);

}  // namespace meshless
