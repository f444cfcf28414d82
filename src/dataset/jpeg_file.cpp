// SPDX-License-Identifier: MIT
#include "dataset/jpeg_file.hpp"

#include <cstdint>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace stemvo::dataset {
namespace {

constexpr std::uint8_t kMark = 0xff;  // starts a marker
constexpr std::uint8_t kStartOfImage = 0xd8;
constexpr std::uint8_t kEndOfImage = 0xd9;

/// One after the other; a segment's own bytes (thumbnails among them) are jumped over.
class JpegMarkers {
 public:
  explicit JpegMarkers(const Bytes& bytes) : bytes_(bytes) {}

  /// 0: the file ends before another one.
  std::uint8_t next() {
    while (position_ + 1 < bytes_.size()) {
      const std::uint8_t code = bytes_[position_ + 1];
      if (bytes_[position_] != kMark || is_picture_data(code)) {
        ++position_;
        continue;
      }
      segment_ = position_ + 2;
      position_ = segment_ + (code == kEndOfImage ? 0 : length());
      return code;
    }
    return 0;
  }
  /// Byte of the segment of the marker that `next` gave; 0 behind the end of the file.
  [[nodiscard]] std::uint8_t byte(std::size_t at) const {
    return segment_ + at < bytes_.size() ? bytes_[segment_ + at] : 0;
  }

 private:
  /// What 0xff stands before within a picture's data: itself, stuffing and restarts.
  static bool is_picture_data(std::uint8_t code) {
    return code == 0 || code == kMark || (code >= 0xd0 && code <= 0xd7);
  }
  [[nodiscard]] std::size_t length() const { return 256U * byte(0) + byte(1); }

  const Bytes& bytes_;
  std::size_t position_ = 2;  ///< behind the start of the image
  std::size_t segment_ = 0;
};

bool is_complete(const Bytes& bytes) {
  JpegMarkers markers(bytes);
  std::uint8_t code = markers.next();
  while (code != 0 && code != kEndOfImage) {
    code = markers.next();
  }
  return code == kEndOfImage;
}

/// 0xc0 .. 0xcf but three, which define tables.
bool starts_frame(std::uint8_t code) {
  return code >= 0xc0 && code <= 0xcf && code != 0xc4 && code != 0xc8 && code != 0xcc;
}

}  // namespace

bool is_jpeg(const Bytes& bytes) {
  return bytes.size() >= 2 && bytes[0] == kMark && bytes[1] == kStartOfImage;
}

bool is_color_jpeg(const Bytes& bytes) {
  constexpr std::size_t kNumComponents = 7;  // behind length, precision, height and width
  JpegMarkers markers(bytes);
  std::uint8_t code = markers.next();
  while (code != 0 && !starts_frame(code)) {
    code = markers.next();
  }
  return code != 0 && markers.byte(kNumComponents) > 1;
}

Expected<cv::Mat> decode_jpeg(const Bytes& bytes, const std::string& name, bool as_color) {
  if (!is_complete(bytes)) {
    return fail(fmt::format("{}: expected a complete JPEG image, found one cut off after {} bytes",
                            name, bytes.size()));
  }
  cv::Mat image;
  try {
    image = cv::imdecode(bytes, (as_color ? cv::IMREAD_COLOR : cv::IMREAD_GRAYSCALE) |
                                    cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) {
    return fail(fmt::format("{}: expected a sound JPEG image, found damaged data", name));
  }
  if (as_color) {
    cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  }
  return image;
}

}  // namespace stemvo::dataset
