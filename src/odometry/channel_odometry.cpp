// SPDX-License-Identifier: MIT
#include "odometry/channel_odometry.hpp"

#include <utility>

#include "odometry/map_history.hpp"
#include "odometry/road_picture.hpp"
#include "odometry/stopwatch.hpp"
#include "stemvo/check.hpp"
#include "timing/stage_timer.hpp"

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
    : camera_(camera),
      seed_(config.seed),
      asks_road_(config.scale.source == "camera_height"),
      stretch_(with_chosen_upsample(config, camera.width_px).stem),
      front_end_(std::move(front_end)),
      estimator_(config, camera),
      chain_(config.odometry, config.scale) {
  if (config.odometry.mode == "map" || asks_road_) {
    map_.emplace(config, camera);
  }
}

FrameResult ChannelOdometry::process(const Channel& channel, const cv::Mat& frame) {
  follow(prepare(channel, frame));
  place();
  return finish();
}

FrameResult ChannelOdometry::process_missing() {
  follow({});
  place();
  return finish();
}

PreparedFrame ChannelOdometry::prepare(const Channel& channel, const cv::Mat& frame) {
  PreparedFrame prepared;
  prepared.pixels = frame;
  Stopwatch watch;
  const ChannelImage image = timed(Stage::kStretch, [&] { return stretch_.apply(channel); });
  prepared.stem_ms = watch.lap_ms();
  prepared.picture = front_end_->prepare(image);
  if (asks_road_) {
    const StageTimer timer(Stage::kRoadPicture);
    prepared.road = std::make_shared<RoadPicture>(make_road_picture(image, camera_));
  }
  return prepared;
}

/// Uses the front end only: the frame before may be finished meanwhile.
void ChannelOdometry::follow(PreparedFrame frame) {
  STEMVO_CHECK(!followed_.has_value(), "the frame before is placed");
  FrameInWork& work = followed_.emplace();
  work.frame = std::move(frame);
  if (work.frame.picture != nullptr) {
    Stopwatch watch;
    work.matches = front_end_->process(work.frame.picture);
    work.result.times.stem_ms = work.frame.stem_ms;
    work.result.times.features_ms = watch.lap_ms();
  }
}

void ChannelOdometry::place() {
  STEMVO_CHECK(followed_.has_value(), "a frame was followed");
  STEMVO_CHECK(!placed_.has_value(), "the frame before is finished");
  FrameInWork& work = placed_.emplace(*std::exchange(followed_, std::nullopt));
  if (work.frame.picture == nullptr) {
    return;
  }
  work.is_first = !chain_.has_picture();
  if (work.is_first) {
    chain_.start();
    return;
  }
  Stopwatch watch;
  work.motion = estimator_.measure(work.matches.prev_uv, work.matches.cur_uv,
                                   chain_.is_initializing(), seed_);
  if (map_.has_value()) {
    const StageTimer timer(Stage::kPlacement);
    map_->place(frame_number(), chain_.world_from_picture(), work.matches, work.motion);
  }
  front_end_->keep(work.motion.inlier_mask);
  work.result.times.pose_ms = watch.lap_ms();
}

/// Uses all but the front end.
FrameResult ChannelOdometry::finish() {
  STEMVO_CHECK(placed_.has_value(), "a frame was placed");
  FrameInWork work = *std::exchange(placed_, std::nullopt);
  if (work.frame.picture == nullptr) {
    skip(work);
  } else {
    refine(work);
  }
  work.result.world_from_camera = chain_.world_from_camera();
  poses_.push_back(work.result.world_from_camera);
  if (work.frame.picture == nullptr) {  // pictures go on showing the last one there was
    work.frame.picture = finished_.frame.picture;
  }
  finished_ = std::move(work);
  return finished_.result;
}

void ChannelOdometry::refine(FrameInWork& work) {
  const RoadPicture no_road;
  const RoadPicture& road = work.frame.road != nullptr ? *work.frame.road : no_road;
  FrameResult& result = work.result;
  if (work.is_first) {
    if (map_.has_value()) {
      map_->restart(frame_number(), road);
    }
    add_road(result);
    return;
  }
  Stopwatch watch;
  if (map_.has_value()) {
    map_->refine(road, work.matches, work.motion);
    map_->look(work.frame.pixels);
  }
  result.state = chain_.add(work.motion);
  result.times.pose_ms += watch.lap_ms();
  result.num_matches = static_cast<int>(work.matches.cur_uv.size());
  result.num_inliers = work.motion.num_inliers;
  result.homography_score = work.motion.homography_score;
  result.fundamental_score = work.motion.fundamental_score;
  result.homography_ratio = work.motion.homography_ratio;
  result.model = work.motion.model;
  add_road(result);
}

void ChannelOdometry::skip(FrameInWork& work) {
  chain_.extrapolate(/*has_picture=*/false);
  FrameResult& result = work.result;
  result.state = FrameState::kBroken;
  result.problem = work.frame.problem;
  add_road(result);
  if (result.road == RoadState::kMeasured) {
    result.road = RoadState::kHeld;
  }
  if (result.road != RoadState::kNotAsked) {
    result.road_reason = "no picture";
  }
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

const ChannelImage& ChannelOdometry::image() const {
  static const ChannelImage no_image;
  const auto& picture = finished_.frame.picture;
  return picture != nullptr ? picture->image : no_image;
}

}  // namespace stemvo
