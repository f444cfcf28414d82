// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <utility>

#include <fmt/format.h>

#include "odometry/metric_scale.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/odometry.hpp"

namespace stemvo {

/// Tells a Log what changes from frame to frame.
class EventLog {
 public:
  void set(Log log) { log_ = std::move(log); }
  /// The next frame's.
  void observe(const FrameResult& result) {
    observe_state(result);
    observe_scale(result);
    if (!result.problem.empty() && result.problem != problem_) {
      tell(LogLevel::kWarning, result, result.problem);
    }
    problem_ = result.problem;
  }
  /// A new world begins.
  void restart() { *this = EventLog(std::move(log_)); }

  EventLog() = default;

 private:
  explicit EventLog(Log log) : log_(std::move(log)) {}
  void observe_state(const FrameResult& result) {
    if (result.state == FrameState::kLost && !is_lost_) {
      is_lost_ = true;
      tell(LogLevel::kWarning, result, "lost: the last motion is continued");
    } else if (result.state == FrameState::kInitializing) {
      has_map_ = false;
    } else if (result.state == FrameState::kTracking && !(has_map_ && !is_lost_)) {
      tell(LogLevel::kInfo, result,
           has_map_   ? "recovered: localized in the map of before"
           : is_lost_ ? "a new map was opened"
                      : "a map was opened");
      has_map_ = true;
      is_lost_ = false;
    }
  }
  void observe_scale(const FrameResult& result) {
    const bool is_believed = has_metres(result);
    if (is_believed != is_scale_believed_) {
      tell(is_believed ? LogLevel::kInfo : LogLevel::kWarning, result,
           is_believed ? "the scale is believed: lengths are metres"
                       : "the scale is doubted: lengths are a guess");
    }
    is_scale_believed_ = is_believed;
    if (std::exchange(road_reason_, result.road_reason) != kRoadContradicted &&
        road_reason_ == kRoadContradicted) {
      tell(LogLevel::kWarning, result, "road and speeds contradict each other");
    }
  }
  void tell(LogLevel level, const FrameResult& result, const std::string& text) const {
    if (log_) {
      log_(level, fmt::format("{:.3f} s: {}", result.time_s, text));
    }
  }

  Log log_;
  bool has_map_ = false;
  bool is_lost_ = false;
  bool is_scale_believed_ = false;
  std::string_view road_reason_;
  std::string problem_;  ///< of the last frame
};

}  // namespace stemvo
