#include "meshless_surgery/appearance/image.h"

#include <algorithm>
#include <cmath>

namespace meshless {
namespace {

constexpr std::uint64_t kChannels = 3;

// FNV-1a.
std::uint64_t hashOf(std::uint32_t width, std::uint32_t height, const std::vector<std::uint8_t>& bytes) {
  std::uint64_t hash = 14695981039346656037ull;
  const auto mix = [&hash](std::uint64_t byte) { hash = (hash ^ byte) * 1099511628211ull; };
  mix(width);
  mix(height);
  for (const std::uint8_t byte : bytes) mix(byte);
  return std::max<std::uint64_t>(hash, 1);
}

Status checkSize(std::uint32_t width, std::uint32_t height, const std::vector<std::uint8_t>& rgb) {
  const auto fault = [](const std::string& what) { return Error{ErrorCode::kInvalidArgument, "the image " + what}; };
  if (width == 0 || height == 0) return fault("has no pixels");
  if (rgb.size() != kChannels * width * height)
    return fault("has " + std::to_string(rgb.size()) + " bytes; accepted: three a pixel, of " + std::to_string(width) +
                 " x " + std::to_string(height));
  return Done{};
}

}  // namespace

Image::Image(std::uint32_t width, std::uint32_t height, std::vector<std::uint8_t> rgb)
    : width_(width), height_(height), rgb_(std::move(rgb)), id_(hashOf(width_, height_, rgb_)) {}

Result<ImagePtr> Image::make(std::uint32_t width, std::uint32_t height, std::vector<std::uint8_t> rgb) {
  if (const Status size = checkSize(width, height, rgb); !size) return size.error();
  if (width > kMostSide || height > kMostSide)
    return Error{ErrorCode::kInvalidArgument, "the image is " + std::to_string(width) + " x " + std::to_string(height) +
                                                  " pixels; accepted: up to " + std::to_string(kMostSide) + " a side"};
  return ImagePtr(new Image(width, height, std::move(rgb)));
}

Result<ImagePtr> Image::shrunk(std::uint32_t width, std::uint32_t height, std::vector<std::uint8_t> rgb) {
  if (const Status size = checkSize(width, height, rgb); !size) return size.error();
  const std::uint32_t longest = std::max(width, height);
  if (longest <= kMostSide) return make(width, height, std::move(rgb));
  const auto side = [longest](std::uint32_t of) {
    return std::max<std::uint32_t>(1, static_cast<std::uint32_t>(std::uint64_t{of} * kMostSide / longest));
  };
  const std::uint32_t columns = side(width), rows = side(height);
  std::vector<std::uint8_t> means(kChannels * columns * rows);
  const auto first = [](std::uint32_t k, std::uint32_t of, std::uint32_t all) { return std::uint64_t{k} * all / of; };
  for (std::uint32_t row = 0; row < rows; ++row)
    for (std::uint32_t column = 0; column < columns; ++column) {
      std::array<std::uint64_t, kChannels> sums{};
      std::uint64_t count = 0;
      for (std::uint64_t y = first(row, rows, height); y < first(row + 1, rows, height); ++y)
        for (std::uint64_t x = first(column, columns, width); x < first(column + 1, columns, width); ++x, ++count)
          for (std::uint64_t c = 0; c < kChannels; ++c) sums[c] += rgb[kChannels * (y * width + x) + c];
      for (std::uint64_t c = 0; c < kChannels; ++c)
        means[kChannels * (std::uint64_t{row} * columns + column) + c] =
            static_cast<std::uint8_t>((sums[c] + count / 2) / count);
    }
  return make(columns, rows, std::move(means));
}

Color Image::at(double x, double y) const {
  // The pixels around a place: the one whose middle is to the left or above, the next, and how far it is between them.
  struct Between {
    std::uint32_t one, next;
    float share;
  };
  const auto between = [](double widths, std::uint32_t pixels) {
    const double at = (widths - std::floor(widths)) * pixels - 0.5, floor = std::floor(at);
    const auto one = static_cast<std::uint32_t>(static_cast<std::int64_t>(floor) + pixels) % pixels;
    return Between{one, (one + 1) % pixels, static_cast<float>(at - floor)};
  };
  const Between column = between(x, width_), row = between(-y * width_ / height_, height_);
  const auto channel = [&](std::size_t c) {
    const auto pixel = [&](std::uint32_t r, std::uint32_t k) {
      return static_cast<float>(rgb_[kChannels * (std::size_t{r} * width_ + k) + c]);
    };
    const auto along = [&](std::uint32_t r) {
      return pixel(r, column.one) + column.share * (pixel(r, column.next) - pixel(r, column.one));
    };
    const float upper = along(row.one), lower = along(row.next);
    return std::clamp((upper + row.share * (lower - upper)) / 255.0f, 0.0f, 1.0f);
  };
  return {channel(0), channel(1), channel(2), 1.0f};
}

}  // namespace meshless
