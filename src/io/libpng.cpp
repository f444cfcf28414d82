// SPDX-License-Identifier: MIT
// What of png.hpp libpng does.
#include <algorithm>
#include <csetjmp>
#include <cstring>
#include <new>
#include <vector>

#include <png.h>

#include "internal_check.hpp"
#include "io/png.hpp"

namespace stemvo::io {
namespace {

/// libpng's state. It leaves a call that fails by longjmp: past the two functions with setjmp,
/// which own nothing.
class LibpngReader {
 public:
  explicit LibpngReader(Bytes bytes)
      : rest_(bytes),
        png_(png_create_read_struct(PNG_LIBPNG_VER_STRING, this, &fail, [](auto...) {})),
        info_(png_ != nullptr ? png_create_info_struct(png_) : nullptr) {
    if (info_ == nullptr) {
      throw std::bad_alloc();
    }
    png_set_read_fn(png_, this, &give);
  }
  ~LibpngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  LibpngReader(const LibpngReader&) = delete;
  LibpngReader& operator=(const LibpngReader&) = delete;

  /// The header; sets that pixels are 8 bits, gray or RGB, without transparency. False: damaged.
  [[nodiscard]] bool read_header(bool as_color) {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    constexpr png_byte kTexts[] = "zTXt\0iTXt";  // skipped: each would be unpacked to several MB
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, kTexts, 2);
    png_read_info(png_, info_);
    const bool is_color = (png_get_color_type(png_, info_) & PNG_COLOR_MASK_COLOR) != 0;
    png_set_expand(png_);
    png_set_strip_16(png_);
    png_set_strip_alpha(png_);
    if (as_color && !is_color) {
      png_set_gray_to_rgb(png_);
    } else if (!as_color && is_color) {
      png_set_rgb_to_gray(png_, PNG_ERROR_ACTION_NONE, 0.299, 0.587);  // ITU-R BT.601
    }
    num_passes_ = png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }
  [[nodiscard]] cv::Size size() const {
    return {static_cast<int>(png_get_image_width(png_, info_)),
            static_cast<int>(png_get_image_height(png_, info_))};
  }
  [[nodiscard]] bool read_rows(std::vector<png_bytep>& rows) {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    read_passes(rows);
    png_read_end(png_, nullptr);
    return true;
  }
  [[nodiscard]] bool lacks_memory() const { return lacks_memory_; }

 private:
  static constexpr png_uint_32 kPixels = 0x49444154;  ///< IDAT

  void read_passes(std::vector<png_bytep>& rows) {
    for (int pass = 1; pass <= num_passes_; ++pass) {
      png_read_rows(png_, rows.data(), nullptr, static_cast<png_uint_32>(rows.size() - 1));
      is_last_row_ = pass == num_passes_;
      png_read_row(png_, rows.back(), nullptr);
    }
  }
  /// Packed: what the last row, and the end of the stream, can take.
  [[nodiscard]] std::size_t max_bytes_at_end() const {
    return (1U << 13U) + 9 * std::size_t{png_get_image_width(png_, info_)};
  }
  [[noreturn]] static void fail(png_structp png, png_const_charp message) {
    auto* self = static_cast<LibpngReader*>(png_get_error_ptr(png));
    self->lacks_memory_ = std::strstr(message, "memory") != nullptr;
    png_longjmp(png, 1);
  }
  static void give(png_structp png, png_bytep to, std::size_t size) {
    auto* self = static_cast<LibpngReader*>(png_get_io_ptr(png));
    if (size > self->rest_.size()) {
      png_error(png, "cut off");
    }
    // With the last row it unpacks, and throws away, all that stands behind it.
    if (self->is_last_row_ && png_get_io_chunk_type(png) == kPixels) {
      self->num_bytes_at_end_ += size;
      if (self->num_bytes_at_end_ > self->max_bytes_at_end()) {
        png_error(png, "more pixels than the header says");
      }
    }
    std::copy_n(self->rest_.begin(), size, to);
    self->rest_ = self->rest_.subspan(size);
  }

  Bytes rest_;
  int num_passes_ = 1;  ///< more: interlaced
  bool is_last_row_ = false;
  std::size_t num_bytes_at_end_ = 0;
  bool lacks_memory_ = false;
  png_structp png_;
  png_infop info_;
};

}  // namespace

cv::Mat decode_any_png(Bytes bytes, bool as_color) {
  LibpngReader reader(bytes);
  cv::Mat image;
  bool is_sound = reader.read_header(as_color);
  if (is_sound) {
    image.create(reader.size(), as_color ? CV_8UC3 : CV_8UC1);
    std::vector<png_bytep> rows;
    for (int v = 0; v < image.rows; ++v) {
      rows.push_back(image.ptr(v));
    }
    is_sound = reader.read_rows(rows);
  }
  if (reader.lacks_memory()) {
    throw std::bad_alloc();  // the file is not to blame
  }
  return is_sound ? image : cv::Mat();
}

std::string encode_png(const cv::Mat& image, bool is_fast) {
  STEMVO_CHECK(!image.empty() && image.isContinuous() &&
                   (image.type() == CV_8UC1 || image.type() == CV_8UC3),
               "an 8-bit image, gray or RGB");
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.cols);
  png.height = static_cast<png_uint_32>(image.rows);
  png.format = image.channels() == 3 ? PNG_FORMAT_RGB : PNG_FORMAT_GRAY;
  png.flags = is_fast ? PNG_IMAGE_FLAG_FAST : 0;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&png, bytes.data(), &size, 0, image.data, 0, nullptr) == 0) {
    throw std::bad_alloc();  // nothing else can fail
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace stemvo::io
