// SPDX-License-Identifier: MIT
#include "odometry/map_odometry.hpp"

#include "odometry/motion_chain.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// Without a map a unit is the last step: what drifts is the car's speed, log per frame.
constexpr double kSpeedSigma = 0.02;

MapTrackerOptions tracker_options(const Config& config) {
  MapTrackerOptions options;
  options.use_landmarks = config.odometry.mode == "map";
  options.map.num_keyframes = config.refine.window;
  options.refine_every = config.refine.every;
  options.refinement.loss_scale_px = config.refine.loss_px;
  options.refinement.max_iterations = config.refine.max_iterations;
  options.placement.pose.loss_scale_px = config.refine.loss_px;
  options.placement.seed = config.seed;
  options.epipolar_bound_px = 2.0 * config.two_view.inlier_threshold_px;
  options.first_step = assumed_step(config.scale);
  return options;
}

}  // namespace

MapOdometry::MapOdometry(const Config& config, const Camera& camera)
    : tracker_(camera, tracker_options(config)) {
  if (config.scale.source == "camera_height") {
    RoadOptions options;
    options.camera_height_m = config.scale.camera_height_m;
    if (config.odometry.mode != "map") {
      options.drift_sigma = kSpeedSigma;
    }
    options.use_dense = config.scale.estimators != "points";
    options.use_points = config.scale.estimators != "dense";
    options.join_frames = config.scale.joining;
    road_.emplace(options, camera);
  }
}

void MapOdometry::restart(int frame, const RoadPicture& road) {
  tracker_.restart(frame);
  if (road_.has_value()) {
    road_->restart();
    ask_road(road, {});
  }
}

void MapOdometry::place(int frame,
                        const Rigid3& world_from_prev,
                        const Matches& matches,
                        MeasuredMotion& motion) {
  frame_ = frame;
  world_from_prev_ = world_from_prev;
  is_placed_ = tracker_.place(frame, world_from_prev, matches, motion);
}

void MapOdometry::refine(const RoadPicture& road, const Matches& matches, MeasuredMotion& motion) {
  if (!is_placed_) {
    restart(frame_, road);
    return;
  }
  timed(Stage::kMapRefinement, [&] { tracker_.extend(matches, motion); });
  if (road_.has_value() && !tracker_.keeps_unit()) {
    road_->start_new_unit();
  }
  const Rigid3 cur_from_prev = tracker_.world_from_camera().inverse() * world_from_prev_;
  if (road_.has_value()) {
    make_metric(road, cur_from_prev, world_from_prev_.translation);
  }
  const Rigid3 metric = tracker_.world_from_camera().inverse() * world_from_prev_;
  motion.step = metric.translation.norm();
  if (motion.step > 0.0) {
    motion.cur_from_prev = Rigid3(metric.rotation, metric.translation / motion.step);
  }
}

RoadScaleEstimate MapOdometry::ask_road(const RoadPicture& road, const Rigid3& cur_from_prev) {
  const RoadScaleEstimate estimate =
      timed(Stage::kRoadScale, [&] { return road_->update(road, cur_from_prev); });
  scale_sigma_ = estimate.sigma;
  road_state_ = estimate.is_measured      ? RoadState::kMeasured
                : estimate.is_initialized ? RoadState::kHeld
                                          : RoadState::kNone;
  road_reason_ = estimate.is_measured ? std::string_view() : estimate.reason;
  return estimate;
}

void MapOdometry::make_metric(const RoadPicture& road,
                              const Rigid3& cur_from_prev,
                              const Eigen::Vector3d& center) {
  const RoadScaleEstimate estimate = ask_road(road, cur_from_prev);
  if (estimate.is_initialized) {
    tracker_.rescale(estimate.metres_per_unit, center);
    road_->rescale(estimate.metres_per_unit);
  }
}

}  // namespace stemvo
