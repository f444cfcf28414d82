// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "features/front_end.hpp"
#include "geometry/radial_lens.hpp"
#include "odometry/estimator.hpp"
#include "odometry/frame_clock.hpp"
#include "odometry/image_turn.hpp"
#include "stem/stem.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/options.hpp"

namespace stemvo {

/// The odometry of one channel, after the stem: several of them can share one stem.
/// Movable. The same channels give the same poses, whatever runs beside it.
class ChannelOdometry {
 public:
  /// For valid options; `options.stem` gives the contrast only. `mask`: as FrontEnd::set_mask.
  ChannelOdometry(const Options& options, const Camera& camera, const cv::Mat& mask = {});

  /// The phases, as in PhasedOdometry. `image`, of the camera's size, is where landmarks get their
  /// colour; `times.stem_ms` is the contrast's alone.
  [[nodiscard]] Frame prepare(const Channel& channel,
                              const cv::Mat& image,
                              double time_s,
                              const FrameHints& hints = {});
  /// Frames come in the order of their times (checked).
  void track(Frame frame);
  void localize();
  FrameResult optimize();

  /// The last three for one frame; one without an image stands for a frame that could not be read:
  /// the last motion goes on.
  FrameResult process(Frame frame) {
    track(std::move(frame));
    localize();
    return optimize();
  }

  /// As Estimator's.
  void load_map(KeptMap map) {
    estimator_->load_map(std::move(map));
    lens_ = estimator_->lens();
  }

  /// One per frame optimized.
  [[nodiscard]] const std::vector<double>& times_s() const { return times_s_; }
  /// It holds all frames optimized.
  [[nodiscard]] const Estimator& estimator() const { return *estimator_; }

  /// These belong to the last frame optimized; the image to the last one that had one.
  [[nodiscard]] const ChannelImage& image() const {
    static const ChannelImage no_image;
    return optimized_.frame.pyramid != nullptr ? optimized_.frame.pyramid->channel : no_image;
  }
  [[nodiscard]] const Matches& matches() const { return optimized_.frame.matches; }
  [[nodiscard]] const std::vector<char>& inlier_mask() const {
    return optimized_.localized.inlier_mask;
  }

 private:
  struct FrameInWork {
    Frame frame;
    LocalizedFrame localized;
  };

  Camera given_camera_;  ///< the estimator owns the one in use
  bool asks_road_;
  ContrastNormalization contrast_;
  ContrastNormalization road_contrast_;
  std::unique_ptr<FrontEnd> front_end_;
  std::unique_ptr<Estimator> estimator_;

  [[nodiscard]] ImageClue clue_of(Frame& frame);

  ImageTurn image_turn_;
  bool aligns_images_;  ///< for the front end that asks for turns
  double last_image_s_ = 0.0;
  RadialLens lens_;  ///< of the next frame to be tracked: what the one before it was localized by
  int num_tracked_ = 0;
  std::vector<double> times_s_;
  FrameClock clock_;  ///< of the frames tracked
  /// Since the last image, as the frames' hints say; nullopt: one did not.
  std::optional<Eigen::Quaterniond> image_from_tracked_ = Eigen::Quaterniond::Identity();
  std::optional<Frame> tracked_;          ///< not localized
  std::optional<FrameInWork> localized_;  ///< not optimized
  FrameInWork optimized_;                 ///< the last one
};

}  // namespace stemvo
