// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <utility>

#include "odometry/channel_odometry.hpp"
#include "search/search.hpp"

namespace stemvo::search {

/// One filter's odometry over one sequence, and what is counted on the way.
class FilterDrive {
 public:
  /// The configuration was checked.
  FilterDrive(const Config& config, const Camera& camera)
      : odometry_(config, camera), min_inliers_(config.odometry.min_inliers) {}

  void process(const Channel& channel, const cv::Mat& frame) {
    count(odometry_.process(odometry_.prepare(channel, frame)));
  }
  /// No image, or a stem that refused it.
  void process_missing() { count(odometry_.process({})); }

  [[nodiscard]] std::size_t num_frames() const { return odometry_.estimator().trajectory().size(); }
  /// Of the frames so far. The truth has at least as many poses (checked), the first the identity.
  [[nodiscard]] DriveScore score(const std::string& sequence,
                                 std::span<const Rigid3> truth,
                                 const EvaluationOptions& options) const;

 private:
  void count(const FrameResult& result);
  void add_errors(std::span<const Rigid3> truth,
                  const EvaluationOptions& options,
                  DriveScore& score) const;
  [[nodiscard]] std::string missing_reason() const;
  /// At least 1.
  [[nodiscard]] double num_steps() const {
    return static_cast<double>(std::max<std::size_t>(num_frames(), 2) - 1);
  }

  ChannelOdometry odometry_;
  int min_inliers_;
  // Of the frames after the first.
  std::size_t num_measured_ = 0;
  std::size_t num_matches_ = 0;
  std::size_t num_inliers_ = 0;
  enum Failure { kFewMatches, kFewInliers, kGated, kNoImage, kNumFailures };
  std::array<std::size_t, kNumFailures> num_failed_{};
};

}  // namespace stemvo::search
