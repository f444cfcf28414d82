// SPDX-License-Identifier: MIT
#include "search/filter_drive.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "evaluation/metrics.hpp"
#include "geometry/degrees.hpp"

namespace stemvo::search {
namespace {

constexpr std::size_t kMaxPathPoints = 400;
constexpr std::size_t kMaxDense = 400;
/// Shares of the path so far; chosen among prefixes of clips (docs/search.md).
constexpr std::array<double, 3> kEarlyShares = {0.25, 0.5, 0.75};

/// Evenly spaced, first and last included, to the centimetre.
std::vector<std::array<double, 2>> path_of(std::span<const Rigid3> trajectory) {
  const std::size_t count = std::min(trajectory.size(), kMaxPathPoints);
  std::vector<std::array<double, 2>> path;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t index = count < 2 ? 0 : i * (trajectory.size() - 1) / (count - 1);
    const Eigen::Vector3d cm = (100.0 * trajectory[index].translation).array().round();
    path.push_back({cm.x() / 100.0, cm.z() / 100.0});
  }
  return path;
}

/// Per frame after the first.
void add_mean_motion(const Trajectory& trajectory, DriveScore& score) {
  double translation_m = 0.0;
  double rotation_rad = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const Rigid3 change = trajectory[i - 1].inverse() * trajectory[i];
    translation_m += change.translation.norm();
    rotation_rad += change.angle_rad();
  }
  const auto num_steps = static_cast<double>(trajectory.size() - 1);
  score.E_t_m = translation_m / num_steps;
  score.E_r_deg = kDegPerRad * rotation_rad / num_steps;
}

void add_dense_errors(const Trajectory& trajectory,
                      std::span<const Rigid3> truth,
                      DriveScore& score) {
  DenseErrors dense = dense_errors(trajectory, truth, kMaxDense);
  for (double& percent : dense.t_percent) {
    percent = std::round(1e4 * percent) / 1e4;
  }
  score.dense_t_percent = std::move(dense.t_percent);
  score.block = dense.block;
}

/// Many drives run beside each other.
Options on_one_thread(Options options) {
  options.threads = 1;
  return options;
}

}  // namespace

FilterDrive::FilterDrive(const Config& config, const FrameSource& sequence)
    : odometry_(on_one_thread(config), sequence.camera), config_(&config), sequence_(&sequence) {}

void FilterDrive::process(const Channel* channel, const cv::Mat& frame) {
  Frame now;
  now.time_s = sequence_->time_s(num_frames());
  if (channel != nullptr) {
    now = odometry_.prepare(*channel, frame, now.time_s);
  }
  const FrameResult result = odometry_.process(std::move(now));
  if (num_frames() <= 1) {
    return;
  }
  num_matches_ += static_cast<std::size_t>(result.num_matches);
  num_inliers_ += static_cast<std::size_t>(result.num_inliers);
  ++outcomes_[is_measured(result.state)                            ? kMeasured
              : result.state == FrameState::kNoImage               ? kNoImage
              : result.state == FrameState::kGated                 ? kGated
              : result.num_matches < config_->odometry.min_inliers ? kFewMatches
                                                                   : kFewInliers];
}

DriveScore FilterDrive::score() const {
  const auto num_steps = static_cast<double>(std::max<std::size_t>(num_frames(), 2) - 1);
  DriveScore score;
  score.sequence = sequence_->name;
  score.frames = num_frames();
  score.inliers = static_cast<double>(num_inliers_) / num_steps;
  score.tracked = static_cast<double>(outcomes_[kMeasured]) / num_steps;
  score.detected = num_frames() == 1 || *score.tracked >= DriveScore::kMinTracked;
  score.reason = score.detected ? "" : missing_reason();
  if (outcomes_[kMeasured] > 0) {  // else the numbers would be those of the zero-motion baseline
    add_errors(score);
  }
  return score;
}

void FilterDrive::add_errors(DriveScore& score) const {
  const auto truth = std::span(*sequence_->ground_truth).first(num_frames());
  const Trajectory trajectory = rescale_steps(odometry_.estimator().trajectory(), truth);
  const Metrics metrics = evaluate(trajectory, truth, config_->evaluation);
  score.t_rel_percent = metrics.t_rel_percent;
  score.r_rel_deg_per_100m = metrics.r_rel_deg_per_100m;
  score.average_offset_m = metrics.average_offset_m;
  add_mean_motion(trajectory, score);
  // A standing start has no segments: nothing is known against the filter.
  score.early_error_percent = dense_t_rel_percent(trajectory, truth, kEarlyShares).value_or(0.0);
  if (num_frames() == sequence_->size()) {
    add_dense_errors(trajectory, truth, score);
  }
  score.path_xz_m = path_of(trajectory);
}

std::string FilterDrive::missing_reason() const {
  if (num_matches_ == 0 && outcomes_[kNoImage] < num_frames() - 1) {
    return "no matches: a channel without contrast";
  }
  constexpr std::array<const char*, kMeasured> kReasons = {"too few matches", "too few inliers",
                                                           "not a forward motion", "no image"};
  const auto most = std::max_element(outcomes_.begin(), outcomes_.begin() + kMeasured);
  return fmt::format("{} in {} of {} frames",
                     kReasons[static_cast<std::size_t>(most - outcomes_.begin())], *most,
                     num_frames() - 1);
}

}  // namespace stemvo::search
