// SPDX-License-Identifier: MIT
#include "evaluation/metrics.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/degrees.hpp"
#include "internal_check.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kFirstFrameStep = 10;  // devkit: every 10th frame starts a segment
constexpr double kDenseShare = 1.0 / 8.0;    // of the path
constexpr double kShortPath_m = 100.0;       // below it no devkit segment fits

std::vector<Eigen::Vector3d> positions(std::span<const Rigid3> poses) {
  std::vector<Eigen::Vector3d> result(poses.size());
  std::ranges::transform(poses, result.begin(), &Rigid3::translation);
  return result;
}

std::vector<double> distances_m(std::span<const Rigid3> poses) {
  std::vector<double> result(poses.size(), 0.0);
  for (std::size_t i = 1; i < poses.size(); ++i) {
    result[i] = result[i - 1] + (poses[i].translation - poses[i - 1].translation).norm();
  }
  return result;
}

Trajectory transform(const Similarity3& by, std::span<const Rigid3> poses) {
  Trajectory result(poses.size());
  std::ranges::transform(poses, result.begin(), [&](const Rigid3& pose) { return by * pose; });
  return result;
}

/// Both start at the identity. Umeyama's fit on positions.
Trajectory align(const PosePairs& pairs, Alignment alignment) {
  return transform(align_positions(positions(pairs.estimate), positions(pairs.truth), alignment),
                   pairs.estimate);
}

double rmse_m(std::span<const Eigen::Vector3d> estimate, std::span<const Eigen::Vector3d> truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    sum += (estimate[i] - truth[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(estimate.size()));
}

AbsoluteTrajectoryError ate_rmse(const PosePairs& pairs) {
  const std::vector<Eigen::Vector3d> truth = positions(pairs.truth);
  const auto after_m = [&](Alignment alignment) {
    return rmse_m(positions(align(pairs, alignment)), truth);
  };
  return {rmse_m(positions(pairs.estimate), truth), after_m(Alignment::kScale),
          after_m(Alignment::kSe3), after_m(Alignment::kSim3)};
}

/// The paper's offset, (E_x + E_y) / N_f: mean of |dx| + |dz| between the poses as they are
/// (KITTI's ground plane is x-z).
double average_offset_m(const PosePairs& pairs) {
  double sum = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector3d offset = pairs.estimate[i].translation - pairs.truth[i].translation;
    sum += std::abs(offset.x()) + std::abs(offset.z());
  }
  return sum / static_cast<double>(pairs.size());
}

/// The rest of the true motion first -> last after undoing the estimated one (devkit).
Rigid3 motion_error(const PosePairs& pairs, std::size_t first, std::size_t last) {
  const Rigid3 estimated = pairs.estimate[first].inverse() * pairs.estimate[last];
  const Rigid3 truth = pairs.truth[first].inverse() * pairs.truth[last];
  return estimated.inverse() * truth;
}

void add_step_errors(const PosePairs& pairs, Metrics& metrics) {
  if (pairs.size() < 2) {
    return;
  }
  double sum_m = 0.0;
  double sum_rad = 0.0;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    const Rigid3 error = motion_error(pairs, i - 1, i);
    sum_m += error.translation.norm();
    sum_rad += error.angle_rad();
  }
  metrics.rpe_translation_m = sum_m / static_cast<double>(pairs.size() - 1);
  metrics.rpe_rotation_deg = kDegPerRad * sum_rad / static_cast<double>(pairs.size() - 1);
}

/// First frame more than `length_m` behind `first`; the number of frames when there is none.
std::size_t segment_end(std::span<const double> distances, std::size_t first, double length_m) {
  const auto end = std::upper_bound(distances.begin() + static_cast<std::ptrdiff_t>(first),
                                    distances.end(), distances[first] + length_m);
  return static_cast<std::size_t>(end - distances.begin());
}

/// t_rel and r_rel: mean over all segments of all lengths, each divided by its nominal length.
void add_segment_errors(const PosePairs& pairs, Metrics& metrics) {
  const std::vector<SegmentError> segments =
      segment_errors(pairs, metrics.segment_lengths_m, kFirstFrameStep);
  metrics.num_segments = static_cast<int>(segments.size());
  if (segments.empty()) {
    return;
  }
  double t_sum = 0.0;
  double r_sum = 0.0;
  for (const SegmentError& segment : segments) {
    t_sum += segment.t_percent;
    r_sum += segment.r_deg_per_100m;
  }
  metrics.t_rel_percent = t_sum / metrics.num_segments;
  metrics.r_rel_deg_per_100m = r_sum / metrics.num_segments;
}

