// A picture that tissue is shown with. It never changes, so all that look alike share one.
#pragma once

#include <memory>
#include <vector>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/base/types.h"

namespace meshless {

class Image;
using ImagePtr = std::shared_ptr<const Image>;

class Image {
 public:
  static constexpr std::uint32_t kMostSide = 512;  // pixels: a texture for every driver, and a small message

  /// `rgb`: red green blue of each pixel, row by row from the upper left corner on. Refuses sides that are not
  /// 1..kMostSide, and another number of bytes.
  static Result<ImagePtr> make(std::uint32_t width, std::uint32_t height, std::vector<std::uint8_t> rgb);
  /// The same of a picture of any size: where it is larger, each pixel is the mean of those that it stands for.
  static Result<ImagePtr> shrunk(std::uint32_t width, std::uint32_t height, std::vector<std::uint8_t> rgb);

  std::uint32_t width() const { return width_; }
  std::uint32_t height() const { return height_; }
  const std::vector<std::uint8_t>& rgb() const { return rgb_; }
  /// Of what it shows: the same pixels have the same number. Never 0.
  std::uint64_t id() const { return id_; }

  /// Its colour (opaque) x to the right of its lower left corner and y above it, in widths of it; it repeats.
  /// Linear between the middles of pixels.
  Color at(double x, double y) const;

 private:
  Image(std::uint32_t width, std::uint32_t height, std::vector<std::uint8_t> rgb);

  std::uint32_t width_, height_;
  std::vector<std::uint8_t> rgb_;
  std::uint64_t id_;
};

}  // namespace meshless
