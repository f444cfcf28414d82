// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "evaluation/trajectory.hpp"
#include "geometry/alignment.hpp"

namespace stemvo {

/// Keys `evaluation.*` of the configuration.
struct EvaluationOptions {
  /// Empty: 100, 200, .. 800 m, or 10, 20, .. 50 m where the path is shorter than 100 m.
  std::vector<double> segment_lengths_m;
};

/// Root mean square position error after each kind of alignment.
struct AbsoluteTrajectoryError {
  double none_m = 0.0;
  double scale_m = 0.0;
  double se3_m = 0.0;
  double sim3_m = 0.0;
};

/// Everything that needs ground truth. Both trajectories are first moved to start at the identity.
struct Metrics {
  /// The alignment that was fitted before the offset, t_rel, r_rel and the RPE were taken.
  Alignment alignment = Alignment::kNone;
  double path_length_m = 0.0;     ///< of the ground truth
  double average_offset_m = 0.0;  ///< paper: mean of |dx| + |dz|
  double null_offset_m = 0.0;  ///< the same for the zero-motion baseline, which stays at the origin
  std::optional<double> t_rel_percent;  ///< nullopt: no segment fits
  std::optional<double> r_rel_deg_per_100m;
  std::vector<double> segment_lengths_m;
  int num_segments = 0;
  AbsoluteTrajectoryError ate_rmse;
  // Mean over steps of 1 frame.
  double rpe_translation_m = 0.0;
  double rpe_rotation_deg = 0.0;
};

/// Sum of the steps; at least one pose.
[[nodiscard]] double length_of_path(std::span<const Rigid3> poses);

/// KITTI devkit (vo_facts 4c: every 10th start frame), offset, ATE, RPE. At least one pose
/// (checked).
[[nodiscard]] Metrics evaluate(const PosePairs& given, const EvaluationOptions& options = {});

/// The devkit's: every 10th frame starts a segment.
inline constexpr std::size_t kFirstFrameStep = 10;
/// Error of one segment, first frame to the first one more than `length_m` behind it.
struct SegmentError {
  std::size_t first = 0;
  std::size_t last = 0;
  double length_m = 0.0;
  double t_percent = 0.0;
  double r_deg_per_100m = 0.0;
};
/// The devkit's, one from every `first_frame_step`-th frame on, as far as they fit.
[[nodiscard]] std::vector<SegmentError> segment_errors(const PosePairs& pairs,
                                                       std::span<const double> lengths_m,
                                                       std::size_t first_frame_step);

/// Errors that two methods are compared by: segments of an eighth of the path from
/// every frame on or, of more than `max_segments`, evenly spaced ones.
struct DenseErrors {
  std::vector<double> t_percent;
  std::vector<double> r_deg_per_100m;
  std::size_t block = 1;  ///< neighbours that overlap
};
/// Empty: none fits (a path of length zero). At least one pose (checked).
[[nodiscard]] DenseErrors dense_errors(const PosePairs& pairs, std::size_t max_segments);

/// As evaluate(), after the estimate was fitted to the ground truth, for trajectories without a
/// scale. The four kinds of ATE and the null offset are those of the estimate as it comes.
[[nodiscard]] Metrics evaluate_aligned(const PosePairs& pairs,
                                       Alignment alignment,
                                       const EvaluationOptions& options = {});

/// The estimate moved until the first of `frames`, those with a true pose, is the identity, and
/// then fitted there to the ground truth (also moved). At least one of them (checked).
[[nodiscard]] Trajectory align_trajectory(std::span<const Rigid3> estimate,
                                          std::span<const std::size_t> frames,
                                          std::span<const Rigid3> ground_truth,
                                          Alignment alignment);

}  // namespace stemvo
