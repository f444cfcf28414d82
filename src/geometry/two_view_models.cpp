// SPDX-License-Identifier: MIT
#include "geometry/two_view_models.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "degrees.hpp"
#include "geometry/triangulation.hpp"

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
    result.inlier_mask[i] = num_within == 2 ? 1 : 0;
  }
  return result;
}

using Svd3 = Eigen::JacobiSVD<Eigen::Matrix3d>;

/// ORB-SLAM2's bound: closer singular values leave the direction of the translation open.
constexpr double kMinRatio = 1.00001;
/// Beyond, d2 is rounding and the matrix has rank 1.
constexpr double kMaxRatio = 1e9;

/// Points with less parallax cannot vote on the depth sign.
constexpr double kMaxCosParallax = 0.99998;
/// Planar motions that accept so many of the best one's points are as likely. Between two frames of
/// a drive the smaller turn is the likelier one.
constexpr double kPlanarTieShare = 0.9;

/// ORB-SLAM2 takes the 51st smallest cosine: a few wrong points cannot feign parallax.
double robust_parallax_deg(std::vector<double>& cosines, int rank) {
  if (cosines.empty()) {
    return 0.0;
  }
  const std::size_t index = std::min(static_cast<std::size_t>(rank - 1), cosines.size() - 1);
  const auto nth = cosines.begin() + static_cast<std::ptrdiff_t>(index);
  std::nth_element(cosines.begin(), nth, cosines.end());
  return kDegPerRad * std::acos(std::clamp(*nth, -1.0, 1.0));
}

}  // namespace

ModelScore score_homography(const Eigen::Matrix3d& homography,
                            const PixelPairs& pairs,
                            double sigma_px) {
  if (is_singular(homography)) {
    return {0.0, std::vector<char>(pairs.size(), 0)};
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
  const double d1 = d(0);
  const double d2 = d(1);
  const double d3 = d(2);
  const double range = d1 * d1 - d3 * d3;
  const double most_x1 = std::sqrt((d1 * d1 - d2 * d2) / range);
  const double most_x3 = std::sqrt((d2 * d2 - d3 * d3) / range);
  std::vector<Rigid3> hypotheses;
  // The rotation about y of the case d' = +d2 (side 1) and the reflection of the case d' = -d2
  // (Faugeras & Lustman 1988, eq. 12 to 16); x1 and x3 are the signed parts of the plane's normal.
  for (const double side : {1.0, -1.0}) {
    const double scale = (d1 + side * d3) * d2;
    const double c = (d1 * d3 + side * (d2 * d2)) / scale;
    for (const double x1 : {most_x1, -most_x1}) {
      for (const double x3 : {most_x3, -most_x3}) {
        const double s = x1 * x3 * range / scale;
        Eigen::Matrix3d rotation;
        rotation << c, 0.0, -side * s, 0.0, side, 0.0, s, 0.0, side * c;
        const Eigen::Vector3d translation(x1, 0.0, -side * x3);
        hypotheses.push_back(
            Rigid3::from_matrix(sign * svd.matrixU() * rotation * svd.matrixV().transpose(),
                                (svd.matrixU() * translation).normalized()));
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

// Points are centred pixels (u - cx, v - cy), so that the optimal correction and its bound are
// pixels even where fx != fy.
PointTest test_points(const Rigid3& cur_from_prev,
                      const PixelPairs& pairs,
                      const Camera& camera,
                      const PointTestOptions& options) {
  const Eigen::Matrix3d rotation = cur_from_prev.rotation_matrix();
  const Eigen::Vector2d center(camera.cx_px, camera.cy_px);
  const Eigen::Vector2d inverse_focal(1.0 / camera.fx_px, 1.0 / camera.fy_px);
  const Eigen::Vector3d scale(inverse_focal.x(), inverse_focal.y(), 1.0);
  const Eigen::Matrix3d fundamental =
      scale.asDiagonal() * essential_from_motion(cur_from_prev) * scale.asDiagonal();
  const double max_squared_error = 4.0 * options.sigma_px * options.sigma_px;
  PointTest result;
  result.good_mask.assign(pairs.size(), 0);
  std::vector<double> cosines;
  cosines.reserve(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector2d prev = pairs.prev_uv[i] - center;
    const Eigen::Vector2d cur = pairs.cur_uv[i] - center;
    const internal::CorrectedMatch match = internal::correct_match(fundamental, prev, cur);
    // Negated, so that NaN is bad.
    if (!((match.prev - prev).squaredNorm() <= max_squared_error) ||
        !((match.cur - cur).squaredNorm() <= max_squared_error)) {
      continue;
    }
    const internal::RayMeeting meeting = internal::meet_rays(rotation, cur_from_prev.translation,
                                                             match.prev.cwiseProduct(inverse_focal),
                                                             match.cur.cwiseProduct(inverse_focal));
    // A point in front of one camera and behind the other sees them under the opposite angle.
    const bool opposite = meeting.finite && meeting.depth_prev * meeting.depth_cur < 0.0;
    const double cos_parallax = opposite ? -meeting.cos_rays : meeting.cos_rays;
    const bool in_front = meeting.finite && meeting.depth_prev > 0.0 && meeting.depth_cur > 0.0;
    if (cos_parallax >= kMaxCosParallax || in_front) {
      cosines.push_back(cos_parallax);
      result.good_mask[i] = 1;
    }
  }
  result.num_good = static_cast<int>(cosines.size());
  result.parallax_deg = robust_parallax_deg(cosines, options.parallax_rank);
  return result;
}

std::optional<TwoViewMotion> best_motion(TwoViewModel model,
                                         std::span<const Rigid3> hypotheses,
                                         const PixelPairs& pairs,
                                         const Camera& camera,
                                         const PointTestOptions& options) {
  std::vector<TwoViewMotion> tested;
  int most_good = 0;
  for (const Rigid3& hypothesis : hypotheses) {
    tested.push_back({model, hypothesis, test_points(hypothesis, pairs, camera, options)});
    most_good = std::max(most_good, tested.back().test.num_good);
  }
  if (most_good == 0) {
    return std::nullopt;
  }
  const double tie_share = model == TwoViewModel::kHomography ? kPlanarTieShare : 1.0;
  TwoViewMotion* best = nullptr;
  for (TwoViewMotion& motion : tested) {
    const bool is_candidate = motion.test.num_good >= tie_share * most_good;
    if (is_candidate &&
        (best == nullptr || motion.cur_from_prev.angle_rad() < best->cur_from_prev.angle_rad())) {
      best = &motion;
    }
  }
  int runner_up = 0;
  for (const TwoViewMotion& motion : tested) {
    runner_up = &motion == best ? runner_up : std::max(runner_up, motion.test.num_good);
  }
  best->runner_up_ratio = static_cast<double>(runner_up) / best->test.num_good;
  return std::move(*best);
}

bool is_decisive(const TwoViewMotion& motion, int num_matches, const AcceptanceOptions& options) {
  const double max_runner_up = motion.model == TwoViewModel::kHomography
                                   ? options.max_runner_up_homography
                                   : options.max_runner_up_essential;
  const PointTest& test = motion.test;
  return test.num_good >= options.min_good &&
         test.num_good >= options.min_good_share * num_matches &&
         test.parallax_deg >= options.min_parallax_deg && motion.runner_up_ratio < max_runner_up;
}

}  // namespace stemvo
