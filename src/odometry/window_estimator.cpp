// SPDX-License-Identifier: MIT
#include "odometry/window_estimator.hpp"

#include <cmath>
#include <iterator>
#include <utility>

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
/// A track this near moves as the world does, where a thing is the other choice.
constexpr double kAgrees_px = 1.0;

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
  if (!times_s_.empty()) {
    interval_s_ = frame.time_s - times_s_.back();
    speed_ = speed_ > 0.0 ? speed_ : assumed_step_ / interval_s_;
  }
  times_s_.push_back(frame.time_s);
  radials_.push_back(frame.pyramid ? frame.pyramid->channel.map.lens.k : lens().k);
  recognized_frame_ = -1;
  moved_.reset();
  LocalizedFrame localized;
  FrameResult& result = localized.result;
  std::vector<char>& mask = localized.inlier_mask;
  mask = without(moving_.flags(frame.matches, window_.landmarks),
                 std::vector<char>(frame.matches.cur_uv.size(), 1));
  result.state = find_pose(frame, localized);
  was_static_ = frame.has_image() ? result.state != FrameState::kTracking : was_static_;
  result.num_matches = static_cast<int>(mask.size());
  result.num_inliers = static_cast<int>(std::count(mask.begin(), mask.end(), char{1}));
  if (frame.has_image() && !is_initializing_) {
    const Observations& seen = is_localized(frame) ? view_.points : Observations();
    localized.projections = project_lost_landmarks(window_, world_from_camera_, seen, camera());
    localized.may_be_hidden = stood_;
  }
  return localized;
}

FrameState WindowEstimator::find_pose(const Frame& frame, LocalizedFrame& localized) {
  fused_.reset();
  if (!frame.has_image()) {
    go_on(frame);
    return FrameState::kNoImage;
  }
  if (last_.frame < 0) {
    reset_reference({frame.number, world_from_camera_, {}, frame.time_s, frame.road});
    scale_.restart(frame.road.get(), frame.time_s);
    return FrameState::kFirst;
  }
  std::optional<StageTimer> timer;
  std::optional<double> still_px;
  const Observations now = current_points(frame.matches, localized.inlier_mask);
  if (!is_initializing_) {
    timer.emplace(Stage::kLocalization);
    renew_stand(now);
    still_px = stationary_flow_px(moving_view_.points, now, min_flow_px(), options_.min_inliers);
    if (!still_px) {
      keep_stand();
    }
  }
  const SeenLandmarks seen = find_seen_landmarks(window_, now);
  Rigid3 start = predict();
  for (const auto& turn : {frame.hints.prev_from_cur, image_turn(frame)}) {
    start = turn ? nearer_pose(start, predict(turn), seen, camera()) : start;
  }
  const std::optional<Localization> found = stemvo::localize(seen, start, camera(), localization_);
  // What passes hides the landmarks: more tracks stand than landmarks are left for another pose.
  const int num_found = found ? found->num_inliers : 0;
  if (!still_px && num_standing(frame, now) > std::max(num_found, options_.min_inliers)) {
    if (num_found < options_.min_inliers && frame.time_s - view_.time_s < kHidden_s) {
      renew_stand_behind(frame, now);
    }
    return FrameState::kStationary;
  }
  if (found && !still_px &&
      is_map_of_thing(found->world_from_camera, frame.matches, localized.inlier_mask)) {
    return begin_anew(frame, localized);
  }
  if (found.has_value()) {
    const Rigid3 of_world =
        pose_without_thing(frame, seen, found->world_from_camera, localized.inlier_mask);
    return accept_localization(frame, of_world, still_px, localized);
  }
  if (still_px) {  // few landmarks, but nothing moves
    stood_ = true;
    stand_ = {frame.number, now, stand_.keyframe};
    return FrameState::kStationary;
  }
  if (standing_keyframe(frame, now) == nullptr && relocate(frame, now, start)) {
    return accept_localization(frame, Rigid3(world_from_camera_), {}, localized);
  }
  if (!is_initializing_ && stood_ && frame.time_s - view_.time_s < kHidden_s) {
    // A map on what passes would go where that goes. Landmarks are looked for where they were.
    std::fill(localized.inlier_mask.begin(), localized.inlier_mask.end(), char{0});
    return FrameState::kLost;
  }
  return measure_since_reference(frame, now, localized);
}

