// Pictures from files: PNG (libpng) and JPEG (libjpeg), told by their first bytes.
#pragma once

#include <map>

#include "meshless_surgery/appearance/image.h"
#include "meshless_surgery/io/files.h"

namespace meshless {

/// Shrunk to Image::kMostSide. Opacity is left out, grey and 16 bits are taken, CMYK is not. `real_path` has no links
/// in it, as FileAccess::resolve gives it. Refuses kUnreadable: missing, replaced meanwhile, of another kind, damaged,
/// more than 32 MiB, more than 16,777,216 pixels; sizes are looked at before memory is taken.
Result<ImagePtr> readImageFile(const std::string& real_path);

/// The images that materials name, each read once.
class ImageFiles {
 public:
  explicit ImageFiles(FileAccess access) : access_(std::move(access)) {}
  /// A relative path is taken from `base_folder`. Errors name the path.
  Result<ImagePtr> read(const std::string& path, const std::string& base_folder);

 private:
  FileAccess access_;
  std::map<std::string, Result<ImagePtr>> known_;  // by real path
};

}  // namespace meshless
