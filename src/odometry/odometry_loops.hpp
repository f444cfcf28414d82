// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <mutex>
#include <vector>

#include <opencv2/core.hpp>

#include "odometry/frame_loops.hpp"
#include "odometry/phased_odometry.hpp"
#include "odometry/way.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/odometry.hpp"

namespace stemvo {

/// A frame as it comes: the pixels, as PhasedOdometry::prepare takes them, are nobody else's; an
/// Error where they could not be read.
struct GivenFrame {
  Expected<cv::Mat> image;
  double time_s = 0.0;
  FrameHints hints;
  std::vector<Way> ways = {};  ///< that came before it did
};

/// Takes frames through an odometry in FrameLoops; the results are the same for any number of
/// threads.
class OdometryLoops {
 public:
  /// Called for each frame, in order, one call at a time, from another thread where there are
  /// several, while the odometry holds what it knows of this frame. False ends the run.
  using Deliver = std::function<bool(const GivenFrame&, const FrameResult&)>;

  /// The odometry outlives this, and is used by nobody else meanwhile.
  OdometryLoops(PhasedOdometry& odometry, Deliver deliver, int num_threads);

  /// The calls of FrameLoops. What `deliver` throws ends the run too.
  [[nodiscard]] bool push(GivenFrame given);
  void wait_for(std::size_t k) { loops_.wait_for(k); }
  void finish() { loops_.finish(); }
  [[nodiscard]] bool has_thrown() const { return loops_.has_thrown(); }
  /// Waits for all frames pushed, then PhasedOdometry::reset(). False: the run has ended before.
  [[nodiscard]] bool reset();

  /// The answer of `ask` about the odometry as it was left by some frame: in `deliver` by the one
  /// delivered.
  template <typename Ask>
  [[nodiscard]] auto ask(const Ask& ask) const {
    const std::lock_guard lock(state_);
    return ask(odometry_.frames());
  }

 private:
  struct Slot {
    GivenFrame given;
    Frame frame;
  };
  [[nodiscard]] Slot& slot(std::size_t k) { return ring_[k % kMaxInFlight]; }
  [[nodiscard]] FrameStages stages();

  PhasedOdometry& odometry_;
  Deliver deliver_;
  std::array<Slot, kMaxInFlight> ring_;
  mutable std::mutex state_;  ///< of what localize() and optimize() change
  FrameLoops loops_;          ///< last, so that its threads end first
};

}  // namespace stemvo
