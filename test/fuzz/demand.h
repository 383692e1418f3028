// What a fuzzer's input may not break.
#pragma once

#include <cstdlib>
#include <iostream>

namespace meshless::fuzz {

inline void demand(bool law, const char* what) {
  if (law) return;
  std::cerr << "broken: " << what << std::endl;
  std::abort();
}

}  // namespace meshless::fuzz
