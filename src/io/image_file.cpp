// SPDX-License-Identifier: MIT
#include "io/image_file.hpp"

#include <algorithm>
#include <bit>
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

int exif_orientation(Bytes bytes) {
  constexpr unsigned kExif = 0x45786966;
  constexpr unsigned kOrientation = 0x112;
  const auto number = [&](std::size_t at, std::size_t size, bool is_little = false) {
    unsigned value = 0;
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t place = at + (is_little ? size - 1 - i : i);
      value = value << 8U | (place < bytes.size() ? bytes[place] : 0U);
    }
    return value;
  };
  // Segments: 0xff, a kind, two bytes of length. EXIF is a TIFF's list of 12 bytes each.
  for (std::size_t at = 2; number(at, 1) == 0xff && number(at + 1, 1) != 0xda;
       at += 2 + number(at + 2, 2)) {
    const std::size_t tiff = at + 10;
    if (number(at + 1, 1) != 0xe1 || number(at + 4, 4) != kExif) {
      continue;
    }
    const bool is_little = number(tiff, 1) == 'I';
    const std::size_t list = tiff + number(tiff + 4, 4, is_little);
    for (std::size_t i = 0; i < number(list, 2, is_little); ++i) {
      const std::size_t entry = list + 2 + 12 * i;
      if (number(entry, 2, is_little) == kOrientation) {
        return static_cast<int>(number(entry + 8, 2, is_little));
      }
    }
  }
  return 1;
}

void measure_levels(const cv::Mat& image, ImageKind& kind) {
  std::vector<std::size_t> counts(1U << 16U);
  for (const std::uint16_t value : cv::Mat_<std::uint16_t>(image.reshape(1))) {
    ++counts[value];
  }
  const std::size_t few = image.total() * static_cast<std::size_t>(image.channels()) / 1000;
  const auto from_end = [&](const auto& first, const auto& last) {
    std::size_t sum = 0;
    return std::find_if(first, last, [&](std::size_t count) { return (sum += count) > few; }) -
           first;
  };
  const auto largest = static_cast<int>(counts.size()) - 1;
  kind.used = Levels{static_cast<int>(from_end(counts.begin(), counts.end())),
                     largest - static_cast<int>(from_end(counts.rbegin(), counts.rend()))};
  const auto peak = std::find_if(counts.rbegin(), counts.rend(), [](auto n) { return n > 0; });
  kind.peak = largest - static_cast<int>(peak - counts.rbegin());
}

Expected<cv::Mat> decode_image(Bytes bytes,
                               const std::string& name,
                               bool as_color,
                               const WantedSize& wanted,
                               const Levels& levels) {
  if (is_png(bytes)) {
    const bool is_stretched = levels != Levels() && is_16_bit_png(bytes);
    STEMVO_TRY_GET(cv::Mat image, decode_png(bytes, name, as_color, wanted, is_stretched));
    if (is_stretched) {
      const double gain = 255.0 / (levels.high - levels.low);
      image.convertTo(image, CV_8U, gain, -gain * levels.low);
    }
    return image;
  }
  if (is_jpeg(bytes)) {
    return JpegDecoder(bytes).decode(name, as_color, wanted);
  }
  return fail(fmt::format("{}: expected a PNG or JPEG image, found {}", name,
                          bytes.empty() ? "an empty file" : "another kind of file"));
}

}  // namespace

Levels used_levels(const std::vector<ImageKind>& kinds) {
  Levels used{65535, 0};
  int peak = 0;
  for (const ImageKind& kind : kinds) {
    if (kind.used) {
      used = {std::min(used.low, kind.used->low), std::max(used.high, kind.used->high)};
      peak = std::max(peak, kind.peak);
    }
  }
  const int top = static_cast<int>(std::bit_ceil(static_cast<unsigned>(peak) + 1U)) - 1;
  const int span = used.high - used.low;
  if (span <= 0 || 4 * span >= top) {
    return span < 0 ? Levels() : Levels{0, std::max(top, 255)};
  }
  return {std::max(0, used.low - span / 2), std::min(65535, used.high + span / 2)};
}

Expected<ImageKind> read_image_kind(const fs::path& file) {
  return read_text_file(file).and_then([&](const std::string& text) {
    const Bytes bytes = bytes_of(text);
    const bool is_color =
        is_png(bytes) ? is_color_png(bytes) : is_jpeg(bytes) && JpegDecoder(bytes).is_color();
    const auto image = is_png(bytes) ? decode_png(bytes, file.string(), is_color, {}, true)
                                     : decode_image(bytes, file.string(), is_color, {}, {});
    return image.map([&](const cv::Mat& pixels) {
      ImageKind kind{.size = pixels.size(), .is_color = is_color, .used = std::nullopt};
      kind.orientation = is_jpeg(bytes) ? exif_orientation(bytes) : 1;
      if (pixels.depth() == CV_16U) {
        measure_levels(pixels, kind);
      }
      return kind;
    });
  });
}

Expected<cv::Mat> read_image(const fs::path& file,
                             bool as_color,
                             const WantedSize& wanted,
                             const Levels& levels) {
  return read_text_file(file).and_then([&](const std::string& text) {
    return decode_image(bytes_of(text), file.string(), as_color, wanted, levels);
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
  return bytes.substr(0, size);  // the buffer is far longer
}

}  // namespace stemvo::io
