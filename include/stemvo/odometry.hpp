// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/map.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// The order of a pixel's values. OpenCV's own imread and VideoCapture give kBgr.
enum class PixelOrder { kGray, kRgb, kBgr };

/// Facts on a frame beside its image.
struct FrameHints {
  /// CV_8UC1 of the camera's size, 0 where this frame shows what moves by itself: tracks end there
  /// and none begins. Empty: the mask of create() alone; else both count.
  cv::Mat mask = {};
  /// Rotation since the last frame given, from the camera now to the camera then, e.g. of a gyro:
  /// where points are looked for first, and what a frame without a measurement goes on with. Never
  /// a measurement.
  std::optional<Eigen::Quaterniond> prev_from_cur = std::nullopt;
};

enum class LogLevel { kInfo, kWarning };
/// One line, with the frame's time.
using Log = std::function<void(LogLevel level, const std::string& line)>;

/// The part that Odometry and AsyncOdometry share. Nothing throws for what a caller hands in. Of
/// one that was moved from, what can fail is an Error and the rest is empty.
class OdometryHandle {
 public:
  /// The camera's speed along its path, from wheels, GPS and the like, 1-sigma of m/s (without one:
  /// 2 % of the speed, at least 0.05 m/s); its sign does not count. Lengths are metres from then
  /// on, with the road or without. Speeds are joined by straight lines where they are at most 1.5 s
  /// apart, and count for frames at their times: from the next frame on, up to half a minute late
  /// or ahead. Their errors are taken for independent of each other. Errors: scale.source
  /// constant_speed; numbers that are not finite; a time that is not after the last speed's; a
  /// sigma that is not above 0.
  [[nodiscard]] Status add_speed(double time_s,
                                 double metres_per_s,
                                 std::optional<double> sigma = std::nullopt);
  /// The way of the camera between two times, likewise; 1-sigma in metres. Errors: likewise, and a
  /// time that is not after its beginning, or the end of the last; a distance below 0.
  [[nodiscard]] Status add_distance(double from_s, double to_s, double metres, double sigma);

  /// Is told in words what is odd about the camera, when tracking begins, ends and recovers, when
  /// the scale is believed and when no more, and why a frame could not be seen. Before the first
  /// frame. It may not throw: what it throws is thrown by process(), then and ever after.
  void set_log(Log log);

  /// Landmarks that came, moved or went since `version` of the map; 0: all. They are seen from at
  /// least 4 keyframes under at least 1.5 degrees of parallax, and move until they leave the
  /// window. Mode two_frame has none.
  [[nodiscard]] MapChanges landmarks_since(int version) const;
  /// The keyframes from id `first` on: they stay as they are.
  [[nodiscard]] std::vector<MapKeyframe> keyframes(int first = 0) const;

  /// The points tracked on the last image.
  [[nodiscard]] std::vector<TrackedPoint> tracked_points() const;
  /// The filter's channel of the last image as points are tracked on it: CV_8UC1, own size.
  [[nodiscard]] cv::Mat channel_image() const;

  /// Adjusts all frames so far at once; the odometry goes on as it was. It takes as long as the
  /// map is large. `covariance_of`: frames of keyframes. Errors: nothing is remembered
  /// (odometry.mode two_frame, odometry.loops off); a frame that is no keyframe.
  [[nodiscard]] Expected<AdjustedMap> adjust_map(const std::vector<int>& covariance_of = {}) const;
  /// Writes the map, adjusted, to a file that load_map() reads. Errors: likewise; it cannot be
  /// written.
  [[nodiscard]] Status save_map(const std::filesystem::path& file) const;
  /// Before the first frame: places of that map are recognized, and FrameResult::map_from_world is
  /// where the world lies in it from then on. The camera may be another one. Errors: likewise; a
  /// frame came before; no map, damaged, or one of another channel.
  [[nodiscard]] Status load_map(const std::filesystem::path& file);

 protected:
  struct Impl;
  explicit OdometryHandle(std::unique_ptr<Impl> impl);
  OdometryHandle(OdometryHandle&&) noexcept;
  OdometryHandle& operator=(OdometryHandle&&) noexcept;
  ~OdometryHandle();

  std::unique_ptr<Impl> impl_;
};

/// Monocular visual odometry: images in, poses out, one at a time, no look-ahead.
class Odometry : public OdometryHandle {
 public:
  /// Errors: a camera or an option out of range (named); a network that cannot be loaded or does
  /// not take images of the camera's size; a mask that is not CV_8UC1 of that size. `mask`: 0 where
  /// no points are wanted on any frame; empty: they are everywhere.
  [[nodiscard]] static Expected<Odometry> create(const Camera& camera,
                                                 const Options& options = {},
                                                 const cv::Mat& mask = {});

  /// The next image: CV_8UC1 for kGray, else CV_8UC3, of the camera's size.
  /// The pixels are read before it returns. An image with distortion, or of over 1.5 megapixels, is
  /// first made the one that FrameResult::camera takes; pixels in results are of that one.
  /// `time_s`: when it was taken, seconds of any clock that runs on; frames need not be evenly
  /// spaced, and one that was dropped is a gap. Errors: another type or size; a time that is not
  /// after the last one; hints that do not fit. Nothing changes then.
  [[nodiscard]] Expected<FrameResult> process(const cv::Mat& image,
                                              PixelOrder order,
                                              double time_s,
                                              const FrameHints& hints = {});

  /// A new world, as after create(): the same network and the given camera, whatever was learnt of
  /// it; times may begin anew, versions and ids of the map do.
  void reset();

 private:
  explicit Odometry(std::unique_ptr<Impl> impl);
};

}  // namespace stemvo
