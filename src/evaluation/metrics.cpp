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
constexpr double kDevkitLengths_m[] = {100, 200, 300, 400, 500, 600, 700, 800};
constexpr double kShortLengths_m[] = {10, 20, 30, 40, 50};

std::vector<Eigen::Vector3d> positions(std::span<const Rigid3> poses) {
  std::vector<Eigen::Vector3d> result;
  result.reserve(poses.size());
  for (const Rigid3& pose : poses) {
    result.push_back(pose.translation);
  }
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
  Trajectory result;
  result.reserve(poses.size());
  for (const Rigid3& pose : poses) {
    result.push_back(by * pose);
  }
  return result;
}

/// Both start at the identity. Umeyama's fit on positions.
Trajectory align(std::span<const Rigid3> estimate,
                 std::span<const Rigid3> ground_truth,
                 Alignment alignment) {
  return transform(align_positions(positions(estimate), positions(ground_truth), alignment),
                   estimate);
}

double rmse_m(std::span<const Eigen::Vector3d> estimate, std::span<const Eigen::Vector3d> truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    sum += (estimate[i] - truth[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(estimate.size()));
}

AbsoluteTrajectoryError ate_rmse(std::span<const Rigid3> estimate,
                                 std::span<const Rigid3> ground_truth) {
  const std::vector<Eigen::Vector3d> truth = positions(ground_truth);
  const auto after_m = [&](Alignment alignment) {
    return rmse_m(positions(align(estimate, ground_truth, alignment)), truth);
  };
  return {rmse_m(positions(estimate), truth), after_m(Alignment::kScale), after_m(Alignment::kSe3),
          after_m(Alignment::kSim3)};
}

/// The rest of the true motion first -> last after undoing the estimated one (devkit).
Rigid3 motion_error(std::span<const Rigid3> estimate,
                    std::span<const Rigid3> ground_truth,
                    std::size_t first,
                    std::size_t last) {
  const Rigid3 estimated = estimate[first].inverse() * estimate[last];
  const Rigid3 truth = ground_truth[first].inverse() * ground_truth[last];
  return estimated.inverse() * truth;
}

void add_step_errors(std::span<const Rigid3> estimate,
                     std::span<const Rigid3> ground_truth,
                     Metrics& metrics) {
  if (estimate.size() < 2) {
    return;
  }
  double sum_m = 0.0;
  double sum_rad = 0.0;
  for (std::size_t i = 1; i < estimate.size(); ++i) {
    const Rigid3 error = motion_error(estimate, ground_truth, i - 1, i);
    sum_m += error.translation.norm();
    sum_rad += error.angle_rad();
  }
  metrics.rpe_translation_m = sum_m / static_cast<double>(estimate.size() - 1);
  metrics.rpe_rotation_deg = kDegPerRad * sum_rad / static_cast<double>(estimate.size() - 1);
}

/// First frame more than `length_m` behind `first`; the number of frames when there is none.
std::size_t segment_end(std::span<const double> distances, std::size_t first, double length_m) {
  const auto end = std::upper_bound(distances.begin() + static_cast<std::ptrdiff_t>(first),
                                    distances.end(), distances[first] + length_m);
  return static_cast<std::size_t>(end - distances.begin());
}

/// t_rel and r_rel: mean over all segments of all lengths, each divided by its nominal length.
void add_segment_errors(std::span<const Rigid3> estimate,
                        std::span<const Rigid3> ground_truth,
                        std::size_t first_frame_step,
                        Metrics& metrics) {
  const std::vector<SegmentError> segments =
      segment_errors(estimate, ground_truth, metrics.segment_lengths_m, first_frame_step);
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
  if (path_length_m < kShortPath_m) {
    return {std::begin(kShortLengths_m), std::end(kShortLengths_m)};
  }
  return {std::begin(kDevkitLengths_m), std::end(kDevkitLengths_m)};
}

}  // namespace

double length_of_path(std::span<const Rigid3> poses) { return distances_m(poses).back(); }

