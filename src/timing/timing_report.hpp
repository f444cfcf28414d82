// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace stemvo {

/// One row of `stemvo run --timing`.
struct StageTiming {
  std::string name;
  std::size_t calls = 0;
  double median_ms = 0.0;  ///< wall time of one call
  double p95_ms = 0.0;     ///< 95 of 100 calls take no longer
  double cpu_s = 0.0;      ///< of the calling thread, all calls
};

/// Where a run's time went. A stage's processor time is that of the thread that called it: what
/// OpenCV gave to other threads is in `rest_cpu_s`.
struct TimingReport {
  std::vector<StageTiming> stages;  ///< in the order a frame meets them; those never called: not
  double rest_cpu_s = 0.0;          ///< start of the program, no stage, OpenCV's other threads
  double cpu_s = 0.0;               ///< processor time of the whole program
  double fps = 0.0;                 ///< frames over wall time, process start to trajectory written
  std::size_t num_frames = 0;
  int num_threads = 0;
  double peak_memory_mib = 0.0;  ///< most the program has held at once; NaN: not told
};

}  // namespace stemvo
