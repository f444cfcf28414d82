// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>

namespace stemvo {

/// Frames at work at a time, the one whose result is awaited among them. Frame k + kMaxInFlight is
/// read when frame k is optimized: a ring of so many frames is enough.
inline constexpr std::size_t kMaxInFlight = 6;

/// A frame goes through these, in this order; each is given the frame's number, counted from 0.
/// Each stage takes the frames in order.
struct FrameStages {
  std::function<bool(std::size_t)> read;  ///< false: no frame is there, nor any behind it
  std::function<void(std::size_t)> prepare;
  std::function<void(std::size_t)> track;     ///< after localize() of the frame before
  std::function<void(std::size_t)> localize;  ///< after optimize() of the frame before
  std::function<bool(std::size_t)> optimize;  ///< beside track() of the next; false ends the run
};

/// Takes frames 0 .. num_frames - 1, or those there are, through three loops, each in a thread:
/// read and prepare, track and localize, optimize (in the calling one). With one thread a frame
/// goes through all stages before the next is read. A stage that throws ends the run; the exception
/// is thrown again. Frames begun are dropped then.
void run_frame_loops(const FrameStages& stages, std::size_t num_frames, int num_threads);

}  // namespace stemvo
