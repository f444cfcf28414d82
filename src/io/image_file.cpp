// SPDX-License-Identifier: MIT
#include "io/image_file.hpp"

#include <algorithm>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <turbojpeg.h>

#include "internal_check.hpp"
#include "text/text_file.hpp"

namespace stemvo::io {
namespace {

namespace fs = std::filesystem;

Bytes bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

// JPEG's markers: this byte and a code.
constexpr std::uint8_t kMark = 0xff;
constexpr std::uint8_t kStartOfImage = 0xd8;
constexpr std::uint8_t kEndOfImage = 0xd9;

bool is_jpeg(Bytes bytes) {
  return bytes.size() >= 2 && bytes[0] == kMark && bytes[1] == kStartOfImage;
}

/// The segment behind the first marker of a JPEG that `is_wanted`. The bytes of other segments
/// (thumbnails among them) are skipped.
template <typename Predicate>
std::optional<std::size_t> find_segment(Bytes bytes, const Predicate& is_wanted) {
  const auto byte = [&](std::size_t i) { return i < bytes.size() ? bytes[i] : std::uint8_t{0}; };
  // What the mark stands before within an image's data: itself, stuffing and restarts.
  const auto is_data = [](int code) {
    return code == 0 || code == kMark || (code >= 0xd0 && code <= 0xd7);
  };
  for (std::size_t at = 2; at + 1 < bytes.size();) {
    const std::uint8_t code = bytes[at + 1];
    if (bytes[at] != kMark || is_data(code)) {
      ++at;
    } else if (is_wanted(code)) {
      return at + 2;
    } else {
      at += 2U + (code == kEndOfImage ? 0U : 256U * byte(at + 2) + byte(at + 3));
    }
  }
  return std::nullopt;
}

/// The frame header: length, precision, height, width, number of components. Empty: there is none.
Bytes jpeg_frame(Bytes bytes) {
  constexpr std::size_t kSize = 8;
  const auto frame = find_segment(bytes, [](int code) {  // all but three, which define tables
    return code >= 0xc0 && code <= 0xcf && code != 0xc4 && code != 0xc8 && code != 0xcc;
  });
  return frame && *frame + kSize <= bytes.size() ? bytes.subspan(*frame, kSize) : Bytes();
}

/// More than one component.
bool is_color_jpeg(Bytes bytes) {
  const Bytes frame = jpeg_frame(bytes);
  return !frame.empty() && frame[7] > 1;
}

std::optional<DeclaredSize> jpeg_size(Bytes bytes) {
  const Bytes frame = jpeg_frame(bytes);
  return frame.empty()
             ? std::nullopt
             : std::optional(DeclaredSize{256U * frame[5] + frame[6], 256U * frame[3] + frame[4]});
}

/// By TurboJPEG, which tells damaged data from sound.
class JpegDecoder {
 public:
  explicit JpegDecoder(Bytes bytes) : bytes_(bytes) {
    is_known_ =
        handle_ != nullptr && tjDecompressHeader3(handle_.get(), bytes.data(), bytes.size(),
                                                  &width_, &height_, &subsampling_, &colors_) == 0;
  }

  /// For a printer's four colours: no camera's.
  [[nodiscard]] bool is_print() const { return colors_ == TJCS_CMYK || colors_ == TJCS_YCCK; }
  [[nodiscard]] Status check_size(const std::string& name, const WantedSize& wanted) const {
    const DeclaredSize found{static_cast<std::uint64_t>(width_),
                             static_cast<std::uint64_t>(height_)};
    return is_known_ ? io::check_size(name, found, wanted) : Status();
  }
  /// Empty: damaged.
  [[nodiscard]] cv::Mat decode(bool as_color) {
    if (!is_known_) {
      return {};
    }
    cv::Mat image(height_, width_, as_color ? CV_8UC3 : CV_8UC1);
    const int done = tjDecompress2(handle_.get(), bytes_.data(), bytes_.size(), image.data, width_,
                                   static_cast<int>(image.step), height_,
                                   as_color ? TJPF_RGB : TJPF_GRAY, TJFLAG_LIMITSCANS);
    return done == 0 || changes_no_pixel() ? image : cv::Mat();
  }

 private:
  /// Some cameras leave bytes between the image's data and its end.
  [[nodiscard]] bool changes_no_pixel() {
    return tjGetErrorCode(handle_.get()) == TJERR_WARNING &&
           std::string_view(tjGetErrorStr2(handle_.get())).find("extraneous bytes") !=
               std::string_view::npos;
  }

