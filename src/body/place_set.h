// A set of places of a lattice. Private to body.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace meshless {

class PlaceSet {
 public:
  using Place = std::array<std::int32_t, 3>;

  /// Empty, for these places and those up to `margin` beyond.
  template <class Places>
  PlaceSet(const Places& places, std::int32_t margin) {
    std::array<std::int32_t, 3> upper{};
    bool first = true;
    for (const Place& place : places)
      for (int k = 0; k < 3; ++k) {
        lower_[k] = first ? place[k] : std::min(lower_[k], place[k]);
        upper[k] = first ? place[k] : std::max(upper[k], place[k]);
        first = first && k < 2;
      }
    std::size_t count = 1;
    for (int k = 0; k < 3; ++k) {
      lower_[k] -= margin;
      stride_[k] = count;
      count *= static_cast<std::size_t>(upper[k] + margin + 1 - lower_[k]);
    }
    has_.assign(count, false);
  }

  char& at(const Place& place) { return has_[indexOf(place)]; }
  bool has(const Place& place) const { return has_[indexOf(place)]; }

  /// By all places up to so many beyond, along each axis; no more than the margin.
  void widen(std::size_t by) {
    for (const std::size_t stride : stride_) {
      const std::vector<char> before = has_;
      for (std::size_t i = 0; i < before.size(); ++i)
        if (before[i])
          for (std::size_t n = 1; n <= by; ++n) has_[i + n * stride] = has_[i - n * stride] = true;
    }
  }

 private:
  std::size_t indexOf(const Place& place) const {
    std::size_t index = 0;
    for (int k = 0; k < 3; ++k) index += stride_[k] * static_cast<std::size_t>(place[k] - lower_[k]);
    return index;
  }

  Place lower_{};
  std::array<std::size_t, 3> stride_{};
  std::vector<char> has_;
};

}  // namespace meshless
