#include "fuzz/mesh_files.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  meshless::fuzz::meshFile(data, size);
  return 0;
}
