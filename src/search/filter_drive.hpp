// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "odometry/channel_odometry.hpp"
#include "search/records.hpp"
#include "stem/stem.hpp"

namespace stemvo::search {

/// One filter's odometry over one sequence, and what is counted on the way.
class FilterDrive {
 public:
  /// The sequence, with ground truth, stays where it is, as the configuration.
  FilterDrive(const Config& config, const FrameSource& sequence);

  [[nodiscard]] std::size_t num_frames() const { return odometry_.estimator().trajectory().size(); }

  /// Null: no image, or a stem that refused it.
  void process(const Channel* channel, const cv::Mat& frame);

  /// Score over the frames so far, at least one.
  [[nodiscard]] DriveScore score() const;

 private:
  void add_errors(DriveScore& score) const;
  [[nodiscard]] std::string missing_reason() const;

  ChannelOdometry odometry_;
  const Config* config_;
  const FrameSource* sequence_;
  // Sums over the frames after the first.
  std::size_t num_matches_ = 0;
  std::size_t num_inliers_ = 0;
  enum Outcome { kFewMatches, kFewInliers, kGated, kNoImage, kMeasured, kNumOutcomes };
  std::array<std::size_t, kNumOutcomes> outcomes_{};
};

}  // namespace stemvo::search
