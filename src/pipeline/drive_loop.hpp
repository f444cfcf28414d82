// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>

#include "pipeline/checkpoint.hpp"
#include "pipeline/result_files.hpp"
#include "pipeline/result_keeper.hpp"

namespace stemvo::pipeline {

/// Takes a run's frames through the odometry, keeps what each brings, and now and then what is
/// needed to go on from there.
class DriveLoop {
 public:
  /// `identity`: as of pack().
  DriveLoop(const RunRequest& request,
            const FrameSource& sequence,
            PhasedOdometry& odometry,
            ResultKeeper& keeper,
            const RunProgress& progress,
            std::string identity);

  [[nodiscard]] Drive run(std::optional<Checkpoint> from);

 private:
  /// False: the run ends behind this frame.
  bool visit(std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose);
  /// False: the run ends before this frame, and can go on with it.
  bool may_localize(std::size_t i);
  void keep_checkpoint(std::size_t frame, std::chrono::steady_clock::time_point now);
  void keep_image(std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose);
  [[nodiscard]] bool can_go_on() const {
    return !sequence_.stream() || !sequence_.stream()->is_live;
  }

  const RunRequest& request_;
  const FrameSource& sequence_;
  PhasedOdometry& odometry_;
  ResultKeeper& keeper_;
  const RunProgress& progress_;
  std::string identity_;
  Drive drive_;
  bool is_stopped_ = false;  ///< before a frame that is there
  /// Between two checkpoints; the first come sooner.
  std::chrono::duration<double> period_{0.25};
  std::chrono::steady_clock::time_point last_checkpoint_ = std::chrono::steady_clock::now();
};

}  // namespace stemvo::pipeline
