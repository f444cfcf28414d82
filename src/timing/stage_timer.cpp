// SPDX-License-Identifier: MIT
#include "timing/stage_timer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <fstream>
#include <limits>
#include <string_view>

#include "internal_check.hpp"

namespace stemvo {
namespace {

constexpr std::array<std::string_view, kNumStages> kNames = {"read and decode",
                                                             "stem",
                                                             "contrast",
                                                             "pyramid",
                                                             "description",
                                                             "road image",
                                                             "detection",
                                                             "tracking",
                                                             "homography",
                                                             "epipolar geometry",
                                                             "two-view refinement",
                                                             "localization",
                                                             "window refinement",
                                                             "camera",
                                                             "road scale",
                                                             "places",
                                                             "pose graph",
                                                             "frame files",
                                                             "result files"};

double read_ms(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

/// VmHWM of /proc/self/status: unlike getrusage, not that of the program that started this one.
double peak_memory_mib() {
  std::ifstream status("/proc/self/status");
  for (std::string key; status >> key;) {
    double kib = 0.0;
    if (key == "VmHWM:" && status >> kib) {
      return kib / 1024.0;
    }
  }
  return std::numeric_limits<double>::quiet_NaN();
}

/// One of the values: that which a share of them does not exceed.
double nearest_rank(std::vector<double> values, double share) {
  const double rank = std::max(1.0, std::ceil(share * static_cast<double>(values.size())));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank) - 1;
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

std::atomic<StageRecorder*> StageRecorder::active_ = nullptr;

StageRecorder::StageRecorder() : stages_(kNumStages) {
  StageRecorder* none = nullptr;
  STEMVO_CHECK(active_.compare_exchange_strong(none, this), "one run at a time is timed");
}

void StageRecorder::add(Stage stage, double wall_ms, double cpu_ms) {
  const std::lock_guard lock(mutex_);
  Samples& samples = stages_[static_cast<std::size_t>(stage)];
  samples.wall_ms.push_back(wall_ms);
  samples.cpu_ms += cpu_ms;
}

TimingReport StageRecorder::report() const {
  const std::lock_guard lock(mutex_);
  TimingReport report;
  report.cpu_s = read_ms(CLOCK_PROCESS_CPUTIME_ID) / 1e3;
  report.rest_cpu_s = report.cpu_s;
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    const auto& [wall_ms, cpu_ms] = stages_[i];
    if (!wall_ms.empty()) {
      report.stages.push_back({std::string(kNames[i]), wall_ms.size(), nearest_rank(wall_ms, 0.5),
                               nearest_rank(wall_ms, 0.95), cpu_ms / 1e3});
      report.rest_cpu_s -= cpu_ms / 1e3;
    }
  }
  report.peak_memory_mib = peak_memory_mib();
  return report;
}

StageTimer::StageTimer(Stage stage) : recorder_(StageRecorder::active()), stage_(stage) {
  if (recorder_ != nullptr) {
    wall_ = std::chrono::steady_clock::now();
    cpu_ms_ = read_ms(CLOCK_THREAD_CPUTIME_ID);
  }
}

StageTimer::~StageTimer() {
  if (recorder_ != nullptr) {
    const double spent_ms = read_ms(CLOCK_THREAD_CPUTIME_ID) - cpu_ms_;
    const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - wall_;
    recorder_->add(stage_, wall.count(), spent_ms);
  }
}

}  // namespace stemvo