FrameState WindowEstimator::accept_localization(const Frame& frame,
                                                const Rigid3& found,
                                                const std::optional<double>& still_px,
                                                LocalizedFrame& localized) {
  is_initializing_ = false;
  const Rigid3 before = std::exchange(world_from_camera_, found);
  mark_outliers(frame.matches, localization_.inlier_bound_px, localized.inlier_mask);
  if (is_since_last(frame.matches) && num_taken_ == 0) {  // else the world were the thing
    moving_.find(frame.matches, localized.inlier_mask);
  }
  if (!moving_.empty()) {  // tracks of things that move on their own go on, and are no inliers
    std::vector<char> fits_world(frame.matches.cur_uv.size(), 1);
    mark_outliers(frame.matches, kAgrees_px, fits_world);
    moving_.observe(frame.matches, fits_world);
    localized.moving_mask = moving_.flags(frame.matches, window_.landmarks);
    localized.inlier_mask = without(localized.moving_mask, localized.inlier_mask);
  }
  Observations now = current_points(frame.matches, localized.inlier_mask);
  const SeenLandmarks seen = find_seen_landmarks(window_, now);
  const double bound_px = min_way_px();
  const std::optional<double> measured_px =
      is_last_localized_ || still_px
          ? parallax_since_px(moved_to_, found, seen, camera(), localization_.inlier_bound_px)
          : std::nullopt;
  double parallax_px = measured_px.value_or(bound_px);
  const bool is_held = still_px && measured_px;  // fewer landmarks give the pose no covariance
  if (is_held) {  // more is an error of the landmarks: few, or all of them far
    parallax_px = std::min(parallax_px, min_flow_px());
  }
  const bool has_moved = parallax_px >= bound_px;
  if (has_moved) {
    moved_to_ = found.translation;
  } else if (last_.frame == frame.number - 1) {
    fuse_with_prediction(before, seen, parallax_px / bound_px, is_held ? still_px : std::nullopt);
  }
  const double turn_px =
      camera().mean_focal_px() * view_.world_from_camera.rotation.angularDistance(found.rotation);
  view_ = {frame.number, world_from_camera_, std::move(now), frame.time_s};
  const bool is_nearly_still = !has_moved && turn_px < bound_px;
  stood_ = still_px || (stood_ && is_nearly_still);
  if (still_px) {
    stand_ = {frame.number, view_.points, stand_.keyframe};
    return FrameState::kStationary;
  }
  moving_view_ = view_;
  return has_moved         ? FrameState::kTracking
         : is_nearly_still ? FrameState::kLowParallax
                           : FrameState::kRotating;
}

void WindowEstimator::mark_outliers(const Matches& matches,
                                    double bound_px,
                                    std::vector<char>& mask) const {
  const Rigid3 camera_from_world = world_from_camera_.inverse();
  if (is_since_last(matches)) {
    mask = epipolar_inliers(camera_from_world * last_.world_from_camera,
                            {matches.prev_uv, matches.cur_uv}, camera(), bound_px);
  }
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const auto landmark = window_.landmarks.find(matches.track_ids[i]);
    if (landmark != window_.landmarks.end()) {
      mask[i] = is_near(camera_from_world, landmark->second, matches.cur_uv[i], camera(), bound_px);
    }
  }
}

