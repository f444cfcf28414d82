// SPDX-License-Identifier: MIT
#include "odometry/two_view_estimator.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/median.hpp"
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

/// Median length of noise in two pictures over its median distance from epipolar lines: 2.5 where
/// it is equal in all directions (1.177 sqrt(2) / 0.6745), 3-4.5 on rendered turns of 18 px a
/// frame. The slowest steps that can be seen have 10 and more.
constexpr double kNoiseParallax = 5.0;

/// Once initialised, S_H is only written down: few points of a street lie on one plane, and the
/// estimator would always use all its iterations, and polish each of them.
constexpr int kRecordIterations = 100;
constexpr const char* kRecordEstimator = "ransac";

double median_flow_px(std::span<const Eigen::Vector2d> prev_uv,
                      std::span<const Eigen::Vector2d> cur_uv) {
  std::vector<double> lengths;
  lengths.reserve(prev_uv.size());
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    lengths.push_back((cur_uv[i] - prev_uv[i]).norm());
  }
  return median(std::move(lengths));
}

/// Median length of what is left of the flow once the rotation is taken out.
double median_parallax_px(const Eigen::Quaterniond& rotation,
                          std::span<const Eigen::Vector2d> prev_uv,
                          std::span<const Eigen::Vector2d> cur_uv,
                          const Camera& camera) {
  std::vector<double> lengths;
  lengths.reserve(prev_uv.size());
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    const Eigen::Vector3d ray = rotation * camera.normalize(prev_uv[i]).homogeneous();
    lengths.push_back((cur_uv[i] - camera.project(ray)).norm());
  }
  return median(std::move(lengths));
}

/// Median distance of the matches to their epipolar lines in both pictures (Sampson).
double median_epipolar_px(const Rigid3& cur_from_prev,
                          std::span<const Eigen::Vector2d> prev_uv,
                          std::span<const Eigen::Vector2d> cur_uv,
                          const Camera& camera) {
  const Eigen::Matrix3d fundamental =
      fundamental_from_essential(essential_from_motion(cur_from_prev), camera);
  std::vector<double> distances;
  distances.reserve(prev_uv.size());
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    const Eigen::Vector3d line_in_cur = fundamental * prev_uv[i].homogeneous();
    const Eigen::Vector3d line_in_prev = fundamental.transpose() * cur_uv[i].homogeneous();
    const double gradient = std::hypot(line_in_cur.head<2>().norm(), line_in_prev.head<2>().norm());
    distances.push_back(std::abs(cur_uv[i].homogeneous().dot(line_in_cur)) / gradient);
  }
  return median(std::move(distances));
}

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

std::vector<char> epipolar_inliers(const Rigid3& cur_from_prev,
                                   std::span<const Eigen::Vector2d> prev_uv,
                                   std::span<const Eigen::Vector2d> cur_uv,
                                   const Camera& camera,
                                   double bound_px) {
  const Eigen::Matrix3d fundamental =
      fundamental_from_essential(essential_from_motion(cur_from_prev), camera);
  // score_fundamental counts d^2 <= 3.841 sigma^2
  return score_fundamental(fundamental, prev_uv, cur_uv, bound_px / std::sqrt(kFundamentalChi2))
      .inlier_mask;
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
  const Models models = score_models(prev_uv, cur_uv, is_initializing, seed, result);
  if (median_flow_px(prev_uv, cur_uv) < odometry_.standing_flow_px) {
    result.state = FrameState::kStanding;
    result.inlier_mask.assign(prev_uv.size(), 1);
    result.num_inliers = static_cast<int>(prev_uv.size());
    return result;
  }
  const PointTestOptions test{.sigma_px = options_.sigma_px};
  const bool use_homography = is_initializing && models.homography.has_value() &&
                              result.homography_ratio > options_.homography_ratio;
  std::optional<TwoViewMotion> motion;
  if (use_homography) {
    motion = motion_from_homography(*models.homography, prev_uv, cur_uv, camera_, test);
  }
  if (!motion.has_value() && models.essential.has_value()) {
    motion = motion_from_essential(*models.essential, prev_uv, cur_uv, camera_, test);
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

TwoViewEstimator::Models TwoViewEstimator::score_models(std::span<const Eigen::Vector2d> prev_uv,
                                                        std::span<const Eigen::Vector2d> cur_uv,
                                                        bool is_initializing,
                                                        std::uint64_t seed,
                                                        MeasuredMotion& result) const {
  Models models;
  TwoViewOptions homography_options = options_;
  if (!is_initializing) {
    homography_options.max_iterations = std::min(options_.max_iterations, kRecordIterations);
    homography_options.estimator = kRecordEstimator;
  }
  models.homography = estimate_homography(prev_uv, cur_uv, homography_options, seed);
  std::optional<Eigen::Matrix3d> fundamental;
  if (is_initializing) {
    fundamental = estimate_fundamental(prev_uv, cur_uv, options_, seed);
    if (fundamental.has_value()) {
      models.essential = essential_from_fundamental(*fundamental, camera_);
    }
  } else {
    models.essential = estimate_essential(prev_uv, cur_uv, camera_, options_, seed);
    if (models.essential.has_value()) {
      fundamental = fundamental_from_essential(*models.essential, camera_);
    }
  }
  if (models.homography.has_value()) {
    result.homography_score =
        score_homography(*models.homography, prev_uv, cur_uv, options_.sigma_px).score;
  }
  if (fundamental.has_value()) {
    result.fundamental_score =
        score_fundamental(*fundamental, prev_uv, cur_uv, options_.sigma_px).score;
  }
  result.homography_ratio = homography_ratio(result.homography_score, result.fundamental_score);
  return models;
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
  if (result.parallax_px < odometry_.standing_flow_px || is_noise) {
    result.cur_from_prev = rotation_only;
    result.state = FrameState::kRotating;
  } else if (result.parallax_px < odometry_.min_parallax_px) {
    result.state = FrameState::kCreeping;
  } else {
    result.state = FrameState::kTracking;
  }
}

}  // namespace stemvo
