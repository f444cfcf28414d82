// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <utility>

#include "stemvo/frame_result.hpp"
#include "stemvo/odometry.hpp"

namespace stemvo {

/// Tells a Log what changes from frame to frame.
class EventLog {
 public:
  void set(Log log) { log_ = std::move(log); }
  /// The next frame's.
  void observe(const FrameResult& result);
  /// A new world begins.
  void restart() { *this = EventLog(std::move(log_)); }

  EventLog() = default;

 private:
  explicit EventLog(Log log) : log_(std::move(log)) {}
  void observe_state(const FrameResult& result);
  void observe_scale(const FrameResult& result);
  void tell(LogLevel level, const FrameResult& result, const std::string& text) const;

  Log log_;
  bool has_map_ = false;
  bool is_lost_ = false;
  bool is_scale_believed_ = false;
  std::string problem_;  ///< of the last frame
};

}  // namespace stemvo
