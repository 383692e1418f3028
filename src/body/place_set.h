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

  /// By the places around each one: those next to it along an axis or, with `corners`, all 26. No farther than the
  /// margin.
  void widen(bool corners) {
    std::vector<char> before = has_;
    for (const std::size_t stride : stride_) {
      if (corners) before = has_;
      for (std::size_t i = 0; i < before.size(); ++i)
        if (before[i]) has_[i + stride] = has_[i - stride] = true;
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
