// SPDX-License-Identifier: MIT
#include "geometry/two_view_scores.hpp"

#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace stemvo {
namespace {

/// Chi-square 95 % bound of two degrees of freedom and the paper's Gamma, in units of sigma^2.
constexpr double kHomographyChi2 = 5.991;
constexpr double kScoreGamma = 5.991;

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
/// `squared_errors(prev_uv, cur_uv)` are those in the current and in the previous image.
template <typename SquaredErrors>
ModelScore score_matches(const PixelPairs& pairs,
                         double sigma_px,
                         double chi2,
                         const SquaredErrors& squared_errors) {
  ModelScore result;
  result.inlier_mask.assign(pairs.size(), 0);
  const double weight = 1.0 / (sigma_px * sigma_px);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    int num_within = 0;
    for (const double squared : squared_errors(pairs.prev_uv[i], pairs.cur_uv[i])) {
      if (weight * squared < chi2) {
        result.score += kScoreGamma - weight * squared;
        ++num_within;
      }
    }
    if (num_within == 2) {
      result.inlier_mask[i] = 1;
      ++result.num_inliers;
    }
  }
  return result;
}

}  // namespace

ModelScore score_homography(const Eigen::Matrix3d& homography,
                            const PixelPairs& pairs,
                            double sigma_px) {
  if (is_singular(homography)) {
    return {0.0, 0, std::vector<char>(pairs.size(), 0)};
  }
  const Eigen::Matrix3d prev_from_cur = adjugate(homography);
  return score_matches(pairs, sigma_px, kHomographyChi2,
                       [&](const Eigen::Vector2d& prev, const Eigen::Vector2d& cur) {
                         return std::array{squared_transfer_error(homography, prev, cur),
                                           squared_transfer_error(prev_from_cur, cur, prev)};
                       });
}

ModelScore score_fundamental(const Eigen::Matrix3d& fundamental,
                             const PixelPairs& pairs,
                             double sigma_px) {
  return score_matches(
      pairs, sigma_px, kFundamentalChi2,
      [&](const Eigen::Vector2d& prev, const Eigen::Vector2d& cur) {
        return std::array{
            squared_distance_to_line(fundamental * prev.homogeneous(), cur),
            squared_distance_to_line(fundamental.transpose() * cur.homogeneous(), prev)};
      });
}

double homography_ratio(double homography_score, double fundamental_score) {
  const double sum = homography_score + fundamental_score;
  return sum > 0.0 ? homography_score / sum : 0.0;
}

}  // namespace stemvo
