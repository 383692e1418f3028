#include "meshless_surgery/io/image_file.h"

#include <gtest/gtest.h>

#include <sys/resource.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iostream>

#include <jpeglib.h>
#include <png.h>
#include <zlib.h>

#include "io/temporary_folder.h"
#include "meshless_surgery/io/scene.h"
#include "support/images.h"
#include "support/random.h"

namespace meshless {
namespace image_file_test {

std::string pngOf(std::uint32_t width, std::uint32_t height, const std::vector<std::uint8_t>& pixels,
                  std::uint32_t format = PNG_FORMAT_RGB) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = width;
  png.height = height;
  png.format = format;
  std::string bytes(2 * PNG_IMAGE_PNG_SIZE_MAX(png), '\0');
  png_alloc_size_t size = bytes.size();
  EXPECT_NE(0, png_image_write_to_memory(&png, bytes.data(), &size, 0, pixels.data(), 0, nullptr)) << png.message;
  bytes.resize(size);
  return bytes;
}

std::string jpegOf(std::uint32_t width, std::uint32_t height, const std::vector<std::uint8_t>& pixels,
                   J_COLOR_SPACE space = JCS_RGB, bool progressive = false) {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &bytes, &size);
  info.image_width = width;
  info.image_height = height;
  info.input_components = space == JCS_GRAYSCALE ? 1 : space == JCS_CMYK ? 4 : 3;
  info.in_color_space = space;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, 95, TRUE);
  if (progressive) jpeg_simple_progression(&info);
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < height) {
    JSAMPROW row = const_cast<std::uint8_t*>(&pixels[std::size_t{info.next_scanline} * width * info.input_components]);
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  std::string text(reinterpret_cast<char*>(bytes), size);
  std::free(bytes);
  return text;
}

/// A PNG whose head claims a size; its pixels are those of one byte.
std::string claiming(std::uint32_t width, std::uint32_t height) {
  std::string bytes = pngOf(1, 1, {1, 2, 3});
  for (int k = 0; k < 4; ++k) {
    bytes[16 + k] = static_cast<char>(width >> (24 - 8 * k));
    bytes[20 + k] = static_cast<char>(height >> (24 - 8 * k));
  }
  const auto sum = crc32(0, reinterpret_cast<const Bytef*>(&bytes[12]), 17);
  for (int k = 0; k < 4; ++k) bytes[29 + k] = static_cast<char>(sum >> (24 - 8 * k));
  return bytes;
}

struct ImageFile : ::testing::Test {
  TemporaryFolder folder;

  Result<ImagePtr> read(const std::string& bytes, const std::string& name = "a.png") {
    return readImageFile(folder.write(name, bytes));
  }
  void refused(const std::string& bytes, const std::string& words) {
    const auto image = read(bytes);
    ASSERT_FALSE(image.ok()) << words;
    EXPECT_EQ(ErrorCode::kUnreadable, image.error().code);
    EXPECT_NE(std::string::npos, image.error().detail.find(words)) << image.error().detail;
  }
};

TEST_F(ImageFile, PixelsAreThoseThatWereWritten) {
  const auto rgb = test::ramp(40, 30);
  const auto png = read(pngOf(40, 30, rgb));
  ASSERT_TRUE(png.ok()) << png.error().detail;
  EXPECT_EQ(40u, (*png)->width());
  EXPECT_EQ(30u, (*png)->height());
  EXPECT_EQ(rgb, (*png)->rgb());
  for (const bool progressive : {false, true}) {
    const auto jpeg = read(jpegOf(40, 30, rgb, JCS_RGB, progressive), "by_its_bytes.png");
    ASSERT_TRUE(jpeg.ok()) << jpeg.error().detail;
    ASSERT_EQ(rgb.size(), (*jpeg)->rgb().size());
    for (std::size_t k = 0; k < rgb.size(); ++k) ASSERT_NEAR(rgb[k], (*jpeg)->rgb()[k], 12) << k;
  }
}

TEST_F(ImageFile, GreyAndOpacityAreTaken) {
  const auto grey = read(pngOf(2, 1, {10, 200}, PNG_FORMAT_GRAY));
  ASSERT_TRUE(grey.ok()) << grey.error().detail;
  EXPECT_EQ((std::vector<std::uint8_t>{10, 10, 10, 200, 200, 200}), (*grey)->rgb());
  const auto clear = read(pngOf(2, 1, {10, 20, 30, 255, 40, 50, 60, 128}, PNG_FORMAT_RGBA));
  ASSERT_TRUE(clear.ok()) << clear.error().detail;
  EXPECT_EQ((std::vector<std::uint8_t>{10, 20, 30, 40, 50, 60}), (*clear)->rgb());
  EXPECT_TRUE(read(jpegOf(16, 16, std::vector<std::uint8_t>(256, 77), JCS_GRAYSCALE)).ok());
}

