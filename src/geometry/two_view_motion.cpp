// SPDX-License-Identifier: MIT
#include "stemvo/geometry/two_view_motion.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>

#include <Eigen/LU>

#include "degrees.hpp"
#include "optimal_triangulator.hpp"
#include "stemvo/check.hpp"
#include "stemvo/geometry/decomposition.hpp"

namespace stemvo {
namespace {

enum class PointVerdict { kBad, kGoodWithoutParallax, kGoodWithParallax };

/// One motion's point test. Points are centred pixels (u - cx, v - cy), so that the optimal
/// correction and its bound are pixels even where fx != fy.
class PointTest {
 public:
  PointTest(const Rigid3& cur_from_prev, const Camera& camera, const PointTestOptions& options)
      : rotation_(cur_from_prev.rotation_matrix()),
        translation_(cur_from_prev.translation),
        center_(camera.cx_px, camera.cy_px),
        inverse_focal_(1.0 / camera.fx_px, 1.0 / camera.fy_px),
        max_squared_error_(4.0 * options.sigma_px * options.sigma_px),
        max_cos_parallax_(options.max_cos_parallax) {
    const Eigen::Vector3d scale(inverse_focal_.x(), inverse_focal_.y(), 1.0);
    fundamental_ = scale.asDiagonal() * essential_from_motion(cur_from_prev) * scale.asDiagonal();
  }

  /// Sets the cosine of the angle at which the point sees the two cameras, where it is good.
  PointVerdict judge(const Eigen::Vector2d& prev_uv,
                     const Eigen::Vector2d& cur_uv,
                     double& cos_parallax) const {
    const internal::CorrectedMatch match =
        internal::correct_match(fundamental_, prev_uv - center_, cur_uv - center_);
    // Negated, so that NaN is bad.
    if (!(match.squared_shift_prev <= max_squared_error_) ||
        !(match.squared_shift_cur <= max_squared_error_)) {
      return PointVerdict::kBad;
    }
    const internal::RayMeeting meeting =
        internal::meet_rays(rotation_, translation_, match.prev.cwiseProduct(inverse_focal_),
                            match.cur.cwiseProduct(inverse_focal_));
    // A point in front of one camera and behind the other sees them under the opposite angle.
    const bool opposite = meeting.finite && meeting.depth_prev * meeting.depth_cur < 0.0;
    cos_parallax = opposite ? -meeting.cos_rays : meeting.cos_rays;
    if (cos_parallax >= max_cos_parallax_) {
      return PointVerdict::kGoodWithoutParallax;
    }
    const bool in_front = meeting.finite && meeting.depth_prev > 0.0 && meeting.depth_cur > 0.0;
    return in_front ? PointVerdict::kGoodWithParallax : PointVerdict::kBad;
  }

