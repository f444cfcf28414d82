// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include <opencv2/core.hpp>

#include "dataset/video_decoder.hpp"
#include "stemvo/error.hpp"

namespace stemvo::dataset {

/// Frames of a video file or a live camera, decoded one behind the other; none is kept.
class VideoStream {
 public:
  /// `camera:N`, asked for images of this size; an address, live unless what is there says how many
  /// frames it has; a file. Error: nothing that can be decoded.
  [[nodiscard]] static Expected<std::shared_ptr<VideoStream>> open(
      const std::filesystem::path& path, const cv::Size& size);
  /// `is_live`: times are those of the clock, from the first frame on.
  VideoStream(VideoDecoder decoder, std::string name, bool is_live)
      : decoder_(std::move(decoder)), name_(std::move(name)), is_live_(is_live) {}

  /// Decodes and drops frames, before the first is read. Error: none is left to be read.
  [[nodiscard]] Status skip(std::size_t count);

  [[nodiscard]] const VideoDecoder& decoder() const { return decoder_; }
  [[nodiscard]] bool is_live() const { return is_live_; }
  /// As the container says, which may be wrong; 0: it does not say.
  [[nodiscard]] std::size_t expected_frames() const;
  [[nodiscard]] double rate_hz() const;
  /// Frames without a time have this rate, not the container's: FFmpeg makes one up for raw MJPEG.
  void set_counted_rate(double rate_hz) { counted_hz_ = rate_hz; }
  [[nodiscard]] double counted_hz() const { return counted_hz_.value_or(rate_hz()); }

  /// Frame `index`, counted from 0 behind those skipped: CV_8UC3, RGB; empty behind the last one.
  /// Each is read once; several threads may ask for frames that follow one another, and wait for
  /// their turn. Error: a frame that cannot be decoded.
  [[nodiscard]] Expected<cv::Mat> read(std::size_t index);
  /// The time of a frame that was read, in seconds; increasing.
  [[nodiscard]] double time_s(std::size_t index) const;
  /// Frames so far whose time the container does not say: counted from the rate.
  [[nodiscard]] std::size_t num_counted() const;

 private:
  /// With the mutex held.
  [[nodiscard]] bool grab();
  [[nodiscard]] double next_time_s();

  VideoDecoder decoder_;
  std::string name_;
  bool is_live_ = false;
  std::optional<double> counted_hz_;
  std::optional<std::chrono::steady_clock::time_point> started_;

  mutable std::mutex mutex_;
  std::condition_variable turn_;
  std::size_t next_ = 0;     ///< the frame whose turn it is
  bool is_grabbed_ = false;  ///< it waits to be read
  bool is_ended_ = false;
  std::size_t num_counted_ = 0;
  /// Frames since one that had a time: the last ones of a video, which FFmpeg keeps back to put
  /// them into order, have none.
  std::size_t num_untold_ = 0;
  std::optional<double> told_step_s_;  ///< between the last two that had
  std::optional<double> last_time_s_;  ///< of the frame grabbed last
  std::deque<double> times_s_;
};

}  // namespace stemvo::dataset
