// SPDX-License-Identifier: MIT
#include "odometry/two_view_estimator.hpp"

#include <algorithm>
#include <cmath>

#include "odometry/parallax.hpp"
#include "odometry/robust_models.hpp"
#include "stemvo/check.hpp"
#include "stemvo/geometry/decomposition.hpp"
#include "stemvo/geometry/relative_pose_refinement.hpp"
#include "stemvo/geometry/two_view_motion.hpp"
#include "stemvo/geometry/two_view_scores.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

using Points = std::vector<Eigen::Vector2d>;

/// ORB-SLAM2's acceptance, but the share is of all matches here, outliers included.
constexpr AcceptanceOptions kAcceptance{.min_good_share = 0.5};

/// Once initialised, S_H is only written down: few points of a street lie on one plane, and the
/// estimator would always use all its iterations, and polish each of them.
constexpr int kRecordIterations = 100;
constexpr const char* kRecordEstimator = "ransac";

Points select(std::span<const Eigen::Vector2d> points, const std::vector<char>& mask) {
  Points selected;
  selected.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (mask[i] != 0) {
      selected.push_back(points[i]);
    }
  }
  return selected;
}

}  // namespace

void add_scores(const MeasuredMotion& motion, FrameResult& result) {
  result.homography_score = motion.homography_score;
  result.fundamental_score = motion.fundamental_score;
  result.homography_ratio = motion.homography_ratio;
  result.model = motion.model;
}

TwoViewEstimator::TwoViewEstimator(const Config& config, const Camera& camera)
    : options_(config.two_view), odometry_(config.odometry), camera_(camera) {}

MeasuredMotion TwoViewEstimator::measure(std::span<const Eigen::Vector2d> prev_uv,
                                         std::span<const Eigen::Vector2d> cur_uv,
                                         bool is_initializing,
                                         std::uint64_t seed) const {
  STEMVO_CHECK(prev_uv.size() == cur_uv.size(), "matches come in pairs");
  MeasuredMotion result;
  result.inlier_mask.assign(prev_uv.size(), 0);
  if (static_cast<int>(prev_uv.size()) < odometry_.min_inliers) {
    return result;
  }
  score_models(prev_uv, cur_uv, is_initializing, seed, result);
  if (median_flow_px(prev_uv, cur_uv) < odometry_.stationary_flow_px) {
    result.state = FrameState::kStationary;
    result.inlier_mask.assign(prev_uv.size(), 1);
    result.num_inliers = static_cast<int>(prev_uv.size());
    return result;
  }
  const PointTestOptions test{.sigma_px = options_.sigma_px};
  const bool use_homography = is_initializing && result.homography.has_value() &&
                              result.homography_ratio > options_.homography_ratio;
  std::optional<TwoViewMotion> motion;
  if (use_homography) {
    motion = motion_from_homography(*result.homography, prev_uv, cur_uv, camera_, test);
  }
  if (!motion.has_value() && result.essential.has_value()) {
    motion = motion_from_essential(*result.essential, prev_uv, cur_uv, camera_, test);
  }
  if (!motion.has_value()) {
    return result;
  }
  result.model = motion->model;
  result.cur_from_prev = motion->cur_from_prev;
  result.runner_up_ratio = motion->runner_up_ratio;
  result.is_decisive = is_decisive(*motion, static_cast<int>(prev_uv.size()), kAcceptance);
  result.inlier_mask = motion->good_mask;
  refine(prev_uv, cur_uv, result);
  return result;
}

void TwoViewEstimator::score_models(std::span<const Eigen::Vector2d> prev_uv,
                                    std::span<const Eigen::Vector2d> cur_uv,
                                    bool is_initializing,
                                    std::uint64_t seed,
                                    MeasuredMotion& result) const {
  TwoViewOptions homography_options = options_;
  if (!is_initializing) {
    homography_options.max_iterations = std::min(options_.max_iterations, kRecordIterations);
    homography_options.estimator = kRecordEstimator;
  }
  result.homography = estimate_homography(prev_uv, cur_uv, homography_options, seed);
  std::optional<Eigen::Matrix3d> fundamental;
  if (is_initializing) {
    fundamental = estimate_fundamental(prev_uv, cur_uv, options_, seed);
    if (fundamental.has_value()) {
      result.essential = essential_from_fundamental(*fundamental, camera_);
    }
  } else {
    result.essential = estimate_essential(prev_uv, cur_uv, camera_, options_, seed);
    if (result.essential.has_value()) {
      fundamental = fundamental_from_essential(*result.essential, camera_);
    }
  }
  if (result.homography.has_value()) {
    result.homography_score =
        score_homography(*result.homography, prev_uv, cur_uv, options_.sigma_px).score;
  }
  if (fundamental.has_value()) {
    result.fundamental_score =
        score_fundamental(*fundamental, prev_uv, cur_uv, options_.sigma_px).score;
  }
  result.homography_ratio = homography_ratio(result.homography_score, result.fundamental_score);
}

void TwoViewEstimator::refine(std::span<const Eigen::Vector2d> prev_uv,
                              std::span<const Eigen::Vector2d> cur_uv,
                              MeasuredMotion& result) const {
  const StageTimer timer(Stage::kTwoViewRefinement);
  const RelativePoseRefinementOptions refinement{.loss_scale_px = options_.refine_loss_px};
  for (int round = 0; options_.refine && round < 2; ++round) {
    const Points prev = select(prev_uv, result.inlier_mask);
    const Points cur = select(cur_uv, result.inlier_mask);
    result.cur_from_prev =
        refine_relative_pose(result.cur_from_prev, prev, cur, camera_, refinement).cur_from_prev;
    result.inlier_mask = epipolar_inliers(result.cur_from_prev, prev_uv, cur_uv, camera_,
                                          2.0 * options_.inlier_threshold_px);
  }
  result.num_inliers =
      static_cast<int>(std::count(result.inlier_mask.begin(), result.inlier_mask.end(), char{1}));
  if (result.num_inliers < odometry_.min_inliers) {
    result.cur_from_prev = {};
    result.state = FrameState::kLost;
    return;
  }
  const Points prev = select(prev_uv, result.inlier_mask);
  const Points cur = select(cur_uv, result.inlier_mask);
  const Rigid3 rotation_only =
      refine_rotation(result.cur_from_prev, prev, cur, camera_, refinement).cur_from_prev;
  result.parallax_px = median_parallax_px(rotation_only.rotation, prev, cur, camera_);
  // What the rotation leaves may be nothing but the tracks' noise, which grows with their length.
  const double noise_px = median_epipolar_px(result.cur_from_prev, prev, cur, camera_);
  const bool is_noise = result.parallax_px < std::min(kNoiseParallax * noise_px,  //
                                                      odometry_.min_parallax_px);
  if (result.parallax_px < odometry_.stationary_flow_px || is_noise) {
    result.cur_from_prev = rotation_only;
    result.state = FrameState::kRotating;
  } else if (result.parallax_px < odometry_.min_parallax_px) {
    result.state = FrameState::kLowParallax;
  } else {
    result.state = FrameState::kTracking;
  }
}

}  // namespace stemvo