TEST_F(ImageFile, LargeOnesAreShrunkAndTooLargeOnesRefused) {
  const auto image = read(pngOf(1200, 900, test::ramp(1200, 900)));
  ASSERT_TRUE(image.ok()) << image.error().detail;
  EXPECT_EQ(Image::kMostSide, (*image)->width());
  EXPECT_EQ(384u, (*image)->height());
  refused(claiming(5000, 4096), "is 5000 x 4096 pixels; accepted: up to 16777216 (4096 x 4096)");
  refused(std::string((32u << 20) + 1, '\0'), "bytes; accepted: up to 33554432 (32 MiB)");
}

TEST_F(ImageFile, ASizeIsLookedAtBeforeMemoryIsTaken) {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  refused(claiming(0x7fffffff, 0x7fffffff), "");
  refused(claiming(60000, 60000), "60000 x 60000");
  rusage after{};
  getrusage(RUSAGE_SELF, &after);
  EXPECT_LT(after.ru_maxrss - used.ru_maxrss, 50 * 1024);  // [KiB], of 10 GiB that were claimed
}

TEST_F(ImageFile, WhatIsNoWholeImageIsRefused) {
  refused("", "is no image; accepted: PNG and JPEG");
  refused("v 0 0 0\n", "is no image");
  refused("GIF89a", "is no image");
  refused(jpegOf(8, 8, std::vector<std::uint8_t>(256, 9), JCS_CMYK), "is no whole JPEG");
  const auto rgb = test::ramp(64, 48);
  for (const std::string& whole : {pngOf(64, 48, rgb), jpegOf(64, 48, rgb), jpegOf(64, 48, rgb, JCS_RGB, true)})
    for (std::size_t length = 4; length + 40 < whole.size(); length += 1 + whole.size() / 40)
      EXPECT_FALSE(read(whole.substr(0, length)).ok()) << length << " of " << whole.size();
  EXPECT_FALSE(readImageFile(folder.file("no_such.png")).ok());
}

// Whatever the bytes, it is an image or an error.
TEST_F(ImageFile, DamageDoesNoHarm) {
  test::Random random(11);
  const auto rgb = test::ramp(64, 48);
  std::size_t read_in_spite = 0;
  for (const std::string& whole : {pngOf(64, 48, rgb), jpegOf(64, 48, rgb), jpegOf(64, 48, rgb, JCS_RGB, true)})
    for (int n = 0; n < 300; ++n) {
      std::string bytes = whole;
      for (int k = random.integer(1, 6); k > 0; --k)
        bytes[static_cast<std::size_t>(random.integer(4, static_cast<int>(bytes.size()) - 1))] =
            static_cast<char>(random.integer(0, 255));
      const auto image = read(bytes);
      if (!image.ok()) continue;
      ++read_in_spite;
      ASSERT_EQ(std::size_t{3} * (*image)->width() * (*image)->height(), (*image)->rgb().size());
    }
  std::cout << read_in_spite << " of 900 were read\n";
}

TEST_F(ImageFile, EachIsReadOnceAndOnlyWhereFilesMayBeRead) {
  const std::string inside = folder.write("open/a.png", pngOf(2, 2, test::ramp(2, 2)));
  folder.write("closed/b.png", pngOf(2, 2, test::ramp(2, 2)));
  FileAccess access;
  access.folders = {folder.file("open")};
  ImageFiles images(access);
  const auto one = images.read("a.png", folder.file("open")), other = images.read(inside, "/");
  ASSERT_TRUE(one.ok() && other.ok());
  EXPECT_EQ(one->get(), other->get());
  const auto outside = images.read("../closed/b.png", folder.file("open"));
  ASSERT_FALSE(outside.ok());
  EXPECT_EQ(ErrorCode::kForbidden, outside.error().code);
  const auto missing = images.read("c.png", folder.file("open"));
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(std::string::npos, missing.error().detail.find("'c.png'"));
}

// --- materials

struct ImageKey : ImageFile {
  FileAccess access;

