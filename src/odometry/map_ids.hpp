// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace stemvo {

/// FrameResult::map_id.
class MapIds {
 public:
  /// The map of the frame in work.
  [[nodiscard]] int now() const { return now_; }
  void begin() { now_ = num_maps_++; }
  /// The camera is in the map of an earlier frame; one below 0 is another recording's.
  void go_back_to(int frame) { now_ = of(frame); }
  /// The map is joined to that of an earlier frame.
  void join(int frame) {
    const int joined = of(frame);
    std::ranges::replace(of_frame_, now_, joined);
    now_ = joined;
  }
  void end_frame() { of_frame_.push_back(now_); }

 private:
  [[nodiscard]] int of(int frame) const {
    return frame < 0 ? -1 : of_frame_[static_cast<std::size_t>(frame)];
  }

  int now_ = 0;
  int num_maps_ = 0;
  std::vector<int> of_frame_;
};

}  // namespace stemvo
