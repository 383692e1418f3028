#include "fuzz/cuts.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  meshless::fuzz::cutPlane(data, size);
  return 0;
}
