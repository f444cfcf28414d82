// SPDX-License-Identifier: MIT
#include "dataset/video_decoder.hpp"

#include <algorithm>
#include <system_error>

#include <fmt/format.h>

#include "io/loaded_module.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::dataset {

namespace {
constexpr const char* kVideoModule = "libstemvo_video.so";
}  // namespace

Expected<std::optional<VideoDecoder>> open_decoder(const char* file,
                                                   int number,
                                                   const cv::Size& size) {
  static const Expected<void*> found =
      io::load_symbol(kVideoModule, kOpenDecoder, "decodes videos");
  return found.map([&](void* open) {
    std::optional<VideoDecoder> decoder(std::in_place);
    return reinterpret_cast<OpenDecoder*>(open)(file, number, size, *decoder) ? decoder
                                                                              : std::nullopt;
  });
}

Expected<WriteFrame> encode_file(const std::filesystem::path& file,
                                 double rate_hz,
                                 const cv::Size& size) {
  constexpr const char* kEndings[] = {".mp4", ".mkv", ".avi"};
  if (std::ranges::find(kEndings, file.extension()) == std::end(kEndings)) {
    return fail(fmt::format("{}: expected a video to write that ends in .mp4, .mkv or .avi",
                            file.string()));
  }
  STEMVO_TRY(check_can_write(file));
  STEMVO_TRY_GET(void* const found, io::load_symbol(kVideoModule, kOpenWriter, "writes videos"));
  WriteFrame write;
  // A relative path with a colon would be taken for an address.
  std::error_code code;
  const auto whole = std::filesystem::absolute(file, code);
  if (!reinterpret_cast<OpenWriter*>(found)(whole.c_str(), rate_hz, size, write)) {
    return fail(fmt::format(
        "{}: expected an encoder of H.264, MPEG-4 or MJPEG for {}x{} pixels, FFmpeg found none",
        file.string(), size.width, size.height));
  }
  return write;
}

}  // namespace stemvo::dataset