  void SetUp() override { access.folders = {folder.path()}; }
  SceneDef scene(const std::string& outer) {
    const auto read =
        readScene(folder.write("scenes/s.yaml",
                               "materials:\n  m: {alpha: 0.5}\nbodies:\n  - primitive: {sphere: 0.1}\n    material:\n"
                               "      appearance: {outer: {" +
                                   outer + "}}\n"),
                  access);
    EXPECT_TRUE(read.ok()) << (read.ok() ? "" : read.error().detail);
    return read.ok() ? *read : SceneDef();
  }
  /// The scene loads with the plain colour, and a warning names file, line and key.
  void isPlain(const std::string& outer, const std::vector<std::string>& words) {
    const SceneDef def = scene(outer);
    ASSERT_EQ(1u, def.bodies.size());
    EXPECT_EQ(Noise::kPlain, def.bodies[0].material.appearance.outer.noise) << outer;
    EXPECT_EQ(nullptr, def.bodies[0].material.appearance.outer.image);
    ASSERT_EQ(1u, def.warnings.size()) << outer;
    for (const std::string& word : words)
      EXPECT_NE(std::string::npos, def.warnings[0].find(word)) << word << " in " << def.warnings[0];
    EXPECT_NE(std::string::npos, def.warnings[0].find("s.yaml:6: "));
    EXPECT_NE(std::string::npos, def.warnings[0].find("he plain colour is used"));
  }
};

TEST_F(ImageKey, IsTakenFromTheFolderOfItsFile) {
  folder.write("scenes/skin.png", pngOf(2, 2, test::ramp(2, 2)));
  folder.write("materials/more.yaml", "leather: {appearance: {inner: {image: hide.png}}}\n");
  folder.write("materials/hide.png", pngOf(3, 1, test::ramp(3, 1)));
  const SceneDef def = scene("image: skin.png, scale: 0.05");
  EXPECT_TRUE(def.warnings.empty()) << def.warnings[0];
  const Look& look = def.bodies[0].material.appearance.outer;
  EXPECT_EQ(Noise::kImage, look.noise);
  ASSERT_TRUE(look.image != nullptr);
  EXPECT_EQ(2u, look.image->width());
  EXPECT_EQ(0.05, look.scale);
  const Look& inner = def.materials.at("leather").appearance.inner;
  ASSERT_TRUE(inner.image != nullptr);
  EXPECT_EQ(3u, inner.image->width());
}

TEST_F(ImageKey, WhatCannotBeHadIsPlainAndSaid) {
  folder.write("scenes/text.png", "no image");
  folder.write("scenes/huge.png", claiming(5000, 5000));
  isPlain("image: no_such.png", {"image of outer: ", "there is no file 'no_such.png'"});
  isPlain("image: text.png", {"image of outer: 'text.png' is no image; accepted: PNG and JPEG"});
  isPlain("image: huge.png", {"'huge.png' is 5000 x 5000 pixels; accepted: up to 16777216"});
  isPlain("image: /etc/hostname", {"outside the folders that may be read"});
  isPlain("noise: lobuels", {"unknown noise 'lobuels' of outer, did you mean 'lobules'", "accepted: plain, veins"});
  isPlain("noise: image", {"unknown noise 'image'"});
}

TEST_F(ImageKey, IsInPlaceOfANoise) {
  folder.write("skin.png", pngOf(2, 2, test::ramp(2, 2)));
  ImageFiles images(access);
  std::vector<std::string> warnings;
  const auto changed = [&](const Material& base, const std::string& outer) {
    return changeMaterial(base, "appearance: {outer: {" + outer + "}}", images, folder.path(), warnings);
  };
  const auto image = changed(*changed(Material(), "noise: fat"), "image: skin.png");
  ASSERT_TRUE(image.ok()) << image.error().detail;
  EXPECT_EQ(Noise::kImage, image->appearance.outer.noise);
  const auto coarser = changed(*image, "scale: 0.5");
  ASSERT_TRUE(coarser.ok());
  EXPECT_EQ(Noise::kImage, coarser->appearance.outer.noise);
  const auto noise = changed(*image, "noise: fat");
  ASSERT_TRUE(noise.ok());
  EXPECT_EQ(nullptr, noise->appearance.outer.image);
  EXPECT_TRUE(warnings.empty());
  const auto both = changed(Material(), "noise: fat, image: skin.png");
  ASSERT_FALSE(both.ok());
  EXPECT_NE(std::string::npos, both.error().detail.find("an image and a noise")) << both.error().detail;
}

}  // namespace image_file_test
}  // namespace meshless
