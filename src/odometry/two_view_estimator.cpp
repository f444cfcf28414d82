// SPDX-License-Identifier: MIT
#include "odometry/two_view_estimator.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "geometry/pose_refinement.hpp"
#include "geometry/two_view_models.hpp"
#include "odometry/check_frame.hpp"
#include "odometry/robust_models.hpp"
#include "odometry/tracks.hpp"
#include "timing/stage_timer.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

/// ORB-SLAM2's acceptance, but the share is of all matches here, outliers included.
constexpr AcceptanceOptions kPairAcceptance{.min_good_share = 0.5};

/// Once initialised, S_H is only written down: few points of a street lie on one plane, and the
/// estimator would always use all its iterations, and polish each of them.
constexpr int kRecordIterations = 100;
constexpr RobustEstimator kRecordEstimator = RobustEstimator::kRansac;

/// Median length of noise in two images over its median distance from epipolar lines: 2.5 where it
/// is equal in all directions (1.177 sqrt(2) / 0.6745), 3-4.5 on rendered turns of 18 px a frame.
/// The slowest steps that can be seen have 10 and more.
constexpr double kNoiseParallax = 5.0;

/// After a cut, points are found by chance here and there; some motion fits a quarter of them.
constexpr double kMinPairInlierShare = 0.3;

Status check_matches(std::span<const Eigen::Vector2d> prev_uv,
                     std::span<const Eigen::Vector2d> cur_uv) {
  if (prev_uv.size() != cur_uv.size()) {
    return fail(
        fmt::format("matches: expected as many points in one image as in the other, found "
                    "{} and {}",
                    prev_uv.size(), cur_uv.size()));
  }
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    if (!prev_uv[i].allFinite() || !cur_uv[i].allFinite()) {
      return fail(
          fmt::format("matches: expected finite pixels, found ({}, {}) and ({}, {}) in match {}",
                      prev_uv[i].x(), prev_uv[i].y(), cur_uv[i].x(), cur_uv[i].y(), i));
    }
  }
  return {};
}

}  // namespace

void add_scores(const MeasuredMotion& motion, FrameResult& result) {
  result.homography_score = motion.homography_score;
  result.fundamental_score = motion.fundamental_score;
  result.homography_ratio = motion.homography_ratio;
  result.model = motion.model;
}

MeasuredMotion TwoViewEstimator::measure(const PixelPairs& pairs,
                                         const Camera& camera,
                                         bool is_initializing) const {
  MeasuredMotion result;
  result.inlier_mask.assign(pairs.size(), 0);
  if (static_cast<int>(pairs.size()) < odometry_.min_inliers) {
    return result;
  }
  score_models(pairs, camera, is_initializing, result);
  if (median_flow_px(pairs) < odometry_.stationary_flow_px) {
    result.state = FrameState::kStationary;
    result.inlier_mask.assign(pairs.size(), 1);
    result.num_inliers = static_cast<int>(pairs.size());
    return result;
  }
  const PointTestOptions test{.sigma_px = options_.sigma_px};
  std::optional<TwoViewMotion> motion;
  if (is_initializing && result.homography.has_value() &&
      result.homography_ratio > options_.homography_ratio) {
    motion = best_motion(TwoViewModel::kHomography,
                         decompose_homography(*result.homography, camera), pairs, camera, test);
  }
  if (!motion.has_value() && result.essential.has_value()) {
    motion = best_motion(TwoViewModel::kEssential, decompose_essential(*result.essential), pairs,
                         camera, test);
  }
  if (!motion.has_value()) {
    return result;
  }
  result.model = motion->model;
  result.cur_from_prev = motion->cur_from_prev;
  result.is_decisive = is_decisive(*motion, static_cast<int>(pairs.size()), kPairAcceptance);
  result.inlier_mask = std::move(motion->test.good_mask);
  refine(pairs, camera, result);
  return result;
}

