// SPDX-License-Identifier: MIT
#include "geometry/two_view_motion.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <Eigen/Core>

#include "degrees.hpp"
#include "geometry/triangulation.hpp"
#include "geometry/two_view_models.hpp"

namespace stemvo {
namespace {

/// Points with less parallax cannot vote on the depth sign.
constexpr double kMaxCosParallax = 0.99998;
/// Planar motions that accept so many of the best one's points are as likely. Between two frames of
/// a drive the smaller turn is the likelier one.
constexpr double kPlanarTieShare = 0.9;

/// One motion's point test. Points are centred pixels (u - cx, v - cy), so that the optimal
/// correction and its bound are pixels even where fx != fy.
class PointJudge {
 public:
  PointJudge(const Rigid3& cur_from_prev, const Camera& camera, double sigma_px)
      : rotation_(cur_from_prev.rotation_matrix()),
        translation_(cur_from_prev.translation),
        center_(camera.cx_px, camera.cy_px),
        inverse_focal_(1.0 / camera.fx_px, 1.0 / camera.fy_px),
        max_squared_error_(4.0 * sigma_px * sigma_px) {
    const Eigen::Vector3d scale(inverse_focal_.x(), inverse_focal_.y(), 1.0);
    fundamental_ = scale.asDiagonal() * essential_from_motion(cur_from_prev) * scale.asDiagonal();
  }

  /// Cosine of the angle at which a good point sees the two cameras; nullopt: it is bad.
  [[nodiscard]] std::optional<double> judge(const Eigen::Vector2d& prev_uv,
                                            const Eigen::Vector2d& cur_uv) const {
    const internal::CorrectedMatch match =
        internal::correct_match(fundamental_, prev_uv - center_, cur_uv - center_);
    // Negated, so that NaN is bad.
    if (!(match.squared_shift_prev <= max_squared_error_) ||
        !(match.squared_shift_cur <= max_squared_error_)) {
      return std::nullopt;
    }
    const internal::RayMeeting meeting =
        internal::meet_rays(rotation_, translation_, match.prev.cwiseProduct(inverse_focal_),
                            match.cur.cwiseProduct(inverse_focal_));
    // A point in front of one camera and behind the other sees them under the opposite angle.
    const bool opposite = meeting.finite && meeting.depth_prev * meeting.depth_cur < 0.0;
    const double cos_parallax = opposite ? -meeting.cos_rays : meeting.cos_rays;
    const bool in_front = meeting.finite && meeting.depth_prev > 0.0 && meeting.depth_cur > 0.0;
    return cos_parallax >= kMaxCosParallax || in_front ? std::optional(cos_parallax) : std::nullopt;
  }

 private:
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d translation_;
  Eigen::Vector2d center_;
  Eigen::Vector2d inverse_focal_;
  Eigen::Matrix3d fundamental_;
  double max_squared_error_;
};

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

PointTest test_points(const Rigid3& cur_from_prev,
                      const PixelPairs& pairs,
                      const Camera& camera,
                      const PointTestOptions& options) {
  const PointJudge point_judge(cur_from_prev, camera, options.sigma_px);
  PointTest result;
  result.good_mask.assign(pairs.size(), 0);
  std::vector<double> cosines;
  cosines.reserve(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::optional<double> cosine = point_judge.judge(pairs.prev_uv[i], pairs.cur_uv[i]);
    if (cosine.has_value()) {
      cosines.push_back(*cosine);
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
  if (motion.model == TwoViewModel::kNone) {
    return false;
  }
  const double max_runner_up = motion.model == TwoViewModel::kHomography
                                   ? options.max_runner_up_homography
                                   : options.max_runner_up_essential;
  const PointTest& test = motion.test;
  return test.num_good >= options.min_good &&
         test.num_good >= options.min_good_share * num_matches &&
         test.parallax_deg >= options.min_parallax_deg && motion.runner_up_ratio < max_runner_up;
}

}  // namespace stemvo
