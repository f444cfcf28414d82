// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include <opencv2/core.hpp>

#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// Decodes a video file or a live camera. What does it is the module src/video_module, loaded when
/// the first video is opened: OpenCV's videoio links 240 libraries, whose start takes longer than a
/// short run on images.
class VideoDecoder {
 public:
  VideoDecoder() = default;
  virtual ~VideoDecoder() = default;
  VideoDecoder(const VideoDecoder&) = delete;
  VideoDecoder& operator=(const VideoDecoder&) = delete;

  /// The next frame; false: there is none.
  [[nodiscard]] virtual bool grab() = 0;
  /// The frame grabbed last: CV_8UC3, BGR; empty or of another type where it cannot be decoded.
  [[nodiscard]] virtual cv::Mat retrieve() = 0;

  [[nodiscard]] virtual cv::Size size() const = 0;
  /// As the container says; 0 or less: it does not say.
  [[nodiscard]] virtual double frame_count() const = 0;
  [[nodiscard]] virtual double rate_hz() const = 0;
  /// Time of the frame grabbed last; NaN or not increasing: the container does not say.
  [[nodiscard]] virtual double position_ms() const = 0;
  /// How the container asked for the frames to be turned, and they were.
  [[nodiscard]] virtual double turned_deg() const = 0;
  /// Of gray levels in the file; the upper 8 are decoded.
  [[nodiscard]] virtual unsigned gray_bits() const { return 8; }
};

/// A file or an address by FFmpeg, turned as the container asks unless frames that are not have
/// this size. Null: nothing there that can be decoded. Error: the module is not where it was
/// installed.
[[nodiscard]] Expected<std::unique_ptr<VideoDecoder>> decode_file(const std::string& file,
                                                                  const cv::Size& size);
/// Camera N of the machine (V4L2), asked for images of this size. Null: no such camera. Errors: as
/// above.
[[nodiscard]] Expected<std::unique_ptr<VideoDecoder>> decode_camera(int number,
                                                                    const cv::Size& size);

/// Adds a frame to a video, CV_8UC3, BGR; an empty one ends the file. False: it is not whole.
using WriteFrame = std::function<bool(const cv::Mat& bgr)>;
/// A video of frames of this size, both sides even; replaces a file. Errors: another ending than
/// .mp4, .mkv, .avi; a place that cannot be written; no encoder.
[[nodiscard]] Expected<WriteFrame> encode_file(const std::filesystem::path& file,
                                               double rate_hz,
                                               const cv::Size& size);

/// The module's symbols. The caller owns the decoder; null: it cannot be opened. `file` is a
/// whole path, or an address; without it camera `number`.
extern "C" using OpenDecoder =
    VideoDecoder * (const char* file, int number, int width_px, int height_px);
inline constexpr const char* kOpenDecoder = "stemvo_open_decoder";
/// False: no encoder.
extern "C" using OpenWriter =
    bool(const char* file, double rate_hz, const cv::Size& size, WriteFrame& write);
inline constexpr const char* kOpenWriter = "stemvo_open_writer";

}  // namespace stemvo::dataset