std::vector<double> segment_lengths(const EvaluationOptions& options, double path_length_m) {
  if (!options.segment_lengths_m.empty()) {
    return options.segment_lengths_m;
  }
  return path_length_m < kShortPath_m ? std::vector<double>{10, 20, 30, 40, 50}
                                      : std::vector<double>{100, 200, 300, 400, 500, 600, 700, 800};
}

}  // namespace

double length_of_path(std::span<const Rigid3> poses) { return distances_m(poses).back(); }

std::vector<SegmentError> segment_errors(const PosePairs& pairs,
                                         std::span<const double> lengths_m,
                                         std::size_t first_frame_step) {
  const std::vector<double> distances = distances_m(pairs.truth);
  std::vector<SegmentError> errors;
  for (std::size_t first = 0; first < pairs.size(); first += first_frame_step) {
    for (const double length_m : lengths_m) {
      const std::size_t last = segment_end(distances, first, length_m);
      if (last == distances.size()) {
        continue;
      }
      const Rigid3 error = motion_error(pairs, first, last);
      errors.push_back({first, last, length_m, 100.0 * error.translation.norm() / length_m,
                        100.0 * kDegPerRad * error.angle_rad() / length_m});
    }
  }
  return errors;
}

Metrics evaluate(const PosePairs& given, const EvaluationOptions& options) {
  STEMVO_CHECK(given.size() > 0, "at least one pose");
  const Trajectory estimate = relative_to_first(given.estimate);
  const Trajectory truth = relative_to_first(given.truth);
  const PosePairs pairs(estimate, truth);

  Metrics metrics;
  metrics.path_length_m = length_of_path(truth);
  metrics.average_offset_m = average_offset_m(pairs);
  metrics.null_offset_m = average_offset_m({Trajectory(truth.size()), truth});
  metrics.segment_lengths_m = segment_lengths(options, metrics.path_length_m);
  add_segment_errors(pairs, metrics);
  metrics.ate_rmse = ate_rmse(pairs);
  add_step_errors(pairs, metrics);
  return metrics;
}

DenseErrors dense_errors(const PosePairs& pairs, std::size_t max_segments) {
  STEMVO_CHECK(pairs.size() > 0, "at least one pose");
  const double length_m = kDenseShare * length_of_path(pairs.truth);
  const std::size_t step = (pairs.size() - 1) / max_segments + 1;
  DenseErrors errors;
  for (const SegmentError& one : segment_errors(pairs, {&length_m, 1}, step)) {
    errors.t_percent.push_back(one.t_percent);
    errors.r_deg_per_100m.push_back(one.r_deg_per_100m);
    errors.block = std::max(errors.block, (one.last - one.first + step - 1) / step);
  }
  return errors;
}

Metrics evaluate_aligned(const PosePairs& pairs,
                         Alignment alignment,
                         const EvaluationOptions& options) {
  const Metrics as_it_comes = evaluate(pairs, options);
  if (alignment == Alignment::kNone) {
    return as_it_comes;
  }
  const Trajectory truth = relative_to_first(pairs.truth);
  const Trajectory aligned = align({relative_to_first(pairs.estimate), truth}, alignment);
  Metrics metrics = evaluate({aligned, pairs.truth}, options);
  metrics.alignment = alignment;
  // evaluate() moves its input back to the origin; the offset is meant where the fit has put it.
  metrics.average_offset_m = average_offset_m({aligned, truth});
  metrics.ate_rmse = as_it_comes.ate_rmse;
  return metrics;
}

Trajectory align_trajectory(std::span<const Rigid3> estimate,
                            std::span<const std::size_t> frames,
                            std::span<const Rigid3> ground_truth,
                            Alignment alignment) {
  STEMVO_CHECK(!frames.empty() && frames.size() == ground_truth.size(), "a true pose per frame");
  const Trajectory moved = relative_to(frames.front(), estimate);
  return transform(align_positions(positions(take_poses(moved, frames)),
                                   positions(relative_to_first(ground_truth)), alignment),
                   moved);
}

}  // namespace stemvo
