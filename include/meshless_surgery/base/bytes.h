// How much memory arrays hold, with what they have in reserve.
#pragma once

#include <cstddef>
#include <vector>

namespace meshless {

template <class T, class Allocator>
std::size_t bytesOf(const std::vector<T, Allocator>& values) {
  return values.capacity() * sizeof(T);
}
inline std::size_t bytesOf(const std::vector<bool>& values) { return values.capacity() / 8; }

/// Of several arrays.
template <class First, class Second, class... Rest>
std::size_t bytesOf(const First& first, const Second& second, const Rest&... rest) {
  return bytesOf(first) + bytesOf(second, rest...);
}

}  // namespace meshless
