// Where the files are that come with the package, for its programs.
#pragma once

#include <string>

#include <unistd.h>

namespace meshless {

/// Of the program that runs, PREFIX/lib/meshless_surgery/NAME: PREFIX/share/meshless_surgery, of an install space as of a
/// devel space. Empty where the system does not say where the program is.
inline std::string shareFolder() {
  char self[4096];
  const ssize_t length = ::readlink("/proc/self/exe", self, sizeof self);
  if (length <= 0) return {};
  const std::string program(self, static_cast<std::size_t>(length));
  return program.substr(0, program.rfind('/')) + "/../../share/meshless_surgery";
}

}  // namespace meshless
