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

  /// The next frame's channel; `frame`, of the camera's size, is where landmarks get their colour.
  /// `times.stem_ms` of the result is the stretch's alone.
  FrameResult process(const Channel& channel, const cv::Mat& frame);
  /// A frame without a channel: the last motion goes on.
  FrameResult process_missing();

  /// The parts of process(), as in Odometry.
  [[nodiscard]] PreparedFrame prepare(const Channel& channel, const cv::Mat& frame);
  void follow(PreparedFrame frame);
  void place();
  FrameResult finish();

  void keep_landmarks();
  [[nodiscard]] std::vector<MapLandmark> landmarks() const;
  [[nodiscard]] std::vector<Rigid3> refined_trajectory() const;
  /// Of all frames finished, as they came.
  [[nodiscard]] const std::vector<Rigid3>& poses() const { return poses_; }

  /// Of the last frame finished; the picture of the last one that had one.
  [[nodiscard]] const ChannelImage& image() const;
  [[nodiscard]] const Matches& matches() const { return finished_.matches; }
  [[nodiscard]] const std::vector<char>& inlier_mask() const {
    return finished_.motion.inlier_mask;
  }

 private:
  /// A frame on its way: first its points, then its place, at last what refinement and road add.
  struct FrameInWork {
    PreparedFrame frame;
    Matches matches;
    bool is_first = false;  ///< nothing before it to measure a motion from
    MeasuredMotion motion;
    FrameResult result;
  };

  ChannelOdometry(const Config& config, const Camera& camera, std::unique_ptr<FrontEnd> front_end);
  void refine(FrameInWork& work);
  void skip(FrameInWork& work);
  void add_road(FrameResult& result) const;
  /// Of the frame in work.
  [[nodiscard]] int frame_number() const { return static_cast<int>(poses_.size()); }

  Camera camera_;
  std::uint64_t seed_;
  bool asks_road_;
  ChannelStretch stretch_;
  std::unique_ptr<FrontEnd> front_end_;
  TwoViewEstimator estimator_;
  MotionChain chain_;
  std::optional<MapOdometry> map_;

  std::optional<FrameInWork> followed_;  ///< not placed
  std::optional<FrameInWork> placed_;    ///< not refined
  FrameInWork finished_;                 ///< the last one
  std::vector<Rigid3> poses_;
};

}  // namespace stemvo