void TwoViewEstimator::score_models(const PixelPairs& pairs,
                                    const Camera& camera,
                                    bool is_initializing,
                                    MeasuredMotion& result) const {
  TwoViewOptions homography_options = options_;
  std::optional<Eigen::Matrix3d> fundamental;
  if (is_initializing) {
    fundamental = estimate_fundamental(pairs, options_, seed_);
    if (fundamental.has_value()) {
      result.essential = camera.matrix().transpose() * *fundamental * camera.matrix();
    }
  } else {
    homography_options.max_iterations = std::min(options_.max_iterations, kRecordIterations);
    homography_options.estimator = kRecordEstimator;
    result.essential = estimate_essential(pairs, camera, options_, seed_);
    if (result.essential.has_value()) {
      fundamental = fundamental_from_essential(*result.essential, camera);
    }
  }
  result.homography = estimate_homography(pairs, homography_options, seed_);
  if (result.homography.has_value()) {
    result.homography_score = score_homography(*result.homography, pairs, options_.sigma_px).score;
  }
  if (fundamental.has_value()) {
    result.fundamental_score = score_fundamental(*fundamental, pairs, options_.sigma_px).score;
  }
  result.homography_ratio = homography_ratio(result.homography_score, result.fundamental_score);
}

void TwoViewEstimator::refine(const PixelPairs& pairs,
                              const Camera& camera,
                              MeasuredMotion& result) const {
  const StageTimer timer(Stage::kTwoViewRefinement);
  const RefinementOptions refinement{.loss_scale_px = options_.refine_loss_px};
  auto prev = select(pairs.prev_uv, result.inlier_mask);
  auto cur = select(pairs.cur_uv, result.inlier_mask);
  for (int round = 0; options_.refine && round < 2; ++round) {
    result.cur_from_prev =
        refine_relative_pose(result.cur_from_prev, {prev, cur}, camera, refinement).cur_from_prev;
    result.inlier_mask =
        epipolar_inliers(result.cur_from_prev, pairs, camera, 2.0 * options_.inlier_threshold_px);
    prev = select(pairs.prev_uv, result.inlier_mask);
    cur = select(pairs.cur_uv, result.inlier_mask);
  }
  result.num_inliers = static_cast<int>(prev.size());
  const double share = static_cast<double>(prev.size()) / static_cast<double>(pairs.size());
  if (result.num_inliers < odometry_.min_inliers || share < kMinPairInlierShare) {
    result.cur_from_prev = {};
    result.state = FrameState::kLost;
    return;
  }
  const PixelPairs inliers(prev, cur);
  const Eigen::Quaterniond rotation =
      refine_rotation(result.cur_from_prev.rotation, inliers, camera, refinement);
  result.parallax_px = median_parallax_px(rotation, inliers, camera);
  // The parallax may be nothing but the tracks' noise, which grows with their length.
  const double noise_px = median_epipolar_px(result.cur_from_prev, inliers, camera);
  const bool is_noise = result.parallax_px < std::min(kNoiseParallax * noise_px,  //
                                                      odometry_.min_parallax_px);
  if (result.parallax_px < odometry_.stationary_flow_px || is_noise) {
    result.cur_from_prev.rotation = rotation;
    result.cur_from_prev.translation.setZero();
    result.state = FrameState::kRotating;
  } else if (result.parallax_px < odometry_.min_parallax_px) {
    result.state = FrameState::kLowParallax;
  } else {
    result.state = FrameState::kTracking;
    result.covariance =
        relative_pose_covariance(result.cur_from_prev, inliers, camera, options_.refine_loss_px);
  }
}

Expected<TwoViewResult> estimate_two_view(std::span<const Eigen::Vector2d> prev_uv,
                                          std::span<const Eigen::Vector2d> cur_uv,
                                          const Camera& camera,
                                          const Options& options) {
  STEMVO_TRY(check_camera(camera));
  STEMVO_TRY(validate(options));
  STEMVO_TRY(check_matches(prev_uv, cur_uv));
  return TwoViewEstimator(options).measure({prev_uv, cur_uv}, camera, /*is_initializing=*/true);
}

}  // namespace stemvo
