#include <algorithm>
#include <filesystem>
#include <set>

#include "meshless_surgery/io/files.h"
#include "opened_file.h"

namespace meshless {
namespace {

namespace fs = std::filesystem;

const std::string kPackageScheme = "package://";

/// Both real paths.
bool isBelow(const fs::path& path, const fs::path& folder) {
  const auto ends = std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
  // A folder written with a slash at its end has an empty last part.
  return ends.first == folder.end() || (ends.first->empty() && std::next(ends.first) == folder.end());
}

Result<fs::path> expandPackage(const std::string& path, const FileAccess& access) {
  const std::string rest = path.substr(kPackageScheme.size());
  const std::size_t slash = rest.find('/');
  const std::string package = rest.substr(0, slash);
  if (package.empty() || slash == std::string::npos)
    return Error{ErrorCode::kInvalidArgument, "file is '" + path + "'; accepted: package://PACKAGE/PATH"};
  if (!access.find_package)
    return Error{ErrorCode::kForbidden,
                 "file is '" + path + "', and packages are not looked up here; accepted: a path"};
  const std::string folder = access.find_package(package);
  if (folder.empty())
    return Error{ErrorCode::kUnknownName, "there is no package '" + package + "' (of '" + path + "')"};
  return fs::path(folder) / rest.substr(slash + 1);
}

}  // namespace

Result<std::string> FileAccess::located(const std::string& path, const std::string& base_folder) const {
  if (path.compare(0, kPackageScheme.size(), kPackageScheme) != 0)
    return (fs::path(base_folder) / path).string();  // an absolute path replaces the folder
  const Result<fs::path> expanded = expandPackage(path, *this);
  if (!expanded) return expanded.error();
  return expanded->string();
}

Result<std::string> FileAccess::resolve(const std::string& path, const std::string& base_folder) const {
  if (path.empty()) return Error{ErrorCode::kInvalidArgument, "the file's name is empty; accepted: a path"};
  if (path.find('\0') != std::string::npos || path.size() > 4096)
    return Error{ErrorCode::kInvalidArgument,
                 "the file's name is no path; accepted: up to 4096 characters without NUL"};
  const Result<std::string> found = located(path, base_folder);
  if (!found) return found.error();
  const fs::path wanted = *found;

  // Links and ".." are resolved first: what is outside is refused without a word about what is there. Nor is a word
  // said about why a name leads nowhere, as it may do so outside.
  std::error_code failed;
  const fs::path real = fs::weakly_canonical(wanted, failed);
  const fs::path judged = failed ? wanted.lexically_normal() : real;
  std::set<std::string> known;
  bool allowed = false;
  for (const std::string& folder : folders) {
    std::error_code missing;
    const fs::path real_folder = fs::canonical(folder, missing);
    if (missing) continue;
    known.insert(real_folder.string());
    allowed = allowed || isBelow(judged, real_folder);
  }
  if (!allowed) {
    std::string accepted = known.empty() ? "none" : "";
    for (const std::string& folder : known) accepted += (accepted.empty() ? "" : ", ") + folder;
    return Error{ErrorCode::kForbidden, "'" + path + "' is outside the folders that may be read; accepted: below " +
                                            accepted + (more.empty() ? "" : ", or " + more)};
  }
  if (failed) return Error{ErrorCode::kUnreadable, "cannot find '" + path + "'"};
  const FileKind kind = fileKind(real.string());
  if (kind == FileKind::kElsewhere) return Error{ErrorCode::kUnreadable, "there is no file '" + path + "'"};
  if (kind == FileKind::kOther)
    return Error{ErrorCode::kUnreadable, "'" + path + "' is no file; accepted: a regular file"};
  return real.string();
}

}  // namespace meshless
