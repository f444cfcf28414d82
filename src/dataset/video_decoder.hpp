// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <functional>

#include <opencv2/core.hpp>

#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// A video file or a live camera. What decodes it is the module src/video_module, loaded when the
/// first video is opened: OpenCV's videoio links 240 libraries, whose start takes longer than a
/// short run on images.
struct VideoDecoder {
  cv::Size size;
  double frame_count = 0.0;  ///< as the container says; 0 or less: it does not say
  double rate_hz = 0.0;      ///< the same
  int turned_deg = 0;        ///< how the container asked for the frames to be turned, and they were
  unsigned gray_bits = 8;    ///< of gray levels in the file; the upper 8 are decoded
  std::function<bool()> grab = nullptr;  ///< the next frame; false: there is none
  /// The frame grabbed last: CV_8UC3, BGR; empty or of another type where it cannot be decoded.
  std::function<cv::Mat()> retrieve = nullptr;
  /// Its time; NaN or not increasing: the container does not say.
  std::function<double()> position_ms = nullptr;
};

/// Adds a frame to a video, CV_8UC3, BGR; an empty one ends the file. False: it is not whole.
using WriteFrame = std::function<bool(const cv::Mat& bgr)>;
/// A video of frames of this size, both sides even; replaces a file. Errors: another ending than
/// .mp4, .mkv, .avi; a place that cannot be written; no encoder.
[[nodiscard]] Expected<WriteFrame> encode_file(const std::filesystem::path& file,
                                               double rate_hz,
                                               const cv::Size& size);

/// The module's symbols. A file or an address by FFmpeg, turned as the container asks unless frames
/// that are not have this size; null: camera `number` of the machine (V4L2), asked for images of
/// this size. `file` is a whole path, or an address. False: nothing there that can be decoded.
extern "C" using OpenDecoder =
    bool(const char* file, int number, const cv::Size& size, VideoDecoder& decoder);
inline constexpr const char* kOpenDecoder = "stemvo_open_decoder";
/// False: no encoder.
extern "C" using OpenWriter =
    bool(const char* file, double rate_hz, const cv::Size& size, WriteFrame& write);
inline constexpr const char* kOpenWriter = "stemvo_open_writer";

}  // namespace stemvo::dataset
