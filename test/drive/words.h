// Sentences with numbers. Private to this room.
#pragma once

#include <sstream>
#include <string>

namespace meshless {

template <class... Parts>
std::string words(const Parts&... parts) {
  std::ostringstream text;
  text.precision(3);
  (text << ... << parts);
  return text.str();
}

}  // namespace meshless
