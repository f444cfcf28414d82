// SPDX-License-Identifier: MIT
#include "odometry/channel_odometry.hpp"

#include <utility>

#include "odometry/map_history.hpp"
#include "odometry/stopwatch.hpp"

namespace stemvo {

Expected<ChannelOdometry> ChannelOdometry::create(const Config& config, const Camera& camera) {
  Expected<std::unique_ptr<FrontEnd>> front_end = create_front_end(config.features);
  if (!front_end.has_value()) {
    return tl::unexpected<Error>(front_end.error());
  }
  return ChannelOdometry(config, camera, std::move(front_end.value()));
}

ChannelOdometry::ChannelOdometry(const Config& config,
                                 const Camera& camera,
                                 std::unique_ptr<FrontEnd> front_end)
    : seed_(config.seed),
      stretch_(config.stem),
      front_end_(std::move(front_end)),
      estimator_(config, camera),
      chain_(config.odometry, config.scale) {
  if (config.odometry.mode == "map" || config.scale.source == "camera_height") {
    map_.emplace(config, camera);
  }
}

FrameResult ChannelOdometry::process(const Channel& channel, const cv::Mat& frame) {
  FrameResult result = process_channel(channel, frame);
  poses_.push_back(result.world_from_camera);
  return result;
}

FrameResult ChannelOdometry::process_channel(const Channel& channel, const cv::Mat& frame) {
  FrameResult result;
  Stopwatch watch;
  image_ = stretch_.apply(channel);
  result.times.stem_ms = watch.lap_ms();
  matches_ = front_end_->process(image_);
  result.times.features_ms = watch.lap_ms();

  if (!chain_.has_picture()) {
    chain_.start();
    if (map_.has_value()) {
      map_->restart(frame_number(), image_);
    }
    add_road(result);
    result.world_from_camera = chain_.world_from_camera();
    return result;
  }
  measure(frame);
  result.state = chain_.add(motion_);
  result.times.pose_ms = watch.lap_ms();

  result.world_from_camera = chain_.world_from_camera();
  result.num_matches = static_cast<int>(matches_.cur_uv.size());
  result.num_inliers = motion_.num_inliers;
  result.homography_score = motion_.homography_score;
  result.fundamental_score = motion_.fundamental_score;
  result.homography_ratio = motion_.homography_ratio;
  result.model = motion_.model;
  add_road(result);
  return result;
}

void ChannelOdometry::measure(const cv::Mat& frame) {
  motion_ = estimator_.measure(matches_.prev_uv, matches_.cur_uv, chain_.is_initializing(), seed_);
  if (map_.has_value()) {
    motion_ = map_->refine(frame_number(), image_, matches_, chain_.world_from_picture(),
                           std::move(motion_));
    map_->look(frame);
  }
  front_end_->keep(motion_.inlier_mask);
}

FrameResult ChannelOdometry::process_missing() {
  chain_.extrapolate(/*has_picture=*/false);
  matches_ = {};
  motion_ = {};
  FrameResult result;
  result.state = FrameState::kBroken;
  result.world_from_camera = chain_.world_from_camera();
  add_road(result);
  if (result.road == RoadState::kMeasured) {
    result.road = RoadState::kHeld;
  }
  if (result.road != RoadState::kNotAsked) {
    result.road_reason = "no picture";
  }
  poses_.push_back(result.world_from_camera);
  return result;
}

void ChannelOdometry::add_road(FrameResult& result) const {
  if (map_.has_value()) {
    result.road = map_->road_state();
    result.road_reason = map_->road_reason();
    result.scale_sigma = map_->scale_sigma();
  }
}

void ChannelOdometry::keep_landmarks() {
  if (map_.has_value()) {
    map_->keep_landmarks();
  }
}

std::vector<MapLandmark> ChannelOdometry::landmarks() const {
  return map_.has_value() ? map_->history().landmarks() : std::vector<MapLandmark>();
}

std::vector<Rigid3> ChannelOdometry::refined_trajectory() const {
  return map_.has_value() ? refined_poses(poses_, map_->history().motions()) : poses_;
}

}  // namespace stemvo
