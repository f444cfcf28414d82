// SPDX-License-Identifier: MIT
#include "odometry/window_estimator.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <utility>

#include "geometry/median.hpp"
#include "odometry/road_landmarks.hpp"
#include "odometry/tracks.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// A new keyframe: so much parallax to the last one, pixels of a camera of focal length 718 ..
constexpr double kKeyframeParallax_px = 5.0;
constexpr double kFocal_px = 718.0;
/// .. or less than this share of its tracks left.
constexpr double kMinOverlap = 0.6;
/// .. or, where the camera moves, less than this share of the tracks are landmarks.
constexpr double kMinLandmarkShare = 0.3;
/// A motion that explains less than this share of the matches is none: the frame shows another
/// scene.
constexpr double kMinExplained = 0.5;
/// A camera that was still is believed to move from so many times the flow on.
constexpr double kHysteresis = 1.5;
/// So many times the flow of a stationary frame is what errors of landmarks do to one that turns.
constexpr double kTurnFlow = 3.0;

}  // namespace

WindowEstimator::WindowEstimator(const Options& config, const Camera& camera)
    : options_(config.odometry),
      refine_every_(config.ba.every_n_keyframes),
      keyframe_parallax_px_(kKeyframeParallax_px * camera.mean_focal_px() / kFocal_px),
      initializer_(config),
      moving_(config),
      mapper_(config),
      scale_(config),
      calibration_(camera, config.camera.refine, config.threads != 1),
      assumed_step_(assumed_step(config.scale)) {
  window_options_.num_keyframes = config.window.num_keyframes;
  refinement_.loss_scale_px = config.ba.loss_px;
  refinement_.max_iterations = config.ba.max_iterations;
  localization_.loss_px = config.ba.loss_px;
  localization_.seed = config.seed;
}

LocalizedFrame WindowEstimator::localize(const Frame& frame) {
  advance_to(frame.time_s);
  recognized_frame_ = -1;
  moved_.reset();
  LocalizedFrame localized;
  FrameResult& result = localized.result;
  std::vector<char>& mask = localized.inlier_mask;
  mask.assign(frame.matches.cur_uv.size(), 1);
  moving_.leave_out(frame.matches, mask);
  result.state = find_pose(frame, localized);
  was_static_ = frame.has_image() ? result.state != FrameState::kTracking : was_static_;
  result.num_matches = static_cast<int>(mask.size());
  result.num_inliers = static_cast<int>(std::count(mask.begin(), mask.end(), char{1}));
  if (frame.has_image() && !is_initializing_) {
    localized.projections =
        project_lost_landmarks(window_, world_from_camera_, last_moving_.points, camera());
  }
  return localized;
}

void WindowEstimator::advance_to(double time_s) {
  if (!times_s_.empty()) {
    interval_s_ = time_s - times_s_.back();
    speed_ = speed_ > 0.0 ? speed_ : assumed_step_ / interval_s_;
  }
  times_s_.push_back(time_s);
}

FrameState WindowEstimator::find_pose(const Frame& frame, LocalizedFrame& localized) {
  if (!frame.has_image()) {
    world_from_camera_ = predict(trust_.trusted(frame.hints));
    return FrameState::kNoImage;
  }
  if (last_.frame < 0) {
    reset_reference({frame.number, world_from_camera_, {}, frame.time_s, frame.road});
    scale_.restart(frame.road.get(), frame.time_s);
    return FrameState::kFirst;
  }
  std::optional<StageTimer> timer;
  const Observations now = current_points(frame.matches, localized.inlier_mask);
  if (!is_initializing_) {
    timer.emplace(Stage::kLocalization);
    if (is_stationary(last_moving_.points, now, min_flow_px(), options_.min_inliers)) {
      world_from_camera_ = last_moving_.world_from_camera;
      return FrameState::kStationary;
    }
  }
  const SeenLandmarks seen = find_seen_landmarks(window_, now);
  const Rigid3 start =
      frame.hints.prev_from_cur
          ? nearer_pose(predict(), predict(frame.hints.prev_from_cur), seen, camera())
          : predict();
  const std::optional<Localization> found = stemvo::localize(seen, start, camera(), localization_);
  if (found.has_value()) {
    return accept_localization(frame, *found, localized);
  }
  return relocate(frame, now, start)
             ? accept_localization(frame, {world_from_camera_, 0}, localized)
             : measure_since_reference(frame, now, localized);
}

