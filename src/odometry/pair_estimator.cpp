// SPDX-License-Identifier: MIT
#include "odometry/pair_estimator.hpp"

#include <utility>

namespace stemvo {
namespace {

/// A unit is the last step: what drifts is the car's speed, log per frame.
constexpr double kSpeedSigma = 0.02;

}  // namespace

PairEstimator::PairEstimator(const Config& config, const Camera& camera)
    : two_view_(config, camera),
      chain_(config.odometry, config.scale),
      scale_(config, camera, kSpeedSigma),
      asks_road_(config.scale.source == "camera_height"),
      seed_(config.seed),
      last_step_(assumed_step(config.scale)) {}

LocalizedFrame PairEstimator::localize(const TrackedFrame& frame) {
  motion_ = {};
  is_first_ = frame.has_image && !chain_.has_picture();
  if (is_first_) {
    chain_.start();
  } else if (frame.has_image) {
    if (frame.matches.prev_frame >= 0 && frame.matches.prev_frame != last_image_) {
      chain_.go_back(trajectory_[static_cast<std::size_t>(frame.matches.prev_frame)],
                     frame.number - frame.matches.prev_frame);
    }
    motion_ = two_view_.measure(frame.matches.prev_uv, frame.matches.cur_uv,
                                chain_.is_initializing(), seed_);
  }
  image_before_ = last_image_;
  last_image_ = frame.has_image ? frame.number : last_image_;
  LocalizedFrame localized;
  localized.inlier_mask = motion_.inlier_mask;
  localized.result.num_matches = static_cast<int>(frame.matches.cur_uv.size());
  localized.result.num_inliers = motion_.num_inliers;
  add_scores(motion_, localized.result);
  return localized;
}

void PairEstimator::optimize(const TrackedFrame& frame, LocalizedFrame& localized) {
  FrameResult& result = localized.result;
  if (!frame.has_image) {
    chain_.extrapolate(/*has_picture=*/false);
    scale_.hold("no image");
    result.state = FrameState::kNoImage;
  } else if (is_first_) {
    scale_.restart(frame.road.get());
    result.state = FrameState::kFirst;
  } else {
    measure_step(frame);
    result.state = chain_.add(motion_);
  }
  scale_.report(result);
  result.world_from_camera = chain_.world_from_camera();
  trajectory_.push_back(result.world_from_camera);
}

void PairEstimator::measure_step(const TrackedFrame& frame) {
  if (!asks_road_) {
    return;
  }
  if (motion_.state == FrameState::kLost) {
    scale_.restart(frame.road.get());
    return;
  }
  if (frame.matches.prev_frame != image_before_) {  // the road was last seen elsewhere
    scale_.restart(frame.road.get());
    return;
  }
  const bool has_step = motion_.state == FrameState::kTracking;
  const Rigid3& direction = motion_.cur_from_prev;
  const int num_frames = frame.number - frame.matches.prev_frame;
  const double step = has_step ? num_frames * last_step_ : 0.0;
  last_step_ *=
      scale_.measure(frame.road.get(), Rigid3(direction.rotation, step * direction.translation));
  motion_.step = has_step ? num_frames * last_step_ : 0.0;
}

}  // namespace stemvo
