// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>

#include "dataset/frame_source.hpp"
#include "odometry/channel_odometry.hpp"
#include "search/records.hpp"

namespace stemvo::search {

/// One filter's odometry over one sequence, and what is counted on the way.
class FilterDrive {
 public:
  /// The configuration was checked; the sequence, with ground truth, stays where it is.
  FilterDrive(const Config& config, const FrameSource& sequence);

  /// Null: no image, or a stem that refused it.
  void process(const Channel* channel, const cv::Mat& frame);

  [[nodiscard]] std::size_t num_frames() const { return odometry_.estimator().trajectory().size(); }
  /// Of the frames so far, at least one (checked).
  [[nodiscard]] DriveScore score() const;

 private:
  void add_errors(DriveScore& score) const;
  [[nodiscard]] std::string missing_reason() const;

  ChannelOdometry odometry_;
  const FrameSource* sequence_;
  EvaluationOptions evaluation_;
  int min_inliers_;
  // Of the frames after the first.
  std::size_t num_matches_ = 0;
  std::size_t num_inliers_ = 0;
  enum Outcome { kFewMatches, kFewInliers, kGated, kNoImage, kMeasured, kNumOutcomes };
  std::array<std::size_t, kNumOutcomes> outcomes_{};
};

}  // namespace stemvo::search
