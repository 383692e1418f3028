// Small images that tell their pixels apart.
#pragma once

#include "meshless_surgery/appearance/look.h"

namespace meshless::test {

/// Each pixel's red grows to the right, its green downwards; blue is as given.
inline std::vector<std::uint8_t> ramp(std::uint32_t width, std::uint32_t height, std::uint8_t blue = 50) {
  std::vector<std::uint8_t> rgb;
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x) {
      rgb.push_back(static_cast<std::uint8_t>(255 * x / std::max(1u, width - 1)));
      rgb.push_back(static_cast<std::uint8_t>(255 * y / std::max(1u, height - 1)));
      rgb.push_back(blue);
    }
  return rgb;
}

/// An image of 2 x 2 pixels, red and blue in turns, `scale` [m] wide.
inline Look chequered(double scale) {
  Look look;
  look.noise = Noise::kImage;
  look.image = *Image::make(2, 2, {255, 0, 0, 0, 0, 255, 0, 0, 255, 255, 0, 0});
  look.scale = scale;
  return look;
}

}  // namespace meshless::test