FrameState WindowEstimator::accept_localization(const Frame& frame,
                                                const Localization& found,
                                                LocalizedFrame& localized) {
  is_initializing_ = false;
  world_from_camera_ = found.world_from_camera;
  mark_outliers(frame.matches, localization_.inlier_bound_px, localized.inlier_mask);
  follow_things(frame.matches, localized);
  Observations now = current_points(frame.matches, localized.inlier_mask);
  const Rigid3 before = last_moving_.world_from_camera;
  const double bound_px = kTurnFlow * min_flow_px();
  std::optional<Rigid3> turned;
  if (is_last_localized_) {
    turned = rotation_only_pose(world_from_camera_, before.translation,
                                find_seen_landmarks(window_, now), camera(), bound_px,
                                localization_.inlier_bound_px);
  }
  world_from_camera_ = turned.value_or(world_from_camera_);
  last_moving_ = {frame.number, world_from_camera_, std::move(now), frame.time_s};
  if (!turned.has_value()) {
    return FrameState::kTracking;
  }
  const double turn_px =
      camera().mean_focal_px() * before.rotation.angularDistance(turned->rotation);
  return turn_px < bound_px ? FrameState::kLowParallax : FrameState::kRotating;
}

/// There are no landmarks yet, they are out of view, or the frame shows another scene.
FrameState WindowEstimator::measure_since_reference(const Frame& frame,
                                                    const Observations& now,
                                                    LocalizedFrame& localized) {
  const bool had_map = !is_initializing_;
  const View& reference = initializer_.reference();
  const bool starts_elsewhere =
      reference.points.empty() && frame.matches.prev_frame != reference.frame;
  if (had_map || starts_elsewhere || initializer_.lost_reference(now)) {
    reset_reference_before(frame.matches);
  }
  MeasuredMotion motion = initializer_.measure(frame.matches, now, camera());
  const double num_matches = static_cast<double>(frame.matches.cur_uv.size());
  if (had_map && motion.num_inliers < kMinExplained * num_matches) {
    motion.state = FrameState::kLost;
  }
  add_scores(motion, localized.result);
  localized.inlier_mask = motion.inlier_mask;
  localized.moving_mask = motion.moving_mask;
  return accept_motion(frame, motion, localized);
}

/// Turns the motion since the reference into the frame's pose and state.
FrameState WindowEstimator::accept_motion(const Frame& frame,
                                          const MeasuredMotion& motion,
                                          LocalizedFrame& localized) {
  localized.two_view = 2.0 * motion.covariance;  // of both frames, each against the reference
  if (motion.state == FrameState::kLost) {       // the last motion goes on, and no track does
    world_from_camera_ = predict(trust_.trusted(frame.hints));
    reset_reference({frame.number, world_from_camera_, {}, frame.time_s, frame.road});
    std::fill(localized.inlier_mask.begin(), localized.inlier_mask.end(), char{0});
    return FrameState::kLost;
  }
  // The length of the way since the reference is not known: the speed's in the time it moved.
  const View& reference = initializer_.reference();
  const Rigid3 direction = motion.cur_from_prev.inverse();
  const double length = speed_ * (frame.time_s - reference.time_s - still_s_);
  const Rigid3 guess =
      reference.world_from_camera * Rigid3(direction.rotation, length * direction.translation);
  const bool is_tracking = motion.state == FrameState::kTracking;
  if (is_tracking && motion.is_decisive &&
      open_window({frame.number, guess, current_points(frame.matches, motion.inlier_mask),
                   frame.time_s, frame.road})) {
    moving_.begin(frame.matches, motion.moving_mask);
    return FrameState::kInitializing;
  }
  // Until there is a first map, the position is held; later the camera goes on as fast as it was.
  const bool goes_on = !window_.keyframes.empty() && is_tracking;
  world_from_camera_ =
      Rigid3(guess.rotation, goes_on ? guess.translation : world_from_camera_.translation);
  const bool is_still =
      motion.state == FrameState::kStationary || motion.state == FrameState::kRotating;
  still_s_ += is_still ? interval_s_ : 0.0;
  return is_tracking ? FrameState::kInitializing : motion.state;
}

