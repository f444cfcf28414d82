// SPDX-License-Identifier: MIT
#include "geometry/two_view_models.hpp"

#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

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

using Svd3 = Eigen::JacobiSVD<Eigen::Matrix3d>;

/// ORB-SLAM2's bound: closer singular values leave the direction of the translation open.
constexpr double kMinRatio = 1.00001;
/// Beyond, d2 is rounding and the matrix has rank 1.
constexpr double kMaxRatio = 1e9;

/// The 8 hypotheses share A = K^-1 H K = U diag(d1, d2, d3) V^T.
struct FaugerasTerms {
  Eigen::Matrix3d u;
  Eigen::Matrix3d v;
  double sign;  ///< det U det V
  double d1;
  double d2;
  double d3;
};

/// Rotation about y of the case d' = +d2 and reflection of the case d' = -d2 (Faugeras & Lustman
/// 1988, eq. 12 to 16); x1 and x3 are the signed parts of the plane's normal.
Rigid3 planar_motion(const FaugerasTerms& f, double x1, double x3, bool d2_positive) {
  const double side = d2_positive ? 1.0 : -1.0;
  const double scale = (f.d1 + side * f.d3) * f.d2;
  const double s = x1 * x3 * (f.d1 * f.d1 - f.d3 * f.d3) / scale;
  const double c = (f.d1 * f.d3 + side * (f.d2 * f.d2)) / scale;
  Eigen::Matrix3d rotation;
  rotation << c, 0.0, -side * s, 0.0, side, 0.0, s, 0.0, side * c;
  const Eigen::Vector3d translation(x1, 0.0, -side * x3);
  return Rigid3::from_matrix(f.sign * f.u * rotation * f.v.transpose(),
                             (f.u * translation).normalized());
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

std::vector<Rigid3> decompose_homography(const Eigen::Matrix3d& homography, const Camera& camera) {
  const Eigen::Matrix3d k = camera.matrix();
  const Eigen::Matrix3d a = k.inverse() * homography * k;
  const Svd3 svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& d = svd.singularValues();
  // Negated, so that 0/0 is refused as well.
  if (!(d(0) / d(1) >= kMinRatio && d(0) / d(1) <= kMaxRatio && d(1) / d(2) >= kMinRatio)) {
    return {};
  }
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0;
  const FaugerasTerms f{svd.matrixU(), svd.matrixV(), sign, d(0), d(1), d(2)};
  const double range = f.d1 * f.d1 - f.d3 * f.d3;
  const double x1 = std::sqrt((f.d1 * f.d1 - f.d2 * f.d2) / range);
  const double x3 = std::sqrt((f.d2 * f.d2 - f.d3 * f.d3) / range);
  std::vector<Rigid3> hypotheses;
  for (const bool d2_positive : {true, false}) {
    for (const double sign1 : {1.0, -1.0}) {
      for (const double sign3 : {1.0, -1.0}) {
        hypotheses.push_back(planar_motion(f, sign1 * x1, sign3 * x3, d2_positive));
      }
    }
  }
  return hypotheses;
}

std::array<Rigid3, 4> decompose_essential(const Eigen::Matrix3d& essential) {
  const Svd3 svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d w;
  w << 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  const Eigen::Matrix3d& u = svd.matrixU();
  const Eigen::Matrix3d v_t = svd.matrixV().transpose();
  const double sign = u.determinant() * v_t.determinant() < 0.0 ? -1.0 : 1.0;
  const Eigen::Matrix3d first = sign * u * w * v_t;
  const Eigen::Matrix3d second = sign * u * w.transpose() * v_t;
  const Eigen::Vector3d t = u.col(2).normalized();
  return {Rigid3::from_matrix(first, t), Rigid3::from_matrix(second, t),
          Rigid3::from_matrix(first, -t), Rigid3::from_matrix(second, -t)};
}

}  // namespace stemvo
