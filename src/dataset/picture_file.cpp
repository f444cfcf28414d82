// SPDX-License-Identifier: MIT
#include "dataset/picture_file.hpp"

#include <fmt/format.h>

#include "dataset/file_bytes.hpp"
#include "dataset/jpeg_file.hpp"
#include "dataset/png_file.hpp"

namespace stemvo::dataset {
namespace {

Expected<cv::Mat> decode(const Bytes& bytes, const std::string& name, bool as_color) {
  if (is_png(bytes)) {
    return decode_png(bytes, name, as_color);
  }
  if (is_jpeg(bytes)) {
    return decode_jpeg(bytes, name, as_color);
  }
  return fail(fmt::format("{}: expected a PNG or JPEG image, found {}", name,
                          bytes.empty() ? "an empty file" : "another kind of file"));
}

}  // namespace

Expected<PictureKind> read_picture_kind(const std::filesystem::path& file) {
  return read_bytes(file, "PNG or JPEG image")
      .and_then([&](const Bytes& bytes) -> Expected<PictureKind> {
        const bool is_color = is_png(bytes) ? is_color_png(bytes) : is_color_jpeg(bytes);
        return decode(bytes, file.string(), is_color).map([&](const cv::Mat& picture) {
          return PictureKind{picture.size(), is_color};
        });
      });
}

Expected<cv::Mat> read_picture(const std::filesystem::path& file, bool as_color) {
  return read_bytes(file, "PNG or JPEG image").and_then([&](const Bytes& bytes) {
    return decode(bytes, file.string(), as_color);
  });
}

}  // namespace stemvo::dataset
