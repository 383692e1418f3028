#include "fuzz/targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  meshless::fuzz::sceneFile(data, size);
  return 0;
}