/// The reference is the first keyframe of a map to be. The window, if there is one, stays until the
/// map is: a frame may see it again.
void WindowEstimator::reset_reference(View reference) {
  initializer_.start(std::move(reference));
  still_s_ = 0.0;
  moving_.clear();
  is_initializing_ = true;
}

/// Where the matches start: the frame before, or the last one before trouble.
void WindowEstimator::reset_reference_before(const Matches& matches) {
  const int frame = std::max(matches.prev_frame, 0);
  reset_reference({frame,
                   trajectory_[static_cast<std::size_t>(frame)],
                   {},
                   times_s_[static_cast<std::size_t>(frame)],
                   frame == last_.frame ? last_.road : nullptr});
}

bool WindowEstimator::open_window(View view) {
  const View& reference = initializer_.reference();
  std::optional<Window> window = initializer_.open_window(view, camera(), window_options_);
  if (!window.has_value()) {
    return false;
  }
  mapper_.close(window_view());
  history_.close(window_);
  window_ = std::move(*window);
  const bool has_road = reference.road != nullptr || !scale_.asks_road();
  const View& road_view = has_road ? reference : view;
  scale_.restart(road_view.road.get(), road_view.time_s);
  calibration_.restart();
  road_pose_ = road_view.world_from_camera;
  is_initializing_ = false;
  world_from_camera_ = view.world_from_camera;
  last_moving_ = std::move(view);
  return true;
}

double WindowEstimator::min_flow_px() const {
  return (was_static_ ? kHysteresis : 1.0) * options_.stationary_flow_px;
}

void WindowEstimator::optimize(const Frame& frame, LocalizedFrame& localized) {
  FrameResult& result = localized.result;
  if (!is_initializing_ && frame.has_image()) {
    uncertainty_.localized(result.state, window_, last_moving_.points, world_from_camera_,
                           trajectory_.back(), camera(), localization_.loss_px);
    Keyframe& newest = window_.keyframes.back();
    if (newest.frame == frame.matches.prev_frame) {
      add_begun_points(frame.matches, localized.inlier_mask, newest.points);
    }
    if (result.state == FrameState::kTracking && is_keyframe(last_moving_)) {
      timed(Stage::kWindowRefinement, [&] { add_keyframe(frame); });
    }
  }
  scale_.add(frame.ways);
  measure_scale(frame, result.state);
  scale_.report(result);
  result.camera = camera();
  result.camera_sigma = calibration_.camera_sigma();
  result.world_from_camera = world_from_camera_;
  result.map_from_world = mapper_.map_from_world();
  result.recognized_frame = recognized_frame_;
  metric_sigma_ = metric_sigma(result);
  measure_covariance(frame, localized);
  remember(frame, result.state);
}

void WindowEstimator::measure_covariance(const Frame& frame, LocalizedFrame& localized) {
  FrameResult& result = localized.result;
  const Rigid3 last = trajectory_.empty() ? world_from_camera_ : trajectory_.back();
  const Rigid3 world_from_prev = moved_.has_value() ? *moved_ * last : last;
  const MotionCovariance::Motion motion{
      .state = result.state,
      .is_localized = frame.has_image() && !is_initializing_,
      .prev_from_cur = world_from_prev.inverse() * world_from_camera_,
      .dt_s = interval_s_,
      .usual_step = speed_ * interval_s_,
      .hidden_px = (result.state == FrameState::kStationary ? 1.0 : kTurnFlow) * min_flow_px(),
      .two_view = localized.two_view,
      .camera = result.camera,
      .camera_sigma = result.camera_sigma,
      .scale_sigma = metric_sigma(result)};
  result.motion_covariance = uncertainty_.finish(motion);
  add_move(last.inverse() * world_from_prev, result.motion_covariance);
}

