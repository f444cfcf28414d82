// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "odometry/channel_odometry.hpp"
#include "stemvo/dataset/sequence.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo::search {

/// One filter's odometry over one sequence, and what is counted on the way.
class FilterDrive {
 public:
  explicit FilterDrive(ChannelOdometry odometry, int min_inliers)
      : odometry_(std::move(odometry)), min_inliers_(min_inliers) {}

  void process(const Channel& channel, const cv::Mat& frame) {
    count(odometry_.process(channel, frame));
  }
  /// No picture, or a stem that refused it.
  void process_missing() { count(odometry_.process_missing()); }

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

  ChannelOdometry odometry_;
  int min_inliers_;
  std::size_t num_measured_ = 0;  ///< after the first frame
  std::size_t num_few_matches_ = 0;
  std::size_t num_few_inliers_ = 0;
  std::size_t num_gated_ = 0;
  std::size_t num_broken_ = 0;
  std::size_t num_matches_ = 0;  ///< in all frames together
  std::size_t num_inliers_ = 0;
};

/// A filter whose layer cannot be run on this sequence.
[[nodiscard]] DriveScore unusable_score(const std::string& sequence, const std::string& reason);

}  // namespace stemvo::search