 private:
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d translation_;
  Eigen::Vector2d center_;
  Eigen::Vector2d inverse_focal_;
  Eigen::Matrix3d fundamental_;
  double max_squared_error_;
  double max_cos_parallax_;
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

/// A plane leaves two motions that (nearly) all its points accept. Between two frames of a drive
/// the smaller turn is the likelier one.
constexpr double kPlanarTieShare = 0.9;

struct TestedHypothesis {
  Rigid3 cur_from_prev;
  PointTestResult test;
};

/// The hypothesis with the most good points; among those with at least `tie_share` of its points,
/// the one that turns least. The first of equals.
std::optional<TwoViewMotion> best_motion(TwoViewModel model,
                                         std::span<const Rigid3> hypotheses,
                                         const std::function<PointTestResult(const Rigid3&)>& test,
                                         double tie_share) {
  std::vector<TestedHypothesis> tested;
  int most_good = 0;
  for (const Rigid3& hypothesis : hypotheses) {
    tested.push_back({hypothesis, test(hypothesis)});
    most_good = std::max(most_good, tested.back().test.num_good);
  }
  if (most_good == 0) {
    return std::nullopt;
  }
  std::size_t best = tested.size();
  for (std::size_t i = 0; i < tested.size(); ++i) {
    const bool is_candidate = tested[i].test.num_good >= tie_share * most_good;
    if (is_candidate && (best == tested.size() || tested[i].cur_from_prev.angle_rad() <
                                                      tested[best].cur_from_prev.angle_rad())) {
      best = i;
    }
  }
  int runner_up = 0;
  for (std::size_t i = 0; i < tested.size(); ++i) {
    runner_up = i == best ? runner_up : std::max(runner_up, tested[i].test.num_good);
  }
  TwoViewMotion motion;
  motion.model = model;
  motion.cur_from_prev = tested[best].cur_from_prev;
  motion.num_good = tested[best].test.num_good;
  motion.parallax_deg = tested[best].test.parallax_deg;
  motion.good_mask = std::move(tested[best].test.good_mask);
  motion.runner_up_ratio = static_cast<double>(runner_up) / motion.num_good;
  return motion;
}

}  // namespace

PointTestResult test_points(const Rigid3& cur_from_prev,
                            std::span<const Eigen::Vector2d> prev_uv,
                            std::span<const Eigen::Vector2d> cur_uv,
                            const Camera& camera,
                            const PointTestOptions& options) {
  STEMVO_CHECK(prev_uv.size() == cur_uv.size(), "matches come in pairs");
  const PointTest point_test(cur_from_prev, camera, options);
  PointTestResult result;
  result.good_mask.assign(prev_uv.size(), 0);
  std::vector<double> cosines;
  cosines.reserve(prev_uv.size());
  for (std::size_t i = 0; i < prev_uv.size(); ++i) {
    double cos_parallax = 1.0;
    const PointVerdict verdict = point_test.judge(prev_uv[i], cur_uv[i], cos_parallax);
    if (verdict == PointVerdict::kBad) {
      continue;
    }
    cosines.push_back(cos_parallax);
    result.good_mask[i] = 1;
    result.num_with_parallax += verdict == PointVerdict::kGoodWithParallax ? 1 : 0;
  }
  result.num_good = static_cast<int>(cosines.size());
  result.parallax_deg = robust_parallax_deg(cosines, options.parallax_rank);
  return result;
}

std::optional<TwoViewMotion> motion_from_homography(const Eigen::Matrix3d& homography,
                                                    std::span<const Eigen::Vector2d> prev_uv,
                                                    std::span<const Eigen::Vector2d> cur_uv,
                                                    const Camera& camera,
                                                    const PointTestOptions& options) {
  std::vector<Rigid3> hypotheses;
  for (const PlanarMotion& motion : decompose_homography(homography, camera)) {
    hypotheses.push_back(motion.cur_from_prev);
  }
  const auto test = [&](const Rigid3& hypothesis) {
    return test_points(hypothesis, prev_uv, cur_uv, camera, options);
  };
  return best_motion(TwoViewModel::kHomography, hypotheses, test, kPlanarTieShare);
}

std::optional<TwoViewMotion> motion_from_essential(const Eigen::Matrix3d& essential,
                                                   std::span<const Eigen::Vector2d> prev_uv,
                                                   std::span<const Eigen::Vector2d> cur_uv,
                                                   const Camera& camera,
                                                   const PointTestOptions& options) {
  const auto test = [&](const Rigid3& hypothesis) {
    return test_points(hypothesis, prev_uv, cur_uv, camera, options);
  };
  return best_motion(TwoViewModel::kEssential, decompose_essential(essential), test, 1.0);
}

bool is_decisive(const TwoViewMotion& motion, int num_matches, const AcceptanceOptions& options) {
  if (motion.model == TwoViewModel::kNone) {
    return false;
  }
  const double max_runner_up = motion.model == TwoViewModel::kHomography
                                   ? options.max_runner_up_homography
                                   : options.max_runner_up_essential;
  return motion.num_good >= options.min_good &&
         motion.num_good >= options.min_good_share * num_matches &&
         motion.parallax_deg >= options.min_parallax_deg && motion.runner_up_ratio < max_runner_up;
}

}  // namespace stemvo
