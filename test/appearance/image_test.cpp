#include "meshless_surgery/appearance/image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "support/images.h"
#include "support/random.h"

namespace meshless {
namespace image_test {

double difference(const Color& one, const Color& other) {
  return std::abs(one.r - other.r) + std::abs(one.g - other.g) + std::abs(one.b - other.b);
}

TEST(Image, ItsPixelsAreWhereTheyAreSeen) {
  const std::uint32_t width = 8, height = 4;
  const auto rgb = test::ramp(width, height);
  const ImagePtr image = *Image::make(width, height, rgb);
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x) {
      // From the lower left corner on, both in widths; the first row is the upper one.
      const Color c = image->at((x + 0.5) / width, (height - y - 0.5) / width);
      const std::uint8_t* pixel = &rgb[3 * (y * width + x)];
      EXPECT_NEAR(pixel[0] / 255.0, c.r, 1e-6) << x << " " << y;
      EXPECT_NEAR(pixel[1] / 255.0, c.g, 1e-6) << x << " " << y;
      EXPECT_NEAR(pixel[2] / 255.0, c.b, 1e-6) << x << " " << y;
    }
}

TEST(Image, RepeatsAndHasNoSteps) {
  test::Random random(5);
  const ImagePtr image = *Image::make(8, 4, test::ramp(8, 4));
  for (int n = 0; n < 2000; ++n) {
    const double x = random.uniform(-3, 3), y = random.uniform(-3, 3);
    ASSERT_LT(difference(image->at(x, y), image->at(x + 2.0, y - 0.5)), 1e-4);
    ASSERT_LT(difference(image->at(x, y), image->at(x + 1e-5, y - 1e-5)), 1e-3);
  }
}

TEST(Image, ShrunkItHasTheSameShapeAndTheSameColourOnTheWhole) {
  for (const auto& [width, height] : {std::pair<std::uint32_t, std::uint32_t>{1500, 700}, {513, 512}, {40, 2000}}) {
    const auto rgb = test::ramp(width, height);
    const ImagePtr image = *Image::shrunk(width, height, rgb);
    EXPECT_EQ(Image::kMostSide, std::max(image->width(), image->height()));
    EXPECT_NEAR(static_cast<double>(width) / height, static_cast<double>(image->width()) / image->height(),
                0.05 * width / height);
    const auto mean = [](const std::vector<std::uint8_t>& bytes) {
      return static_cast<double>(std::accumulate(bytes.begin(), bytes.end(), std::uint64_t{0})) / bytes.size();
    };
    EXPECT_NEAR(mean(rgb), mean(image->rgb()), 1.0);
  }
  const ImagePtr small = *Image::shrunk(8, 4, test::ramp(8, 4));
  EXPECT_EQ(test::ramp(8, 4), small->rgb());
}

TEST(Image, TheSamePixelsHaveTheSameNumber) {
  const auto number = [](std::uint32_t width, std::uint32_t height, const std::vector<std::uint8_t>& rgb) {
    return (*Image::make(width, height, rgb))->id();
  };
  const auto rgb = test::ramp(8, 4);
  EXPECT_EQ(number(8, 4, rgb), number(8, 4, rgb));
  EXPECT_NE(number(8, 4, rgb), number(4, 8, rgb));
  for (std::size_t byte = 0; byte < rgb.size(); ++byte) {
    auto other = rgb;
    ++other[byte];
    EXPECT_NE(number(8, 4, rgb), number(8, 4, other)) << byte;
  }
}

TEST(Image, WrongSizesAreRefused) {
  const auto refused = [](std::uint32_t width, std::uint32_t height, std::size_t bytes) {
    const auto made = Image::make(width, height, std::vector<std::uint8_t>(bytes));
    EXPECT_FALSE(made.ok()) << width << " " << height << " " << bytes;
    if (!made.ok()) {
      EXPECT_NE(std::string::npos, made.error().detail.find("the image "));
    }
  };
  refused(0, 4, 0);
  refused(4, 0, 0);
  refused(4, 4, 47);
  refused(4, 4, 49);
  refused(Image::kMostSide + 1, 1, 3 * (Image::kMostSide + 1));
  refused(0xffffffffu, 0xffffffffu, 3);
}

// --- on tissue

TEST(ImageLook, IsSeenAlongTheAxisThatTheSurfaceIsTurnedTo) {
  Look look;
  look.noise = Noise::kImage;
  look.image = *Image::make(8, 8, test::ramp(8, 8));
  look.scale = 0.05;
  const Color base{0.1f, 0.2f, 0.3f, 0.4f};
  test::Random random(6);
  for (int n = 0; n < 300; ++n) {
    const Vec3 p = random.vector(0.1);
    const Vec3 across[] = {Vec3(p.y(), p.z(), 0.0), Vec3(p.x(), p.z(), 0.0), Vec3(p.x(), p.y(), 0.0)};
    Vec3 least = Vec3::Constant(1.0), most = Vec3::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      const Color seen = look.image->at(across[axis].x() / look.scale, across[axis].y() / look.scale);
      for (const double length : {3.0, -1.0}) {  // of any length, outwards or inwards
        const Color c = colorAt(look, base, p, length * Vec3::Unit(axis));
        ASSERT_LT(difference(seen, c), 1e-6);
        ASSERT_EQ(0.4f, c.a);
      }
      least = least.cwiseMin(Vec3(seen.r, seen.g, seen.b));
      most = most.cwiseMax(Vec3(seen.r, seen.g, seen.b));
    }
    // Between them otherwise, and without steps as the surface turns.
    const Vec3 normal = random.vector(1.0);
    for (const Vec3& turned : {normal, Vec3(Vec3::Zero())}) {
      const Color c = colorAt(look, base, p, turned);
      const Vec3 channels(c.r, c.g, c.b);
      ASSERT_TRUE(((channels - least).array() > -1e-6).all() && ((most - channels).array() > -1e-6).all());
    }
    ASSERT_LT(difference(colorAt(look, base, p, normal),
                         colorAt(look, base, p, normal + 1e-5 * normal.norm() * Vec3::UnitX())),
              1e-3);
  }
}

TEST(ImageLook, ALargerScaleIsTheSameImageLarger) {
  const Look fine = test::chequered(0.01), coarse = test::chequered(0.04);
  test::Random random(7);
  for (int n = 0; n < 300; ++n) {
    const Vec3 p = random.vector(0.1), normal = random.vector(1.0);
    ASSERT_LT(difference(colorAt(fine, Color(), p, normal), colorAt(coarse, Color(), 4.0 * p, normal)), 1e-5);
  }
}

TEST(ImageLook, NeedsAnImageAndTheOthersHaveNone) {
  Look look = test::chequered(0.01);
  EXPECT_TRUE(look.validate("outer").ok());
  look.noise = Noise::kFat;
  EXPECT_FALSE(look.validate("outer").ok());
  look.noise = Noise::kImage;
  look.image.reset();
  EXPECT_FALSE(look.validate("outer").ok());
}

TEST(ImageLook, IsAnotherOneWhereItsPixelsAre) {
  EXPECT_TRUE(test::chequered(0.01) == test::chequered(0.01));
  Look other = test::chequered(0.01);
  other.image = *Image::make(1, 1, {1, 2, 3});
  EXPECT_FALSE(test::chequered(0.01) == other);
  EXPECT_FALSE(Look() == test::chequered(0.004));
}

}  // namespace image_test
}  // namespace meshless
