// SPDX-License-Identifier: MIT
#include "search/drive_score.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "geometry/degrees.hpp"
#include "stemvo/check.hpp"
#include "stemvo/evaluation/metrics.hpp"
#include "stemvo/evaluation/trajectory.hpp"

namespace stemvo::search {
namespace {

constexpr double kLeastTracked = 0.5;
constexpr std::size_t kMostPathPoints = 400;
/// Of the path so far; chosen among prefixes of clips (docs/search.md).
constexpr std::array<double, 3> kEarlyShares = {0.25, 0.5, 0.75};

/// E_t and E_r of the paper's Table 2, means over consecutive poses.
void add_changes(std::span<const Rigid3> trajectory, DriveScore& score) {
  double translation_m = 0.0;
  double rotation_rad = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const Rigid3 change = trajectory[i - 1].inverse() * trajectory[i];
    translation_m += change.translation.norm();
    rotation_rad += change.angle_rad();
  }
  const auto num_steps = static_cast<double>(std::max<std::size_t>(trajectory.size(), 2) - 1);
  score.translation_change_m = translation_m / num_steps;
  score.rotation_change_deg = kDegPerRad * rotation_rad / num_steps;
}

/// Evenly spaced, first and last included, to the centimetre.
std::vector<PathPoint> path_of(std::span<const Rigid3> trajectory) {
  const std::size_t count = std::min(trajectory.size(), kMostPathPoints);
  std::vector<PathPoint> path;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t index = count < 2 ? 0 : i * (trajectory.size() - 1) / (count - 1);
    const Eigen::Vector3d& position = trajectory[index].translation;
    path.push_back({std::round(100.0 * position.x()) / 100.0,  //
                    std::round(100.0 * position.z()) / 100.0});
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
    ++num_broken_;
  } else if (result.state == FrameState::kGated) {
    ++num_gated_;
  } else if (result.num_matches < min_inliers_) {
    ++num_few_matches_;
  } else {
    ++num_few_inliers_;
  }
}

std::string FilterDrive::missing_reason() const {
  const std::size_t num_steps = num_frames() - 1;
  if (num_matches_ == 0 && num_broken_ < num_steps) {
    return "no matches: a channel without contrast";
  }
  const std::array<std::pair<std::size_t, const char*>, 4> reasons = {
      {{num_few_matches_, "too few matches"},
       {num_few_inliers_, "too few inliers"},
       {num_gated_, "not a forward motion"},
       {num_broken_, "no picture"}}};
  const auto most =
      std::max_element(reasons.begin(), reasons.end(),
                       [](const auto& a, const auto& b) { return a.first < b.first; });
  return fmt::format("{} in {} of {} frames", most->second, most->first, num_steps);
}

DriveScore FilterDrive::score(const std::string& sequence,
                              std::span<const Rigid3> truth,
                              const EvaluationOptions& options) const {
  STEMVO_CHECK(num_frames() > 0 && truth.size() >= num_frames(), "a true pose for each frame");
  const auto num_steps = static_cast<double>(std::max<std::size_t>(num_frames(), 2) - 1);
  DriveScore score;
  score.sequence = sequence;
  score.num_frames = num_frames();
  score.mean_inliers = static_cast<double>(num_inliers_) / num_steps;
  score.tracked_fraction = static_cast<double>(num_measured_) / num_steps;
  score.is_detected = num_frames() == 1 || *score.tracked_fraction >= kLeastTracked;
  if (!score.is_detected) {
    score.reason = missing_reason();
  }
  if (num_measured_ > 0) {  // else the numbers would be those of a camera that stands
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
  add_changes(trajectory, score);
  // A standing start has no segments: nothing is known against the filter.
  score.early_error_percent = dense_t_rel_percent(trajectory, truth, kEarlyShares).value_or(0.0);
  score.path = path_of(trajectory);
}

DriveScore unusable_score(const std::string& sequence, const std::string& reason) {
  DriveScore score;
  score.sequence = sequence;
  score.reason = reason;
  return score;
}

}  // namespace stemvo::search
