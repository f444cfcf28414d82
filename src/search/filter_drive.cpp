// SPDX-License-Identifier: MIT
#include "search/filter_drive.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "evaluation/metrics.hpp"
#include "geometry/degrees.hpp"
#include "internal_check.hpp"

namespace stemvo::search {
namespace {

constexpr double kMinTracked = 0.5;
constexpr std::size_t kMaxPathPoints = 400;
/// Of the path so far; chosen among prefixes of clips (docs/search.md).
constexpr std::array<double, 3> kEarlyShares = {0.25, 0.5, 0.75};

/// Evenly spaced, first and last included, to the centimetre.
std::vector<std::array<double, 2>> path_of(std::span<const Rigid3> trajectory) {
  const auto rounded = [](double metres) { return std::round(100.0 * metres) / 100.0; };
  const std::size_t count = std::min(trajectory.size(), kMaxPathPoints);
  std::vector<std::array<double, 2>> path;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t index = count < 2 ? 0 : i * (trajectory.size() - 1) / (count - 1);
    const Eigen::Vector3d& position = trajectory[index].translation;
    path.push_back({rounded(position.x()), rounded(position.z())});
  }
  return path;
}

}  // namespace

void FilterDrive::count(const FrameResult& result) {
  if (num_frames() <= 1) {
    return;
  }
  num_matches_ += static_cast<std::size_t>(result.num_matches);
  num_inliers_ += static_cast<std::size_t>(result.num_inliers);
  if (is_measured(result.state)) {
    ++num_measured_;
  } else if (result.state == FrameState::kNoImage) {
    ++num_failed_[kNoImage];
  } else if (result.state == FrameState::kGated) {
    ++num_failed_[kGated];
  } else {
    ++num_failed_[result.num_matches < min_inliers_ ? kFewMatches : kFewInliers];
  }
}

std::string FilterDrive::missing_reason() const {
  if (num_matches_ == 0 && num_failed_[kNoImage] < num_frames() - 1) {
    return "no matches: a channel without contrast";
  }
  constexpr std::array<const char*, kNumFailures> kReasons = {"too few matches", "too few inliers",
                                                              "not a forward motion", "no picture"};
  const auto most = std::ranges::max_element(num_failed_);
  return fmt::format("{} in {} of {} frames",
                     kReasons[static_cast<std::size_t>(most - num_failed_.begin())], *most,
                     num_frames() - 1);
}

DriveScore FilterDrive::score(const std::string& sequence,
                              std::span<const Rigid3> truth,
                              const EvaluationOptions& options) const {
  STEMVO_CHECK(num_frames() > 0 && truth.size() >= num_frames(), "ground truth for each frame");
  DriveScore score;
  score.sequence = sequence;
  score.num_frames = num_frames();
  score.mean_inliers = static_cast<double>(num_inliers_) / num_steps();
  score.tracked_fraction = static_cast<double>(num_measured_) / num_steps();
  score.is_detected = num_frames() == 1 || *score.tracked_fraction >= kMinTracked;
  if (!score.is_detected) {
    score.reason = missing_reason();
  }
  if (num_measured_ > 0) {  // else the numbers would be those of the zero-motion baseline
    add_errors(truth.first(num_frames()), options, score);
  }
  return score;
}

void FilterDrive::add_errors(std::span<const Rigid3> truth,
                             const EvaluationOptions& options,
                             DriveScore& score) const {
  const Trajectory trajectory = rescale_steps(odometry_.estimator().trajectory(), truth);
  const Metrics metrics = evaluate(trajectory, truth, options);
  score.t_rel_percent = metrics.t_rel_percent;
  score.r_rel_deg_per_100m = metrics.r_rel_deg_per_100m;
  score.average_offset_m = metrics.average_offset_m;
  double translation_m = 0.0;
  double rotation_rad = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const Rigid3 change = trajectory[i - 1].inverse() * trajectory[i];
    translation_m += change.translation.norm();
    rotation_rad += change.angle_rad();
  }
  score.translation_change_m = translation_m / num_steps();
  score.rotation_change_deg = kDegPerRad * rotation_rad / num_steps();
  // A standing start has no segments: nothing is known against the filter.
  score.early_error_percent = dense_t_rel_percent(trajectory, truth, kEarlyShares).value_or(0.0);
  score.path = path_of(trajectory);
}

}  // namespace stemvo::search
