// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace stemvo {

/// Wall time of something done many times, milliseconds; NaN where it was never done.
struct TimeSummary {
  double median_ms = 0.0;
  double p95_ms = 0.0;  ///< 95 of 100 take no longer
};
/// By nearest rank: both are among the values.
[[nodiscard]] TimeSummary summarize_ms(std::span<const double> values_ms);

/// One row of `stemvo run --timing`.
struct StageTiming {
  std::string name;
  std::size_t calls = 0;       ///< at most one per frame
  TimeSummary wall;            ///< of one call
  double cpu_s = 0.0;          ///< of the calling thread, all calls
  double share_percent = 0.0;  ///< of the program's processor time
};

/// Where a run's time went. A stage's processor time is that of the thread that called it: what
/// OpenCV gave to other threads is in `rest_cpu_s` (with one thread it gives nothing away).
struct TimingReport {
  std::vector<StageTiming> stages;  ///< in the order a frame meets them; those never called: not
  double start_cpu_s = 0.0;         ///< before the first frame: libraries, model, sequence
  double rest_cpu_s = 0.0;          ///< of no stage, and OpenCV's other threads
  double cpu_s = 0.0;               ///< processor time of the whole program: the sum of the above
  std::size_t num_frames = 0;
  double loop_s = 0.0;   ///< wall time of the loop over the frames
  TimeSummary interval;  ///< wall time from one frame's result to the next
  TimeSummary latency;   ///< wall time from asking for a frame to its result
  double fps = 0.0;      ///< frames over wall time, process start to trajectory written
  int num_threads = 0;
  double peak_memory_mib = 0.0;  ///< most the program has held at once; NaN: not told
};

}  // namespace stemvo
