// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>

#include "stemvo/benchmark/benchmark.hpp"

namespace stemvo::benchmark {

/// The folder of a run's files: OUT/runs/NN/NAME_PROTOCOL.
[[nodiscard]] std::filesystem::path run_folder(const std::filesystem::path& out_dir,
                                               const std::string& sequence,
                                               const BenchmarkRun& run);

/// Tells the caller where the benchmark is, and remembers that it was told to stop.
class Reporter {
 public:
  Reporter(const BenchmarkCallback& callback, std::size_t num_runs)
      : callback_(callback), num_runs_(num_runs) {}

  void start(const std::string& sequence, const BenchmarkRun& run);
  bool update(std::size_t frames_done, std::size_t num_frames, const std::string& note = {});
  [[nodiscard]] bool is_stopped() const { return is_stopped_; }

 private:
  const BenchmarkCallback& callback_;
  BenchmarkProgress progress_;
  std::size_t num_runs_;
  std::size_t num_started_ = 0;
  bool is_stopped_ = false;
};

/// Takes the kept result, or runs; fills state, report, problem and warnings. A run stopped by the
/// reporter stays pending.
void complete_run(const BenchmarkRequest& request,
                  const BenchmarkConfiguration& configuration,
                  const std::string& sequence,
                  Reporter& reporter,
                  BenchmarkRun& run);

}  // namespace stemvo::benchmark
