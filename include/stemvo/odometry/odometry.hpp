// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core.hpp>

#include "stemvo/config.hpp"
#include "stemvo/error.hpp"
#include "stemvo/features/front_end.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"
#include "stemvo/geometry/two_view_motion.hpp"
#include "stemvo/stem/stem.hpp"

namespace stemvo {

/// What became of a frame. Every frame has a pose whatever its state.
enum class FrameState {
  kFirst,         ///< the world's origin
  kInitializing,  ///< no landmarks yet: the initial H/F selection waits for parallax, or decided
  kTracking,      ///< rotation and translation measured
  kStationary,    ///< no motion
  kLowParallax,   ///< rotation measured; too little parallax for a translation
  kRotating,      ///< pure rotation measured
  kGated,         ///< two_frame: rotation measured; the forward motion gate refused the direction
  kLost,          ///< nothing measured: the last motion is continued
  kNoImage,       ///< nothing to be seen: the last motion is continued
};
[[nodiscard]] std::string_view to_string(FrameState state);
/// All count as measured but gated, lost and no_image.
[[nodiscard]] bool is_measured(FrameState state);

/// What the road told of a frame's scale (`scale.source: camera_height`).
enum class RoadState {
  kDisabled,  ///< the scale comes from elsewhere
  kNone,      ///< no road was measured since the map started: the scale is a guess
  kHeld,      ///< measured before, not on this frame: the last scale is kept, its sigma grows
  kMeasured,  ///< measured on this frame and believed
};
/// `disabled`, `none`, `held`, `measured`.
[[nodiscard]] std::string_view to_string(RoadState state);

/// Milliseconds per stage of one frame. Stages of different frames overlap: their sum is no frame's
/// time.
struct StageTimes {
  double stem_ms = 0.0;
  double features_ms = 0.0;
  double pose_ms = 0.0;
};

struct RoadPicture;

/// A frame as far as it can be made without a pose: seen through the channel. Without a picture it
/// stands for a frame that could not be read.
struct PreparedFrame {
  cv::Mat pixels;                                  ///< as given
  std::shared_ptr<const PreparedPicture> picture;  ///< null: could not be read, or see problem
  std::shared_ptr<const RoadPicture> road;         ///< null: the road is not asked
  std::string problem;                             ///< why the stem gave no channel, else empty
  double stem_ms = 0.0;
};

/// One row of frames.csv.
struct FrameResult {
  FrameState state = FrameState::kFirst;
  Rigid3 world_from_camera;
  int num_matches = 0;
  int num_inliers = 0;
  double homography_score = 0.0;   ///< S_H
  double fundamental_score = 0.0;  ///< S_F
  double homography_ratio = 0.0;   ///< R_H
  TwoViewModel model = TwoViewModel::kNone;
  RoadState road = RoadState::kDisabled;
  std::string_view road_reason;       ///< why the road was not measured, else empty
  std::optional<double> scale_sigma;  ///< of log(metres per unit); nullopt: the road is not asked
  StageTimes times;
  std::string problem;  ///< why the stem gave no channel (the frame counts as broken), else empty
};

/// A landmark of the local map, where it was seen last: in the camera of that frame, in units of
/// the trajectory. refined_trajectory()[frame] * position is its place in the world.
struct MapLandmark {
  int frame = 0;  ///< counted from the first one given
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  std::array<std::uint8_t, 3> rgb{};  ///< of the frame's pixel; gray where the camera is gray
};

/// The facade: frames in, poses out, one at a time, no look-ahead.
class Odometry {
 public:
  /// Loads the model. Errors: those of Stem::create and create_front_end, and a model that does
  /// not take frames of the camera's size.
  [[nodiscard]] static Expected<Odometry> create(const Config& config,
                                                 const Camera& camera,
                                                 const std::filesystem::path& models_dir);
  Odometry(Odometry&&) noexcept;
  Odometry& operator=(Odometry&&) noexcept;
  ~Odometry();

  /// CV_8UC1 or CV_8UC3 (RGB), of the camera's size (checked).
  [[nodiscard]] FrameResult process(const cv::Mat& frame);
  /// A frame that could not be read: keeps the clock running.
  [[nodiscard]] FrameResult process_missing();

  /// What process() does, in four parts that can work on three frames at a time; the results are
  /// the same. Frames are prepared in their order, one call at a time, which may run ahead of the
  /// others in another thread.
  [[nodiscard]] PreparedFrame prepare(const cv::Mat& frame);
  /// Tracks the points to this frame, once the one before is localized.
  void track(PreparedFrame frame);
  /// Localizes the frame tracked, once the one before is optimized.
  void localize();
  /// Optimizes the frame localized last, and returns its result. May run beside track() of the next
  /// frame, in another thread.
  [[nodiscard]] FrameResult optimize();

  /// One pose per frame so far, as the window last knew them: with its look-ahead.
  /// Mode two_frame refines nothing: the poses as they came.
  [[nodiscard]] std::vector<Rigid3> refined_trajectory() const;

  /// Landmarks seen from at least 3 keyframes under at least 1.5 degrees of parallax, as they were
  /// when they left the window, or are now.
  [[nodiscard]] std::vector<MapLandmark> landmarks() const;

  /// Of the last frame whose result was returned, for pictures.
  [[nodiscard]] const ChannelImage& channel_image() const;
  [[nodiscard]] const Matches& matches() const;
  [[nodiscard]] const std::vector<char>& inlier_mask() const;
  [[nodiscard]] const StemInfo& stem_info() const;

 private:
  struct Impl;
  explicit Odometry(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace stemvo
