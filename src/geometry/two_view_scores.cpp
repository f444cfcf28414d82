// SPDX-License-Identifier: MIT
#include "stemvo/geometry/two_view_scores.hpp"

#include <cmath>
#include <cstddef>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "stemvo/check.hpp"

namespace stemvo {
namespace {

/// Inverse up to scale (the adjugate): homogeneous maps need no division.
Eigen::Matrix3d adjugate(const Eigen::Matrix3d& m) {
  Eigen::Matrix3d result;
  result.row(0) = m.col(1).cross(m.col(2)).transpose();
  result.row(1) = m.col(2).cross(m.col(0)).transpose();
  result.row(2) = m.col(0).cross(m.col(1)).transpose();
  return result;
}

/// Judged by the determinant against the lengths of the columns: independent of the free scale of H
/// and of the pixels' large numbers. NaN counts as singular.
bool is_singular(const Eigen::Matrix3d& m) {
  const double bound = m.col(0).norm() * m.col(1).norm() * m.col(2).norm();
  return !(std::abs(m.determinant()) > 1e-13 * bound);
}

double squared_transfer_error(const Eigen::Matrix3d& to_from_from,
                              const Eigen::Vector2d& from,
                              const Eigen::Vector2d& to) {
  return ((to_from_from * from.homogeneous()).hnormalized() - to).squaredNorm();
}

double squared_distance_to_line(const Eigen::Vector3d& line, const Eigen::Vector2d& point) {
  const double value = line.dot(point.homogeneous());
  return value * value / line.head<2>().squaredNorm();
}

/// Eq. (6) in both directions; a NaN distance (point at the epipole or at infinity) is an outlier.
void add_match(double squared_forward,
               double squared_backward,
               double bound,
               std::size_t index,
               ModelScore& result) {
  const bool forward = squared_forward < bound;
  const bool backward = squared_backward < bound;
  result.score += forward ? kScoreGamma - squared_forward : 0.0;
  result.score += backward ? kScoreGamma - squared_backward : 0.0;
  if (forward && backward) {
    result.inlier_mask[index] = 1;
    ++result.num_inliers;
  }
}

}  // namespace

ModelScore score_homography(const Eigen::Matrix3d& homography,
                            std::span<const Eigen::Vector2d> prev_uv,
                            std::span<const Eigen::Vector2d> cur_uv,
                            double sigma_px) {
  STEMVO_CHECK(prev_uv.size() == cur_uv.size(), "matches come in pairs");
  ModelScore result;
  result.inlier_mask.assign(prev_uv.size(), 0);
  if (is_singular(homography)) {
    return result;
  }
  const Eigen::Matrix3d prev_from_cur = adjugate(homography);
  const double weight = 1.0 / (sigma_px * sigma_px);
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    add_match(weight * squared_transfer_error(homography, prev_uv[i], cur_uv[i]),
              weight * squared_transfer_error(prev_from_cur, cur_uv[i], prev_uv[i]),
              kHomographyChi2, i, result);
  }
  return result;
}

ModelScore score_fundamental(const Eigen::Matrix3d& fundamental,
                             std::span<const Eigen::Vector2d> prev_uv,
                             std::span<const Eigen::Vector2d> cur_uv,
                             double sigma_px) {
  STEMVO_CHECK(prev_uv.size() == cur_uv.size(), "matches come in pairs");
  ModelScore result;
  result.inlier_mask.assign(prev_uv.size(), 0);
  const double weight = 1.0 / (sigma_px * sigma_px);
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    const Eigen::Vector3d line_in_cur = fundamental * prev_uv[i].homogeneous();
    const Eigen::Vector3d line_in_prev = fundamental.transpose() * cur_uv[i].homogeneous();
    add_match(weight * squared_distance_to_line(line_in_cur, cur_uv[i]),
              weight * squared_distance_to_line(line_in_prev, prev_uv[i]), kFundamentalChi2, i,
              result);
  }
  return result;
}

double homography_ratio(double homography_score, double fundamental_score) {
  const double sum = homography_score + fundamental_score;
  return sum > 0.0 ? homography_score / sum : 0.0;
}

}  // namespace stemvo
