// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>

namespace stemvo::pipeline {

/// Frames at work at a time, the one whose result is awaited among them: enough that no stage waits
/// for another's slow frame. Frame k + kMaxInFlight is begun when frame k is optimized.
inline constexpr std::size_t kMaxInFlight = 6;

/// What is done with a frame, in this order; given the frame's number, counted from 0.
struct FrameStages {
  /// Several frames at a time, begun in order; false: no frame is there, nor any behind it.
  std::function<bool(std::size_t)> read;
  std::function<void(std::size_t)> prepare;   ///< from here on one frame at a time, in order
  std::function<void(std::size_t)> track;     ///< after localize() of the frame before
  std::function<void(std::size_t)> localize;  ///< after optimize() of the frame before
  std::function<bool(std::size_t)> optimize;  ///< beside track() of the next; false ends the run
};

/// Takes frames 0 .. num_frames - 1, or those there are, through the stages on `num_threads`
/// threads, the calling one among them; one with nothing to do helps with the loops of OpenCV that
/// a stage is in. What a stage throws ends the run and is thrown again; frames begun are dropped
/// then.
void run_stages(const FrameStages& stages, std::size_t num_frames, int num_threads);

}  // namespace stemvo::pipeline