/// There are no landmarks yet, they are out of view, or the frame shows another scene.
FrameState WindowEstimator::measure_since_reference(const Frame& frame,
                                                    const Observations& now,
                                                    LocalizedFrame& localized) {
  const bool had_map = !is_initializing_;
  const View& reference = initializer_.reference();
  const bool starts_elsewhere =
      reference.points.empty() && frame.matches.prev_frame != reference.frame;
  const Keyframe* stood = had_map ? standing_keyframe(frame, now) : nullptr;
  if (stood != nullptr) {
    reset_reference({stood->frame, stood->world_from_camera, stood->points,
                     times_s_[slot(stood->frame)], nullptr});
  } else if (had_map || starts_elsewhere || initializer_.lost_reference(now)) {
    // Where the matches start: the frame before, or the last one before trouble.
    const int first = std::max(frame.matches.prev_frame, 0);
    const auto road = first == last_.frame ? last_.road : nullptr;
    reset_reference({first, trajectory_[slot(first)], {}, times_s_[slot(first)], road});
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
    go_on(frame);
    reset_reference({frame.number, world_from_camera_, {}, frame.time_s, frame.road});
    std::fill(localized.inlier_mask.begin(), localized.inlier_mask.end(), char{0});
    return FrameState::kLost;
  }
  const View& reference = initializer_.reference();
  const Rigid3 direction = motion.cur_from_prev.inverse();
  const bool is_tracking = motion.state == FrameState::kTracking;
  const bool is_decisive = is_tracking && motion.is_decisive;
  Observations now = current_points(frame.matches, motion.inlier_mask);
  const std::optional<double> told =
      is_decisive ? length_since_stand(now, motion.cur_from_prev) : std::nullopt;
  // Where nothing tells the length of the way, it is the speed's in the time it moved.
  const double length = told.value_or(speed_ * (frame.time_s - reference.time_s - still_s_));
  const Rigid3 guess =
      reference.world_from_camera * Rigid3(direction.rotation, length * direction.translation);
  View view{frame.number, guess, std::move(now), frame.time_s, frame.road};
  if (told || (is_decisive && !mapper_.may_be_locating() && open_window(view))) {
    world_from_camera_ = guess;
    moved_to_ = guess.translation;
    moving_view_ = view;
    view_ = std::move(view);
    moving_.add(frame.matches, motion.moving_mask);
    stood_ = false;
    is_initializing_ = false;
    if (told) {
      return FrameState::kTracking;
    }
    *localized.two_view += initializer_.opening_error(motion, view_.points, camera());
    return FrameState::kInitializing;
  }
  // Until there is a first map, the position is held; later the camera goes on as it was seen to.
  const bool is_still = motion.state == FrameState::kStationary ||
                        (motion.state == FrameState::kRotating && !has_had_map());
  double moving_s = is_still ? 0.0 : interval_s_;
  Eigen::Vector3d position = world_from_camera_.translation;
  if (has_had_map() && is_tracking) {
    position = guess.translation;
  } else if (has_had_map() && !is_still) {
    position = predict().translation;
    moving_s = std::min(interval_s_, (position - world_from_camera_.translation).norm() / speed_);
  }
  still_s_ += interval_s_ - moving_s;
  world_from_camera_ = Rigid3(guess.rotation, position);
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

bool WindowEstimator::open_window(const View& view) {
  const View& reference = initializer_.reference();
  std::optional<Window> window = initializer_.open_window(view, camera(), window_options_);
  if (!window.has_value()) {
    return false;
  }
  close_window();
  window_ = std::move(*window);
  map_ids_.begin();
  const bool has_road = reference.road != nullptr || !scale_.asks_road();
  const View& road_view = has_road ? reference : view;
  scale_.restart(road_view.road.get(), road_view.time_s);
  calibration_.restart();
  road_pose_ = road_view.world_from_camera;
  return true;
}

double WindowEstimator::min_flow_px() const {
  return (was_static_ ? kHysteresis : 1.0) * options_.stationary_flow_px;
}

double WindowEstimator::min_way_px() const { return kTurnFlow * min_flow_px(); }

void WindowEstimator::optimize(const Frame& frame, LocalizedFrame& localized) {
  FrameResult& result = localized.result;
  if (!is_initializing_ && frame.has_image()) {
    Keyframe& newest = window_.keyframes.back();
    if (newest.frame == frame.matches.prev_frame) {
      add_begun_points(frame.matches, localized.inlier_mask, newest.points);
      history_.window_moved();  // landmarks are placed by the newest keyframe that shows them
    }
  }
  if (is_localized(frame)) {
    uncertainty_.localized(in_map(), view_.points);
    if (result.state == FrameState::kTracking && is_keyframe(view_)) {
      timed(Stage::kWindowRefinement, [&] { add_keyframe(frame); });
    }
  }
  scale_.add(frame.ways);
  measure_scale(frame, result.state);
  describe(frame, result);
  measure_covariance(frame, localized);
  remember(frame, result.state);
}

bool WindowEstimator::is_keyframe(const View& view) const {
  const Keyframe& newest = window_.keyframes.back();
  if (newest.frame == view.frame) {
    return false;
  }
  const Matches pairs = common_points(newest.points, view.points);
  if (static_cast<double>(pairs.cur_uv.size()) <
      kMinOverlap * static_cast<double>(newest.points.size())) {
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

void WindowEstimator::append(Keyframe keyframe) {
  if (window_.keyframes.size() >= static_cast<std::size_t>(window_options_.num_keyframes)) {
    leave(leaving_keyframe(window_, keyframe), keyframe);
  }
  window_.keyframes.push_back(std::move(keyframe));
}

void WindowEstimator::leave(std::size_t leaving, const Keyframe& coming) {
  mapper_.leave(window_view(), leaving);
  history_.leave(window_, leaving, coming);
  drop_keyframe(window_, leaving, coming);
}

void WindowEstimator::add_keyframe(const Frame& frame) {
  append({frame.number, world_from_camera_, view_.points});
  drop_landmarks(window_, select(frame.matches.track_ids, moving_.members(frame.matches)));
  triangulate_landmarks(window_, camera(), window_options_);
  if (refine_every_ > 0 && ++keyframes_since_refinement_ >= refine_every_) {
    keyframes_since_refinement_ = 0;
    const int length = window_options_.num_keyframes;
    refinement_.num_fixed_poses = std::ssize(window_.keyframes) < length ? 1 : length / 2;
    refine_window(window_, camera(), refinement_);
    world_from_camera_ = window_.keyframes.back().world_from_camera;
    view_.world_from_camera = world_from_camera_;
    moving_view_.world_from_camera = world_from_camera_;
  }
  cull_landmarks(window_, camera(), window_options_);
  uncertainty_.adjusted(in_map());
  // The newest keyframe but one: it has its new corners.
  const Keyframe& complete = *std::prev(window_.keyframes.end(), 2);
  calibration_.observe(complete, radials_[static_cast<std::size_t>(complete.frame)], refinement_);
  history_.observe(window_, frame.image);
  take_in(mapper_.observe(window_view(), frame.pyramid));
}

}  // namespace stemvo
