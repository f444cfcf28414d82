// SPDX-License-Identifier: MIT
#include "odometry/robust_models.hpp"

#include <algorithm>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// Below this OpenCV's estimators have nothing to choose from, and some versions crash.
constexpr std::size_t kMinMatches = 8;
constexpr double kPoseConfidence = 0.9999;
constexpr int kPoseIterations = 1000;

std::vector<cv::Point2d> to_points(std::span<const Eigen::Vector2d> uv) {
  std::vector<cv::Point2d> points(uv.size());
  std::ranges::transform(uv, points.begin(),
                         [](const auto& point) { return cv::Point2d(point.x(), point.y()); });
  return points;
}

cv::UsacParams usac_params(double confidence,
                           int max_iterations,
                           double threshold_px,
                           std::uint64_t seed) {
  cv::UsacParams params;
  params.confidence = confidence;
  params.isParallel = false;
  params.maxIterations = max_iterations;
  params.threshold = threshold_px;
  params.sampler = cv::SAMPLING_UNIFORM;
  params.randomGeneratorState = static_cast<int>(seed & 0x7fffffffU);
  return params;
}

cv::UsacParams two_view_params(const TwoViewOptions& options, std::uint64_t seed) {
  cv::UsacParams params =
      usac_params(options.confidence, options.max_iterations, options.inlier_threshold_px, seed);
  const bool is_magsac = options.estimator == RobustEstimator::kMagsac;
  params.score = is_magsac ? cv::SCORE_METHOD_MAGSAC : cv::SCORE_METHOD_RANSAC;
  params.loMethod = is_magsac ? cv::LOCAL_OPTIM_SIGMA : cv::LOCAL_OPTIM_NULL;
  return params;
}

/// Some methods return nothing or several stacked solutions: only a finite 3x3 is a model.
std::optional<Eigen::Matrix3d> to_model(const cv::Mat& matrix) {
  if (matrix.rows != 3 || matrix.cols != 3) {
    return std::nullopt;
  }
  Eigen::Matrix3d model;
  cv::cv2eigen(matrix, model);
  if (!model.allFinite() || !(model.norm() > 0.0)) {
    return std::nullopt;
  }
  return model;
}

/// Runs one of OpenCV's estimators, which throw on some degenerate input: no model then.
template <typename Estimator>
std::optional<Eigen::Matrix3d> run_guarded(const PixelPairs& pairs, const Estimator& estimator) {
  if (pairs.size() < kMinMatches) {
    return std::nullopt;
  }
  try {
    return to_model(estimator(to_points(pairs.prev_uv), to_points(pairs.cur_uv)));
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
}

}  // namespace

std::optional<Eigen::Matrix3d> estimate_homography(const PixelPairs& pairs,
                                                   const TwoViewOptions& options,
                                                   std::uint64_t seed) {
  const StageTimer timer(Stage::kHomography);
  return run_guarded(pairs, [&](const auto& prev, const auto& cur) {
    return cv::findHomography(prev, cur, cv::noArray(), two_view_params(options, seed));
  });
}

std::optional<Eigen::Matrix3d> estimate_fundamental(const PixelPairs& pairs,
                                                    const TwoViewOptions& options,
                                                    std::uint64_t seed) {
  const StageTimer timer(Stage::kEpipolar);
  return run_guarded(pairs, [&](const auto& prev, const auto& cur) {
    return cv::findFundamentalMat(prev, cur, cv::noArray(), two_view_params(options, seed));
  });
}

std::optional<Eigen::Matrix3d> estimate_essential(const PixelPairs& pairs,
                                                  const Camera& camera,
                                                  const TwoViewOptions& options,
                                                  std::uint64_t seed) {
  const StageTimer timer(Stage::kEpipolar);
  cv::Mat intrinsics;
  cv::eigen2cv(camera.matrix(), intrinsics);
  return run_guarded(pairs, [&](const auto& prev, const auto& cur) {
    return cv::findEssentialMat(prev, cur, intrinsics, intrinsics, cv::noArray(), cv::noArray(),
                                cv::noArray(), two_view_params(options, seed));
  });
}

std::optional<Rigid3> estimate_absolute_pose(std::span<const Eigen::Vector3d> points_in_world,
                                             std::span<const Eigen::Vector2d> uv,
                                             const Camera& camera,
                                             double bound_px,
                                             std::uint64_t seed) {
  if (uv.size() < kMinMatches || points_in_world.size() != uv.size()) {
    return std::nullopt;
  }
  // Single precision inside: points far from the origin would lose digits.
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points_in_world) {
    center += point / static_cast<double>(points_in_world.size());
  }
  std::vector<cv::Point3d> points;
  points.reserve(points_in_world.size());
  for (const Eigen::Vector3d& point : points_in_world) {
    const Eigen::Vector3d near = point - center;
    points.emplace_back(near.x(), near.y(), near.z());
  }
  cv::UsacParams params = usac_params(kPoseConfidence, kPoseIterations, bound_px, seed);
  params.score = cv::SCORE_METHOD_MSAC;
  params.loMethod = cv::LOCAL_OPTIM_INNER_LO;
  cv::Mat intrinsics;
  cv::eigen2cv(camera.matrix(), intrinsics);
  cv::Mat rotation, translation, inliers;
  try {
    if (!cv::solvePnPRansac(points, to_points(uv), intrinsics, cv::noArray(), rotation, translation,
                            inliers, params)) {
      return std::nullopt;
    }
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  Eigen::Vector3d w;
  Eigen::Vector3d t;
  cv::cv2eigen(rotation, w);
  cv::cv2eigen(translation, t);
  if (!w.allFinite() || !t.allFinite()) {
    return std::nullopt;
  }
  const Rigid3 camera_from_centered(so3_exp(w), t);
  return camera_from_centered * Rigid3(Eigen::Quaterniond::Identity(), -center);
}

}  // namespace stemvo
