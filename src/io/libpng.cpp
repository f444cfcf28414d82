// SPDX-License-Identifier: MIT
// The part of png.hpp that libpng does: unusual kinds of PNG, and writing.
#include <algorithm>
#include <csetjmp>
#include <cstdlib>
#include <new>
#include <vector>

#include <png.h>

#include "internal_check.hpp"
#include "io/png.hpp"

namespace stemvo::io {
namespace {

/// libpng's state and what it fills. libpng leaves a call that fails by longjmp: past `read`, which
/// owns nothing.
class LibpngReader {
 public:
  LibpngReader(Bytes bytes, bool is_deep)
      : rest_(bytes),
        is_deep_(is_deep),
        png_(png_create_read_struct_2(
            PNG_LIBPNG_VER_STRING,
            nullptr,
            &fail,
            [](auto...) {},
            nullptr,
            &allocate,
            [](png_structp, png_voidp memory) { std::free(memory); })),
        info_(png_ != nullptr ? png_create_info_struct(png_) : nullptr) {
    if (info_ == nullptr) {
      throw std::bad_alloc();
    }
    png_set_read_fn(png_, this, &give);
  }
  ~LibpngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  LibpngReader(const LibpngReader&) = delete;
  LibpngReader& operator=(const LibpngReader&) = delete;

  /// Empty: damaged.
  [[nodiscard]] cv::Mat decode(bool as_color) { return read(as_color) ? image_ : cv::Mat(); }

 private:
  bool read(bool as_color) {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    png_read_info(png_, info_);
    choose_output(as_color);
    image_.create(static_cast<int>(png_get_image_height(png_, info_)),
                  static_cast<int>(png_get_image_width(png_, info_)),
                  CV_MAKETYPE(is_deep_ ? CV_16U : CV_8U, as_color ? 3 : 1));
    for (int v = 0; v < image_.rows; ++v) {
      rows_.push_back(image_.ptr(v));
    }
    png_read_image(png_, rows_.data());
    png_read_end(png_, nullptr);
    return true;
  }
  /// Pixels of 8 or 16 bits, gray or RGB, without transparency.
  void choose_output(bool as_color) {
    const bool is_color = (png_get_color_type(png_, info_) & PNG_COLOR_MASK_COLOR) != 0;
    png_set_expand(png_);
    if (is_deep_) {
      png_set_swap(png_);  // PNG's bytes are in the other order than a PC's
    } else {
      png_set_strip_16(png_);
    }
    png_set_strip_alpha(png_);
    if (as_color && !is_color) {
      png_set_gray_to_rgb(png_);
    } else if (!as_color && is_color) {
      png_set_rgb_to_gray(png_, PNG_ERROR_ACTION_NONE, 0.299, 0.587);  // ITU-R BT.601
    }
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
  }
  /// libpng 1.6.39 allocates what a chunk's length claims before it reads it, and only warns where
  /// that is over png_set_chunk_malloc_max. Rows of the widest image take half a MiB.
  static png_voidp allocate(png_structp /*png*/, png_alloc_size_t size) {
    constexpr png_alloc_size_t kMaxSize = 1U << 23U;
    return size > kMaxSize ? nullptr : std::malloc(size);
  }
  [[noreturn]] static void fail(png_structp png, png_const_charp /*message*/) {
    png_longjmp(png, 1);
  }
  static void give(png_structp png, png_bytep to, std::size_t size) {
    Bytes& rest = static_cast<LibpngReader*>(png_get_io_ptr(png))->rest_;
    if (size > rest.size()) {
      png_error(png, "cut off");
    }
    std::copy_n(rest.begin(), size, to);
    rest = rest.subspan(size);
  }

  Bytes rest_;
  bool is_deep_;
  cv::Mat image_;
  std::vector<png_bytep> rows_;
  png_structp png_;
  png_infop info_;
};

}  // namespace

cv::Mat decode_any_png(Bytes bytes, bool as_color, bool keeps_16_bits) {
  return LibpngReader(bytes, keeps_16_bits && is_16_bit_png(bytes)).decode(as_color);
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