  Bytes bytes_;
  std::unique_ptr<void, decltype(&tjDestroy)> handle_{tjInitDecompress(), &tjDestroy};
  int width_ = 0;
  int height_ = 0;
  int subsampling_ = 0;
  int colors_ = 0;
  bool is_known_ = false;
};

/// The markers are walked to the end first, because the decoder fills what is missing with gray.
Expected<cv::Mat> decode_jpeg(Bytes bytes,
                              const std::string& name,
                              bool as_color,
                              const WantedSize& wanted) {
  if (!find_segment(bytes, [](int code) { return code == kEndOfImage; })) {
    return fail(fmt::format("{}: expected a complete JPEG image, found one cut off after {} bytes",
                            name, bytes.size()));
  }
  JpegDecoder decoder(bytes);
  if (const Status status = decoder.check_size(name, wanted); !status) {
    return status.error();
  }
  if (decoder.is_print()) {
    return fail(fmt::format("{}: expected a JPEG image in gray or RGB, found CMYK", name));
  }
  cv::Mat image = decoder.decode(as_color);
  if (image.empty()) {
    return fail(fmt::format("{}: expected a sound JPEG image, found damaged data", name));
  }
  return image;
}

/// Of an image file, by its first bytes: no format takes more than 8 bytes for a pixel and a ninth
/// for what is around them, beside what a camera notes.
Expected<int> file_limit_of(Bytes start, const std::string& name, const WantedSize& wanted) {
  constexpr int kNotes_MB = 16;
  constexpr int kUntold_MB = 128;  // the size stands far behind other things
  constexpr std::uint64_t kBytesOfPixel = 9;
  const auto size = is_png(start) ? png_size(start) : jpeg_size(start);
  if (!size) {
    return kUntold_MB;
  }
  return check_size(name, *size, wanted).map([&] {
    const std::uint64_t pixels_MB = kBytesOfPixel * size->width * size->height / 1000000;
    return std::min(kNotes_MB + static_cast<int>(pixels_MB), kMaxFile_MB);
  });
}

/// What `decode` makes of the file's bytes, which are read if the first of them say that it is an
/// image that is wanted. `takes_jpeg`: beside PNG.
template <typename Decode>
auto read_and_decode(const fs::path& file,
                     bool takes_jpeg,
                     const WantedSize& wanted,
                     const Decode& decode) {
  const auto limit = [&](std::string_view text) -> Expected<int> {
    const Bytes start = bytes_of(text);
    const bool is_image = is_png(start) || (takes_jpeg && is_jpeg(start));
    return is_image ? file_limit_of(start, file.string(), wanted)
                    : Expected<int>(decode(start).error());
  };
  return read_text_file(file, limit).and_then([&](const std::string& text) {
    return decode(bytes_of(text));
  });
}

}  // namespace

Expected<cv::Mat> decode_image(Bytes bytes,
                               const std::string& name,
                               bool as_color,
                               const WantedSize& wanted) {
  if (is_png(bytes)) {
    return decode_png(bytes, name, as_color, wanted);
  }
  if (is_jpeg(bytes)) {
    return decode_jpeg(bytes, name, as_color, wanted);
  }
  return fail(fmt::format("{}: expected a PNG or JPEG image, found {}", name,
                          bytes.empty() ? "an empty file" : "another kind of file"));
}

WantedSize declared_size(const fs::path& file) {
  WantedSize found;
  (void)read_text_file(file, [&](std::string_view text) -> Expected<int> {
    const Bytes start = bytes_of(text);
    const auto size = is_png(start) ? png_size(start) : jpeg_size(start);
    if (size && check_size(file.string(), *size, {})) {
      found = cv::Size(static_cast<int>(size->width), static_cast<int>(size->height));
    }
    return fail("not read on");
  });
  return found;
}

Expected<ImageKind> read_image_kind(const fs::path& file, const WantedSize& wanted) {
  return read_and_decode(file, true, wanted, [&](Bytes bytes) {
    const bool is_color = is_png(bytes) ? is_color_png(bytes) : is_color_jpeg(bytes);
    return decode_image(bytes, file.string(), is_color, wanted).map([&](const cv::Mat& image) {
      return ImageKind{image.size(), is_color};
    });
  });
}

Expected<cv::Mat> read_image(const fs::path& file, bool as_color, const WantedSize& wanted) {
  return read_and_decode(file, true, wanted, [&](Bytes bytes) {
    return decode_image(bytes, file.string(), as_color, wanted);
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

Expected<cv::Mat> read_png(const fs::path& file, bool as_color, const WantedSize& wanted) {
  return read_and_decode(file, false, wanted, [&](Bytes bytes) {
    return decode_png(bytes, file.string(), as_color, wanted);
  });
}

}  // namespace stemvo::io
