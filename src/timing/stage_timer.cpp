// SPDX-License-Identifier: MIT
#include "timing/stage_timer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>

#include "internal_check.hpp"

namespace stemvo {
namespace {

constexpr std::array<std::string_view, kNumStages> kNames = {
    "read and decode",     "stem",         "contrast",          "pyramid",    "description",
    "road image",          "detection",    "tracking",          "homography", "epipolar geometry",
    "two-view refinement", "localization", "window refinement", "camera",     "road scale",
    "frame files",         "result files"};

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double read_ms(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

double ms_between(std::chrono::steady_clock::time_point from,
                  std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double, std::milli>(to - from).count();
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
  return kNaN;
}

double nearest_rank(std::vector<double>& values, double share) {
  const double rank = std::max(1.0, std::ceil(share * static_cast<double>(values.size())));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank) - 1;
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

TimeSummary summarize_ms(std::span<const double> values_ms) {
  if (values_ms.empty()) {
    return {kNaN, kNaN};
  }
  std::vector<double> values(values_ms.begin(), values_ms.end());
  return {nearest_rank(values, 0.5), nearest_rank(values, 0.95)};
}

std::atomic<StageRecorder*> StageRecorder::active_ = nullptr;

StageRecorder::StageRecorder()
    : start_cpu_ms_(read_ms(CLOCK_PROCESS_CPUTIME_ID)),
      start_(std::chrono::steady_clock::now()),
      last_frame_(start_),
      stages_(kNumStages) {
  StageRecorder* none = nullptr;
  STEMVO_CHECK(active_.compare_exchange_strong(none, this), "one run at a time is timed");
}

StageRecorder::~StageRecorder() { active_.store(nullptr, std::memory_order_release); }

void StageRecorder::add(Stage stage, double wall_ms, double cpu_ms) {
  const std::lock_guard lock(mutex_);
  Samples& samples = stages_[static_cast<std::size_t>(stage)];
  samples.wall_ms.push_back(wall_ms);
  samples.cpu_ms += cpu_ms;
}

void StageRecorder::add_frame(std::chrono::steady_clock::time_point started) {
  const auto now = std::chrono::steady_clock::now();
  const std::lock_guard lock(mutex_);
  intervals_ms_.push_back(ms_between(last_frame_, now));
  latencies_ms_.push_back(ms_between(started, now));
  last_frame_ = now;
}

double StageRecorder::cpu_ms(Stage stage) const {
  const std::lock_guard lock(mutex_);
  return stages_[static_cast<std::size_t>(stage)].cpu_ms;
}

TimingReport StageRecorder::report() const {
  const double total_ms = read_ms(CLOCK_PROCESS_CPUTIME_ID);
  const std::lock_guard lock(mutex_);
  TimingReport report;
  double rest_ms = total_ms - start_cpu_ms_;
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    const Samples& samples = stages_[i];
    if (samples.wall_ms.empty()) {
      continue;
    }
    report.stages.push_back({std::string(kNames[i]), samples.wall_ms.size(),
                             summarize_ms(samples.wall_ms), samples.cpu_ms / 1e3,
                             100.0 * samples.cpu_ms / total_ms});
    rest_ms -= samples.cpu_ms;
  }
  report.start_cpu_s = start_cpu_ms_ / 1e3;
  report.rest_cpu_s = rest_ms / 1e3;
  report.cpu_s = total_ms / 1e3;
  report.num_frames = intervals_ms_.size();
  report.loop_s = ms_between(start_, last_frame_) / 1e3;
  report.interval = summarize_ms(intervals_ms_);
  report.latency = summarize_ms(latencies_ms_);
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
    recorder_->add(stage_, ms_between(wall_, std::chrono::steady_clock::now()), spent_ms);
  }
}

}  // namespace stemvo
