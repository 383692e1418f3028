#include "meshless_surgery/dynamics/for_each.h"

namespace meshless {

void oneAfterAnother(std::size_t count, const std::function<void(std::size_t)>& work) {
  for (std::size_t i = 0; i < count; ++i) work(i);
}

}  // namespace meshless