bool WindowEstimator::is_keyframe(const View& view) const {
  const Keyframe& newest = window_.keyframes.back();
  if (newest.frame == view.frame) {
    return false;
  }
  const PointPairs pairs = common_points(newest.points, view.points);
  if (static_cast<double>(pairs.size()) < kMinOverlap * static_cast<double>(newest.points.size())) {
    return true;
  }
  const int num_landmarks = find_seen_landmarks(window_, view.points).size();
  if (num_landmarks < kMinLandmarkShare * static_cast<double>(view.points.size())) {
    return true;
  }
  const Rigid3 cur_from_newest = view.world_from_camera.inverse() * newest.world_from_camera;
  return median_parallax_px(cur_from_newest.rotation, {pairs.prev_uv, pairs.cur_uv}, camera()) >
         keyframe_parallax_px_;
}

void WindowEstimator::add_keyframe(const Frame& frame) {
  Keyframe keyframe{frame.number, world_from_camera_, last_moving_.points};
  const auto length = static_cast<std::size_t>(window_options_.num_keyframes);
  if (window_.keyframes.size() >= length) {
    const std::size_t leaving = leaving_keyframe(window_, keyframe);
    mapper_.leave(window_view(), leaving);
    history_.leave(window_, leaving, keyframe);
  }
  stemvo::add_keyframe(window_, std::move(keyframe), window_options_);
  triangulate_landmarks(window_, camera(), window_options_);
  if (refine_every_ > 0 && ++keyframes_since_refinement_ >= refine_every_) {
    keyframes_since_refinement_ = 0;
    refinement_.num_fixed_poses =
        window_.keyframes.size() < length ? 1 : window_options_.num_keyframes / 2;
    refine_window(window_, camera(), refinement_);
    world_from_camera_ = window_.keyframes.back().world_from_camera;
    last_moving_.world_from_camera = world_from_camera_;
  }
  cull_landmarks(window_, camera(), window_options_);
  uncertainty_.adjusted(window_, last_moving_.points, world_from_camera_, trajectory_.back(),
                        camera(), localization_.loss_px);
  // The newest keyframe but one: it has its new corners.
  calibration_.observe(*std::prev(window_.keyframes.end(), 2), refinement_);
  history_.observe(window_, frame.image);
  take_in(mapper_.observe(window_view(), frame.pyramid));
}

double WindowEstimator::pixel_units() const {
  const Rigid3 camera_from_world = world_from_camera_.inverse();
  std::vector<double> depths;
  for (const Eigen::Vector3d& point : find_seen_landmarks(window_, last_moving_.points).points) {
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
    const auto landmarks = scale_.asks_road() ? road_landmarks(window_, world_from_camera_,
                                                               last_moving_.points, camera())
                                              : std::vector<RoadLandmark>();
    const double factor =
        scale_.measure(frame.road ? &road : nullptr, world_from_camera_.inverse() * road_pose_,
                       frame.time_s, pixel_units(), landmarks);
    if (factor != 1.0) {
      rescale(window_, factor, center);
      history_.rescale(factor);
      calibration_.rescale(factor, center);
      uncertainty_.rescale(factor);
      for (Rigid3* pose : {&world_from_camera_, &last_moving_.world_from_camera}) {
        pose->translation = center + factor * (pose->translation - center);
      }
    }
    road_pose_ = world_from_camera_;
  }
}

/// The pose is final.
void WindowEstimator::remember(const Frame& frame, FrameState state) {
  if (frame.has_image()) {
    const bool is_localized = !is_initializing_;
    const bool has_opened = is_localized && state == FrameState::kInitializing;
    if (has_opened || (is_localized && is_last_localized_)) {
      const View& before = has_opened ? initializer_.reference() : last_;
      velocity_ = Velocity(before.world_from_camera.inverse() * world_from_camera_,
                           frame.time_s - before.time_s);
      if (before.frame == frame.number - 1) {
        trust_.compare(frame.hints,
                       before.world_from_camera.rotation.conjugate() * world_from_camera_.rotation);
      }
      const double speed = velocity_.speed();
      speed_ = speed > 0.0 && state == FrameState::kTracking ? speed : speed_;
    }
    is_last_localized_ = is_localized;
    last_ = {frame.number, world_from_camera_, {}, frame.time_s, frame.road};
  }
  trajectory_.push_back(world_from_camera_);
  history_.end_frame(window_);
}

}  // namespace stemvo
