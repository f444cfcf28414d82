// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include "odometry/map_odometry.hpp"
#include "odometry/motion_chain.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/config.hpp"
#include "stemvo/error.hpp"
#include "stemvo/features/front_end.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/odometry/odometry.hpp"
#include "stemvo/stem/stem.hpp"

namespace stemvo {

/// What the odometry does with one channel after the stem: several of them can share one stem.
/// Movable. The same channels give the same poses, whatever runs beside it.
class ChannelOdometry {
 public:
  /// Error: that of create_front_end. `config.stem` gives the stretch only.
  [[nodiscard]] static Expected<ChannelOdometry> create(const Config& config, const Camera& camera);

  /// The next frame's channel. `frame`, of the camera's size, is where the road is looked at.
  /// `times.stem_ms` of the result is the stretch's alone.
  FrameResult process(const Channel& channel, const cv::Mat& frame);
  /// A frame without a channel: the last motion goes on.
  FrameResult process_missing();

  void keep_landmarks();
  [[nodiscard]] std::vector<MapLandmark> landmarks() const;
  [[nodiscard]] std::vector<Rigid3> refined_trajectory() const;
  /// Of all frames, as they came.
  [[nodiscard]] const std::vector<Rigid3>& poses() const { return poses_; }

  [[nodiscard]] const ChannelImage& image() const { return image_; }
  [[nodiscard]] const Matches& matches() const { return matches_; }
  [[nodiscard]] const std::vector<char>& inlier_mask() const { return motion_.inlier_mask; }

 private:
  ChannelOdometry(const Config& config, const Camera& camera, std::unique_ptr<FrontEnd> front_end);
  /// Of the frame being processed.
  [[nodiscard]] int frame_number() const { return static_cast<int>(poses_.size()); }
  FrameResult process_channel(const Channel& channel, const cv::Mat& frame);
  void measure(const cv::Mat& frame);
  void add_road(FrameResult& result) const;

  std::uint64_t seed_;
  ChannelStretch stretch_;
  std::unique_ptr<FrontEnd> front_end_;
  TwoViewEstimator estimator_;
  MotionChain chain_;
  std::optional<MapOdometry> map_;

  ChannelImage image_;
  Matches matches_;
  MeasuredMotion motion_;
  std::vector<Rigid3> poses_;
};

}  // namespace stemvo
