// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "geometry/median.hpp"
#include "odometry/metric_scale.hpp"
#include "odometry/window_estimator.hpp"

namespace stemvo {

// The map that remembers moves the world; a frame ends: its scale, its uncertainty, what is kept of
// it.

namespace {

/// A landmark is not put where a keyframe would see it farther off: the path has no jumps.
constexpr double kMaxPull_px = 2.0;
/// Tracks that do not move are right to so much ..
constexpr double kTracksNoise_px = 0.05;
/// .. and a motion along the optical axis moves them less than one to the side.
constexpr double kHides = 2.0;

}  // namespace

/// The way since the reference of a map to be is known only now: its points tell where it stands.
Rigid3 WindowEstimator::pose_by_reference(const Matches& matches,
                                          const std::map<int, Eigen::Vector3d>& in_camera,
                                          const Rigid3& predicted) const {
  const View& reference = initializer_.reference();
  const std::vector<char> all(matches.prev_uv.size(), 1);
  const Observations points =
      reference.points.empty() ? previous_points(matches, all) : reference.points;
  Window place;
  place.landmarks = in_camera;
  const SeenLandmarks seen = find_seen_landmarks(place, points);
  const auto cur_from_reference = stemvo::localize(seen, Rigid3(), camera(), localization_);
  return is_initializing_ && cur_from_reference.has_value()
             ? reference.world_from_camera * cur_from_reference->world_from_camera.inverse()
             : predicted;
}

void WindowEstimator::close_window() {
  mapper_.close(window_view());
  history_.close(window_);
  window_ = {};
  stand_ = {};
  num_taken_ = 0;
}

bool WindowEstimator::relocate(const Frame& frame,
                               const Observations& now,
                               const Rigid3& predicted) {
  if (frame.pyramid == nullptr) {
    return false;
  }
  const std::optional<Relocation> found = mapper_.locate(
      window_view(), frame.matches, *frame.pyramid, predicted, [&](const auto& in_camera) {
        return pose_by_reference(frame.matches, in_camera, predicted);
      });
  if (!found.has_value()) {
    return false;
  }
  recognized_frame_ = found->frame;
  close_window();
  mapper_.begin_at_relocation();
  map_ids_.go_back_to(found->frame);
  window_.keyframes.push_back({frame.number, found->world_from_camera, now});
  fix_landmarks(window_, camera(), found->landmarks, window_options_.max_reprojection_error_px);
  scale_.restart(frame.road.get(), frame.time_s, true);
  calibration_.restart();
  world_from_camera_ = found->world_from_camera;
  road_pose_ = world_from_camera_;
  motion_.restart();
  is_last_localized_ = false;
  return true;
}

void WindowEstimator::take_in(const Recognition& recognition) {
  if (recognition.frame == -1) {
    return;
  }
  recognized_frame_ = recognition.frame;
  if (recognition.moved.has_value()) {
    const Similarity3& moved = *recognition.moved;
    move(window_, moved);
    history_.rescale(moved.scale);
    scale_.rescale(moved.scale);
    uncertainty_.rescale(moved.scale);
    calibration_.restart();
    for (Rigid3* pose : {&world_from_camera_, &view_.world_from_camera,
                         &moving_view_.world_from_camera, &last_.world_from_camera, &road_pose_}) {
      *pose = moved * *pose;
    }
    moved_to_ = moved * moved_to_;
    motion_.rescale(moved.scale);
    speed_ *= moved.scale;
    moved_ = moved;
    map_ids_.join(recognition.frame);
  }
  fix_landmarks(window_, camera(), recognition.landmarks, kMaxPull_px);
}

/// All but what localize() told.
void WindowEstimator::describe(const Frame& frame, FrameResult& result) {
  result.camera = camera();
  result.radial = calibration_.radial();
  result.camera_sigma = calibration_.camera_sigma();
  result.world_from_camera = world_from_camera_;
  result.is_scale_new = is_localized(frame) && result.state == FrameState::kInitializing;
  scale_.report(result);
  const bool is_guessed = result.state == FrameState::kInitializing ||
                          result.state == FrameState::kLowParallax ||
                          (result.state == FrameState::kRotating && has_had_map());
  result.is_measured = is_measured(result.state) && !(is_initializing_ && is_guessed);
  result.map_id = map_ids_.now();
  result.map_from_world = mapper_.map_from_world();
  result.recognized_frame = recognized_frame_;
  metric_sigma_ = metric_sigma(result);
}

/// The less parallax, the more the motion model counts: at `parallax` 1 it does not.
void WindowEstimator::fuse_with_prediction(const Rigid3& before,
                                           const SeenLandmarks& seen,
                                           double parallax,
                                           const std::optional<double>& still_px) {
  const Matrix6d noise = pose_influences(world_from_camera_.inverse(), seen.points, seen.uv,
                                         camera(), localization_.loss_px)
                             .squared_sum();
  const double weight = std::pow(1.0 - parallax * parallax, 2);
  std::optional<MotionModel::Hold> hold;
  if (still_px) {  // what so little flow may hide
    hold = {before.inverse() * moving_view_.world_from_camera.translation,
            std::max(*still_px, kTracksNoise_px) * kHides * pixel_units(seen)};
  }
  fused_ = motion_.fuse(before.inverse() * world_from_camera_, noise, weight, interval_s_, hold);
  world_from_camera_ = before * fused_->prev_from_cur;
}

void WindowEstimator::measure_covariance(const Frame& frame, LocalizedFrame& localized) {
  FrameResult& result = localized.result;
  const Rigid3 last = trajectory_.empty() ? world_from_camera_ : trajectory_.back();
  const Rigid3 world_from_prev = moved_.has_value() ? *moved_ * last : last;
  const MotionCovariance::Motion motion{
      .state = result.state,
      .is_localized = is_localized(frame),
      .prev_from_cur = world_from_prev.inverse() * world_from_camera_,
      .dt_s = interval_s_,
      .usual_step = speed_ * interval_s_,
      .hidden_px = result.state == FrameState::kStationary ? min_flow_px() : min_way_px(),
      .fused = fused_,
      .faded = motion_.faded(interval_s_),
      .two_view = localized.two_view,
      .camera = result.camera,
      .camera_sigma = result.camera_sigma,
      .scale_sigma = metric_sigma(result)};
  result.motion_covariance = uncertainty_.finish(motion);
  if (moved_.has_value()) {
    // A motion that is returned with a move of the world in it may be wrong by all of that.
    const Rigid3 move = last.inverse() * world_from_prev;
    Eigen::Matrix<double, 6, 1> squares;
    squares << Eigen::Vector3d::Constant(move.translation.squaredNorm()),
        Eigen::Vector3d::Constant(std::pow(move.angle_rad(), 2));
    result.motion_covariance.diagonal() += squares;
  }
}

double WindowEstimator::pixel_units(const SeenLandmarks& seen) const {
  const Rigid3 camera_from_world = world_from_camera_.inverse();
  std::vector<double> depths;
  for (const Eigen::Vector3d& point : seen.points) {
    depths.push_back((camera_from_world * point).z());
  }
  return depths.empty() ? 0.0 : median(std::move(depths)) / camera().mean_focal_px();
}

void WindowEstimator::measure_scale(const Frame& frame, FrameState state) {
  if (!frame.has_image()) {
    scale_.keep_last("no image", frame.time_s);
  } else if (state == FrameState::kLost) {
    scale_.keep_last("lost", frame.time_s);
  } else if (is_initializing_) {
    if (state != FrameState::kFirst) {
      scale_.set_unknown("no map");
    }
  } else {
    const Eigen::Vector3d center = road_pose_.translation;
    const RoadImage road = frame.road ? seen_by(*frame.road, camera()) : RoadImage{};
    const auto landmarks = scale_.asks_road()
                               ? road_landmarks(window_, world_from_camera_, view_.points, camera())
                               : std::vector<RoadLandmark>();
    // A position that a motion model has a share in tells no length.
    const bool is_shared = state == FrameState::kLowParallax || state == FrameState::kRotating ||
                           state == FrameState::kStationary;
    const double position_units = is_shared
                                      ? std::numeric_limits<double>::infinity()
                                      : pixel_units(find_seen_landmarks(window_, view_.points));
    const double factor =
        scale_.measure(frame.road ? &road : nullptr, world_from_camera_.inverse() * road_pose_,
                       frame.time_s, position_units, landmarks);
    if (factor != 1.0) {
      rescale(window_, factor, center);
      history_.rescale(factor);
      calibration_.rescale(factor, center);
      uncertainty_.rescale(factor);
      motion_.rescale(factor);
      for (Eigen::Vector3d* at :
           {&world_from_camera_.translation, &view_.world_from_camera.translation,
            &moving_view_.world_from_camera.translation, &moved_to_}) {
        *at = center + factor * (*at - center);
      }
    }
    road_pose_ = world_from_camera_;
  }
}

/// The pose is final.
void WindowEstimator::remember(const Frame& frame, FrameState state) {
  const bool has_pose = is_localized(frame);
  const bool has_opened = has_pose && state == FrameState::kInitializing;  // and the map with it
  if (has_opened || (has_pose && is_last_localized_)) {
    const View& before = has_opened ? initializer_.reference() : last_;
    const Rigid3 motion = before.world_from_camera.inverse() * world_from_camera_;
    motion_.measured(motion, frame.time_s - before.time_s, fused_.has_value());
    if (before.frame == frame.number - 1) {
      trust_.compare(frame.hints, motion.rotation);
    }
    const double speed = motion_.speed();
    speed_ = speed > 0.0 && state == FrameState::kTracking ? speed : speed_;
  } else if (!has_pose && state != FrameState::kStationary && state != FrameState::kInitializing) {
    motion_.lost(interval_s_);
  }
  if (frame.has_image()) {
    is_last_localized_ = has_pose;
    last_ = {frame.number, world_from_camera_, {}, frame.time_s, frame.road};
  }
  trajectory_.push_back(world_from_camera_);
  history_.end_frame(window_);
  map_ids_.end_frame();
}

}  // namespace stemvo
