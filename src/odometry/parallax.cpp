// SPDX-License-Identifier: MIT
#include "odometry/parallax.hpp"

#include <cmath>
#include <utility>

#include "geometry/median.hpp"
#include "stemvo/geometry/decomposition.hpp"
#include "stemvo/geometry/two_view_scores.hpp"

namespace stemvo {
namespace {

/// What is left of the flow once the rotation is taken out, of each match.
std::vector<double> parallaxes_px(const Eigen::Quaterniond& rotation,
                                  std::span<const Eigen::Vector2d> prev_uv,
                                  std::span<const Eigen::Vector2d> cur_uv,
                                  const Camera& camera) {
  std::vector<double> lengths;
  lengths.reserve(prev_uv.size());
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    const Eigen::Vector3d ray = rotation * camera.normalize(prev_uv[i]).homogeneous();
    lengths.push_back((cur_uv[i] - camera.project(ray)).norm());
  }
  return lengths;
}

}  // namespace

double median_flow_px(std::span<const Eigen::Vector2d> prev_uv,
                      std::span<const Eigen::Vector2d> cur_uv) {
  std::vector<double> lengths;
  lengths.reserve(prev_uv.size());
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    lengths.push_back((cur_uv[i] - prev_uv[i]).norm());
  }
  return median(std::move(lengths));
}

double median_parallax_px(const Eigen::Quaterniond& rotation,
                          std::span<const Eigen::Vector2d> prev_uv,
                          std::span<const Eigen::Vector2d> cur_uv,
                          const Camera& camera) {
  return median(parallaxes_px(rotation, prev_uv, cur_uv, camera));
}

double rms_parallax_px(const Eigen::Quaterniond& rotation,
                       std::span<const Eigen::Vector2d> prev_uv,
                       std::span<const Eigen::Vector2d> cur_uv,
                       const Camera& camera) {
  double sum = 0.0;
  for (const double length : parallaxes_px(rotation, prev_uv, cur_uv, camera)) {
    sum += length * length;
  }
  return std::sqrt(sum / static_cast<double>(prev_uv.size()));
}

double median_epipolar_px(const Rigid3& cur_from_prev,
                          std::span<const Eigen::Vector2d> prev_uv,
                          std::span<const Eigen::Vector2d> cur_uv,
                          const Camera& camera) {
  if (!(cur_from_prev.translation.norm() > 0.0)) {
    return 0.0;
  }
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

}  // namespace stemvo
