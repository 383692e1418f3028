// How a loop is spread over threads, if it is.
#pragma once

#include <cstddef>
#include <functional>

namespace meshless {

/// Calls work(0) .. work(count - 1), in any order and on any threads, and returns when all are done. What is computed
/// does not depend on it to the bit.
using ForEach = std::function<void(std::size_t count, const std::function<void(std::size_t)>& work)>;
inline void oneAfterAnother(std::size_t count, const std::function<void(std::size_t)>& work) {
  for (std::size_t i = 0; i < count; ++i) work(i);
}

/// The same without a copy of the work: a std::function of much that is captured would be allocated.
template <class Work>
void runEach(const ForEach& for_each, std::size_t count, const Work& work) {
  for_each(count, std::cref(work));
}

}  // namespace meshless
