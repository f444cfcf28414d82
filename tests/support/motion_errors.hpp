// SPDX-License-Identifier: MIT
#pragma once

#include "stemvo/frame_result.hpp"
#include "stemvo/rigid3.hpp"
#include "support/test.hpp"

namespace stemvo::testing {

/// Errors of tracked motions against their covariances.
struct MotionErrors {
  int count = 0;
  double mean = 0.0;    ///< normalized error squared over its 6 degrees of freedom; honest: 1
  double inside = 0.0;  ///< share inside the 95 % ellipsoid
};

inline Rigid3 motion_to(std::span<const Rigid3> poses, std::size_t i) {
  return poses[i - 1].inverse() * poses[i];
}

/// error^T covariance^-1 error, where true motion = motion * error.
inline double squared_error(const Rigid3& motion,
                            const Rigid3& true_motion,
                            const Eigen::Matrix<double, 6, 6>& covariance) {
  const Rigid3 error = motion.inverse() * true_motion;
  Eigen::Matrix<double, 6, 1> vector;
  vector << error.translation, so3_log(error.rotation);
  return vector.dot(covariance.ldlt().solve(vector));
}

/// Frames that were tracked after two that were. Their unit is the mean one of the tracked steps
/// from 12 before to 12 after (a map in units drifts, which nobody can see); `is_metric`: 1 m.
inline MotionErrors errors_of(std::span<const FrameResult> results,
                              std::span<const Rigid3> truth,
                              bool is_metric = false) {
  constexpr std::size_t kFirst = 5;
  constexpr std::size_t kReach = 12;
  constexpr double k95Percent = 12.592;  // chi squared, 6 degrees of freedom
  std::vector<Rigid3> poses;
  for (const FrameResult& result : results) {
    poses.push_back(result.world_from_camera);
  }
  const auto is_judged = [&](std::size_t i) {
    return i >= kFirst && results[i].state == FrameState::kTracking &&
           results[i - 1].state == FrameState::kTracking &&
           results[i - 2].state == FrameState::kTracking;
  };
  const auto unit_around = [&](std::size_t i) -> std::optional<double> {
    double length = 0.0;
    double true_length = 0.0;
    int count = 0;
    for (std::size_t k = std::max(i, kReach) - kReach; k <= std::min(i + kReach, poses.size() - 1);
         ++k) {
      if (is_judged(k)) {
        length += motion_to(poses, k).translation.norm();
        true_length += motion_to(truth, k).translation.norm();
        ++count;
      }
    }
    return count >= 8 ? std::optional(length / true_length) : std::nullopt;
  };
  MotionErrors errors;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::optional<double> unit = !is_judged(i) ? std::nullopt
                                       : is_metric   ? std::optional(1.0)
                                                     : unit_around(i);
    if (unit.has_value()) {
      Rigid3 true_motion = motion_to(truth, i);
      true_motion.translation *= *unit;
      const double squared =
          squared_error(motion_to(poses, i), true_motion, results[i].motion_covariance);
      errors.mean += squared / 6.0;
      errors.inside += squared < k95Percent ? 1.0 : 0.0;
      ++errors.count;
    }
  }
  errors.mean /= errors.count;
  errors.inside /= errors.count;
  return errors;
}

}  // namespace stemvo::testing
