// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "mapping/map_file.hpp"
#include "odometry/channel_odometry.hpp"
#include "odometry/frame_view.hpp"
#include "stem/stem.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// Odometry::process in four phases that can work on three frames at a time; the results are the
/// same.
class PhasedOdometry {
 public:
  /// As Odometry::create.
  [[nodiscard]] static Expected<PhasedOdometry> create(const Camera& camera,
                                                       const Options& options,
                                                       const cv::Mat& mask = {});

  /// CV_8UC1 or CV_8UC3 (RGB), of the camera's size (checked). Frames are prepared in their order,
  /// one call at a time, which may run ahead of the others in another thread.
  [[nodiscard]] Frame prepare(const cv::Mat& given, double time_s, const FrameHints& hints = {});
  /// Tracks the points to this frame, once the one before is localized.
  void track(Frame frame) { channel_odometry_.track(std::move(frame)); }
  /// Localizes the frame tracked, once the one before is optimized.
  void localize() { channel_odometry_.localize(); }
  /// Optimizes the frame localized last, and returns its result. May run beside track() of the next
  /// frame, in another thread.
  [[nodiscard]] FrameResult optimize() { return channel_odometry_.optimize(); }

  /// A new world: as create() left it. No frame is between its phases.
  void reset() { channel_odometry_ = ChannelOdometry(options_, view_.camera(), mask_); }

  /// Error: it remembers nothing (odometry.mode two_frame, odometry.loops off). `asked`: for what.
  [[nodiscard]] Status check_remembers(const std::string& asked) const;
  [[nodiscard]] Status save_map(const std::filesystem::path& file, const KeptMap& map) const {
    return write_map_file(file, {channel_name(), map});
  }
  /// The frames that come may recognize what it shows; none has come yet. Errors: as
  /// check_remembers; the file cannot be read, or is of another channel.
  [[nodiscard]] Status load_map(const std::filesystem::path& file);

  [[nodiscard]] const Options& options() const { return options_; }
  /// At least one.
  [[nodiscard]] int num_threads() const { return options_.threads; }
  /// It holds the frames optimized.
  [[nodiscard]] const ChannelOdometry& frames() const { return channel_odometry_; }
  /// The view that images are turned into before anything else sees them.
  [[nodiscard]] const FrameView& view() const { return view_; }
  [[nodiscard]] const StemInfo& stem_info() const { return stem_.info(); }

 private:
  /// The channel that descriptors are made on.
  [[nodiscard]] std::string channel_name() const {
    const StemInfo& info = stem_.info();
    return fmt::format("{}, filter {}, sampled every {} px", info.model, info.filter,
                       info.sampling_px);
  }

  PhasedOdometry(
      const Options& options, const FrameView& view, const cv::Mat& mask, Stem stem, int zoom);

  Options options_;  ///< with the number of threads in place of 0
  FrameView view_;
  cv::Mat mask_;  ///< of the view
  Stem stem_;
  int zoom_;  ///< Stem::frame_zoom
  ChannelOdometry channel_odometry_;
};

}  // namespace stemvo
