#include "meshless_surgery/io/image_file.h"

#include <csetjmp>
#include <cstdio>
#include <new>

#include <jpeglib.h>
#include <png.h>

#include "opened_file.h"

namespace meshless {
namespace {

constexpr std::uint64_t kMostBytes = 32u << 20, kMostPixels = 1u << 24;
constexpr int kMostScans = 100;  // of a progressive JPEG: each goes over all pixels

Error unreadable(const std::string& what) { return Error{ErrorCode::kUnreadable, what}; }

Status checkSize(std::uint64_t width, std::uint64_t height) {
  const std::string size = "is " + std::to_string(width) + " x " + std::to_string(height) + " pixels";
  if (width == 0 || height == 0) return unreadable(size);
  if (width > kMostPixels / height) return unreadable(size + "; accepted: up to 16777216 (4096 x 4096)");
  return Done{};
}

Result<ImagePtr> decodePng(std::string_view bytes) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  struct Freed {
    png_image& png;
    ~Freed() { png_image_free(&png); }
  } freed{png};
  const auto damaged = [&] { return unreadable(std::string("is no whole PNG: ") + png.message); };
  if (png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()) == 0) return damaged();
  if (const Status size = checkSize(png.width, png.height); !size) return size.error();
  png.format = PNG_FORMAT_RGBA;  // without a place for opacity, it would be mixed with black
  std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(png));
  if (png_image_finish_read(&png, nullptr, pixels.data(), 0, nullptr) == 0) return damaged();
  const std::size_t count = pixels.size() / 4;
  for (std::size_t k = 0; k < count; ++k)
    for (std::size_t c = 0; c < 3; ++c) pixels[3 * k + c] = pixels[4 * k + c];
  pixels.resize(3 * count);
  return Image::shrunk(png.width, png.height, std::move(pixels));
}

// libjpeg tells of a fault by a function that must not return.
class Jpeg {
 public:
  explicit Jpeg(std::string_view bytes) : bytes_(bytes) {
    info_.err = jpeg_std_error(&errors_.manager);
    errors_.manager.error_exit = [](j_common_ptr info) { giveUp(info); };
    errors_.manager.emit_message = [](j_common_ptr info, int level) {
      if (level < 0) giveUp(info);  // a warning: what follows is made up
    };
    progress_.progress_monitor = [](j_common_ptr info) {
      if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number > kMostScans) giveUp(info, "too many scans");
    };
  }
  ~Jpeg() { jpeg_destroy_decompress(&info_); }
  Jpeg(const Jpeg&) = delete;
  Jpeg& operator=(const Jpeg&) = delete;

  bool begin() {
    if (setjmp(errors_.back)) return false;
    jpeg_create_decompress(&info_);
    info_.progress = &progress_;
    jpeg_mem_src(&info_, reinterpret_cast<const unsigned char*>(bytes_.data()), bytes_.size());
    return jpeg_read_header(&info_, TRUE) == JPEG_HEADER_OK;
  }
  bool read(std::uint8_t* to) {
    if (setjmp(errors_.back)) return false;
    info_.out_color_space = JCS_RGB;
    jpeg_start_decompress(&info_);
    while (info_.output_scanline < info_.output_height) {
      JSAMPROW row = to + 3 * std::size_t{info_.output_width} * info_.output_scanline;
      jpeg_read_scanlines(&info_, &row, 1);
    }
    return jpeg_finish_decompress(&info_) == TRUE;
  }
  std::uint32_t width() const { return info_.image_width; }
  std::uint32_t height() const { return info_.image_height; }
  const char* why() const { return errors_.text; }

 private:
  struct Errors {
    jpeg_error_mgr manager;
    std::jmp_buf back;
    char text[JMSG_LENGTH_MAX];
  };
  static void giveUp(j_common_ptr info, const char* why = nullptr) {
    auto* errors = reinterpret_cast<Errors*>(info->err);  // its first member
    if (why != nullptr)
      std::snprintf(errors->text, sizeof errors->text, "%s", why);
    else
      errors->manager.format_message(info, errors->text);
    std::longjmp(errors->back, 1);
  }

  std::string_view bytes_;
  jpeg_decompress_struct info_{};
  jpeg_progress_mgr progress_{};
  Errors errors_{};
};

Result<ImagePtr> decodeJpeg(std::string_view bytes) {
  Jpeg jpeg(bytes);
  const auto damaged = [&] { return unreadable(std::string("is no whole JPEG: ") + jpeg.why()); };
  if (!jpeg.begin()) return damaged();
  if (const Status size = checkSize(jpeg.width(), jpeg.height()); !size) return size.error();
  std::vector<std::uint8_t> pixels(std::size_t{3} * jpeg.width() * jpeg.height());
  if (!jpeg.read(pixels.data())) return damaged();
  return Image::shrunk(jpeg.width(), jpeg.height(), std::move(pixels));
}

}  // namespace

Result<ImagePtr> readImageFile(const std::string& real_path) {
  const Result<FileBytes> file = readFile(real_path, kMostBytes);
  if (!file) return file.error();
  const std::string_view bytes = file->text();
  try {
    if (bytes.substr(0, 4) == "\x89PNG") return decodePng(bytes);
    if (bytes.substr(0, 3) == "\xff\xd8\xff") return decodeJpeg(bytes);
  } catch (const std::bad_alloc&) {
    return Error{ErrorCode::kFailed, "is too large for the memory there is"};
  }
  return unreadable("is no image; accepted: PNG and JPEG");
}

Result<ImagePtr> ImageFiles::read(const std::string& path, const std::string& base_folder) {
  const Result<std::string> real = access_.resolve(path, base_folder);
  if (!real) return real.error();
  auto found = known_.find(*real);
  if (found == known_.end()) found = known_.emplace(*real, readImageFile(*real)).first;
  if (!found->second) return Error{found->second.error().code, "'" + path + "' " + found->second.error().detail};
  return found->second;
}

}  // namespace meshless
