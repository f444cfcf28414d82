// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "evaluation/metrics.hpp"
#include "evaluation/trajectory.hpp"
#include "stemvo/frame_result.hpp"

namespace stemvo::robustness {

/// One drive under one disturbance through one channel.
struct Outcome {
  bool is_refused = false;              ///< it did not run: nothing below is known
  std::optional<double> t_rel_percent;  ///< KITTI's, steps of the true length
  std::optional<double> r_rel_deg_per_100m;
  double tracked = 0.0;  ///< share of frames with a measured motion
  /// Frames from the end of a disturbance to the first that is found again (measured against
  /// landmarks, not initializing), the longest of them; nullopt: no disturbance ends.
  std::optional<std::size_t> recovery_frames;
  bool is_recovered = true;  ///< false: the drive, or the calm before the next disturbance, ended
  /// Steps between found frames whose rotation is wrong by more than a degree.
  std::size_t jumps = 0;
  DenseErrors dense;
};

/// Tracked, recovery and jumps. All of one length, at least one frame (checked).
void add_states(std::span<const FrameState> states,
                std::span<const Rigid3> estimate,
                std::span<const Rigid3> ground_truth,
                const std::vector<bool>& is_disturbed,
                Outcome& outcome);

/// The errors.
void add_errors(std::span<const Rigid3> estimate,
                std::span<const Rigid3> ground_truth,
                const EvaluationOptions& options,
                Outcome& outcome);

}  // namespace stemvo::robustness