std::vector<SegmentError> segment_errors(std::span<const Rigid3> estimate,
                                         std::span<const Rigid3> ground_truth,
                                         std::span<const double> lengths_m,
                                         std::size_t first_frame_step) {
  STEMVO_CHECK(estimate.size() == ground_truth.size(), "one true pose per estimated pose");
  const std::vector<double> distances = distances_m(ground_truth);
  std::vector<SegmentError> errors;
  for (std::size_t first = 0; first < ground_truth.size(); first += first_frame_step) {
    for (const double length_m : lengths_m) {
      const std::size_t last = segment_end(distances, first, length_m);
      if (last == distances.size()) {
        continue;
      }
      const Rigid3 error = motion_error(estimate, ground_truth, first, last);
      errors.push_back({first, last, length_m, 100.0 * error.translation.norm() / length_m,
                        100.0 * kDegPerRad * error.angle_rad() / length_m});
    }
  }
  return errors;
}

double average_offset_m(std::span<const Rigid3> estimate, std::span<const Rigid3> ground_truth) {
  STEMVO_CHECK(estimate.size() == ground_truth.size(), "one true pose per estimated pose");
  STEMVO_CHECK(!estimate.empty(), "at least one pose");
  double sum = 0.0;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const Eigen::Vector3d offset = estimate[i].translation - ground_truth[i].translation;
    sum += std::abs(offset.x()) + std::abs(offset.z());
  }
  return sum / static_cast<double>(estimate.size());
}

Metrics evaluate(std::span<const Rigid3> estimate,
                 std::span<const Rigid3> ground_truth,
                 const EvaluationOptions& options) {
  STEMVO_CHECK(estimate.size() == ground_truth.size(), "one true pose per estimated pose");
  STEMVO_CHECK(!estimate.empty(), "at least one pose");
  const Trajectory est = relative_to_first(estimate);
  const Trajectory truth = relative_to_first(ground_truth);

  Metrics metrics;
  metrics.path_length_m = length_of_path(truth);
  metrics.average_offset_m = average_offset_m(est, truth);
  metrics.null_offset_m = average_offset_m(Trajectory(truth.size()), truth);
  metrics.segment_lengths_m = segment_lengths(options, metrics.path_length_m);
  add_segment_errors(est, truth, kFirstFrameStep, metrics);
  metrics.ate_rmse = ate_rmse(est, truth);
  add_step_errors(est, truth, metrics);
  return metrics;
}

DenseErrors dense_errors(std::span<const Rigid3> estimate,
                         std::span<const Rigid3> ground_truth,
                         std::size_t max_segments) {
  STEMVO_CHECK(!estimate.empty(), "at least one pose");
  const double length_m = kDenseShare * length_of_path(ground_truth);
  const std::size_t step = (estimate.size() - 1) / max_segments + 1;
  DenseErrors errors;
  for (const SegmentError& one : segment_errors(estimate, ground_truth, {&length_m, 1}, step)) {
    errors.t_percent.push_back(one.t_percent);
    errors.r_deg_per_100m.push_back(one.r_deg_per_100m);
    errors.block = std::max(errors.block, (one.last - one.first + step - 1) / step);
  }
  return errors;
}

Metrics evaluate_aligned(std::span<const Rigid3> estimate,
                         std::span<const Rigid3> ground_truth,
                         Alignment alignment,
                         const EvaluationOptions& options) {
  const Metrics as_it_comes = evaluate(estimate, ground_truth, options);
  if (alignment == Alignment::kNone) {
    return as_it_comes;
  }
  const Trajectory aligned =
      align(relative_to_first(estimate), relative_to_first(ground_truth), alignment);
  Metrics metrics = evaluate(aligned, ground_truth, options);
  metrics.alignment = alignment;
  // evaluate() moves its input back to the origin; the offset is meant where the fit has put it.
  metrics.average_offset_m = average_offset_m(aligned, relative_to_first(ground_truth));
  metrics.ate_rmse = as_it_comes.ate_rmse;
  return metrics;
}

Trajectory align_trajectory(std::span<const Rigid3> estimate,
                            std::span<const std::size_t> frames,
                            std::span<const Rigid3> ground_truth,
                            Alignment alignment) {
  STEMVO_CHECK(!frames.empty() && frames.size() == ground_truth.size(), "a true pose per frame");
  const Rigid3 first_from_world = estimate[frames.front()].inverse();
  Trajectory moved;
  moved.reserve(estimate.size());
  for (const Rigid3& pose : estimate) {
    moved.push_back(first_from_world * pose);
  }
  moved[frames.front()] = Rigid3();  // exactly
  return transform(align_positions(positions(take_poses(moved, frames)),
                                   positions(relative_to_first(ground_truth)), alignment),
                   moved);
}

}  // namespace stemvo
