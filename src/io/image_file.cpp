// SPDX-License-Identifier: MIT
#include "io/image_file.hpp"

#include <memory>
#include <new>
#include <string_view>

#include <fmt/format.h>
#include <turbojpeg.h>

#include "internal_check.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::io {
namespace {

namespace fs = std::filesystem;

Bytes bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

bool is_jpeg(Bytes bytes) { return bytes.size() >= 2 && bytes[0] == 0xff && bytes[1] == 0xd8; }

/// A JPEG, by TurboJPEG, which tells damaged data from sound.
class JpegDecoder {
 public:
  explicit JpegDecoder(Bytes bytes) : bytes_(bytes) {
    is_known_ =
        handle_ != nullptr && tjDecompressHeader3(handle_.get(), bytes.data(), bytes.size(),
                                                  &width_, &height_, &subsampling_, &colors_) == 0;
  }

  /// False for a damaged header too.
  [[nodiscard]] bool is_color() const { return is_known_ && colors_ != TJCS_GRAY; }

  [[nodiscard]] Expected<cv::Mat> decode(const std::string& name,
                                         bool as_color,
                                         const WantedSize& wanted) {
    if (!is_known_) {
      return damaged(name);
    }
    STEMVO_TRY(check_size(name, {width_, height_}, wanted));
    if (colors_ == TJCS_CMYK || colors_ == TJCS_YCCK) {  // a printer's
      return fail(fmt::format("{}: expected a JPEG image in gray or RGB, found CMYK", name));
    }
    cv::Mat image(height_, width_, as_color ? CV_8UC3 : CV_8UC1);
    const int done = tjDecompress2(handle_.get(), bytes_.data(), bytes_.size(), image.data, width_,
                                   static_cast<int>(image.step), height_,
                                   as_color ? TJPF_RGB : TJPF_GRAY, TJFLAG_LIMITSCANS);
    return done == 0 || changes_no_pixel() ? Expected<cv::Mat>(image) : damaged(name);
  }

 private:
  /// Some cameras leave bytes between the image's data and its end.
  [[nodiscard]] bool changes_no_pixel() {
    return tjGetErrorCode(handle_.get()) == TJERR_WARNING &&
           std::string_view(tjGetErrorStr2(handle_.get())).find("extraneous bytes") !=
               std::string_view::npos;
  }
  [[nodiscard]] Error damaged(const std::string& name) {
    return fail(fmt::format("{}: expected a sound JPEG image, found damaged data ({})", name,
                            tjGetErrorStr2(handle_.get())));
  }

  Bytes bytes_;
  std::unique_ptr<void, decltype(&tjDestroy)> handle_{tjInitDecompress(), &tjDestroy};
  int width_ = 0;
  int height_ = 0;
  int subsampling_ = 0;
  int colors_ = 0;
  bool is_known_ = false;
};

}  // namespace

Expected<cv::Mat> decode_image(Bytes bytes,
                               const std::string& name,
                               bool as_color,
                               const WantedSize& wanted) {
  if (is_png(bytes)) {
    return decode_png(bytes, name, as_color, wanted);
  }
  if (is_jpeg(bytes)) {
    return JpegDecoder(bytes).decode(name, as_color, wanted);
  }
  return fail(fmt::format("{}: expected a PNG or JPEG image, found {}", name,
                          bytes.empty() ? "an empty file" : "another kind of file"));
}

Expected<ImageKind> read_image_kind(const fs::path& file) {
  return read_text_file(file).and_then([&](const std::string& text) {
    const Bytes bytes = bytes_of(text);
    const bool is_color =
        is_png(bytes) ? is_color_png(bytes) : is_jpeg(bytes) && JpegDecoder(bytes).is_color();
    return decode_image(bytes, file.string(), is_color, {}).map([&](const cv::Mat& image) {
      return ImageKind{image.size(), is_color};
    });
  });
}

Expected<cv::Mat> read_image(const fs::path& file, bool as_color, const WantedSize& wanted) {
  return read_text_file(file).and_then([&](const std::string& text) {
    return decode_image(bytes_of(text), file.string(), as_color, wanted);
  });
}

std::string encode_jpeg(const cv::Mat& image, int quality) {
  STEMVO_CHECK(image.type() == CV_8UC1 || image.type() == CV_8UC3, "an 8-bit image, gray or RGB");
  const bool is_color = image.channels() == 3;
  const std::unique_ptr<void, decltype(&tjDestroy)> handle(tjInitCompress(), &tjDestroy);
  const int sampling = is_color ? TJSAMP_420 : TJSAMP_GRAY;
  std::string bytes(tjBufSize(image.cols, image.rows, sampling), '\0');
  auto* out = reinterpret_cast<unsigned char*>(bytes.data());
  unsigned long size = bytes.size();
  if (handle == nullptr ||
      tjCompress2(handle.get(), image.data, image.cols, static_cast<int>(image.step), image.rows,
                  is_color ? TJPF_RGB : TJPF_GRAY, &out, &size, sampling, quality,
                  TJFLAG_NOREALLOC) != 0) {
    throw std::bad_alloc();  // nothing else can fail
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace stemvo::io
