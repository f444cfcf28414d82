// SPDX-License-Identifier: MIT
#include "calibration/segment.hpp"

#include <algorithm>
#include <utility>

namespace stemvo::calibration {

double turned_rad(const Segment& segment) {
  double sum = 0.0;
  for (std::size_t k = 1; k < segment.camera_from_first.size(); ++k) {
    sum += (segment.camera_from_first[k] * segment.camera_from_first[k - 1].inverse()).angle_rad();
  }
  return sum;
}

void keep_turns(std::vector<Segment>& segments, std::size_t max_segments) {
  if (segments.size() <= max_segments) {
    return;
  }
  std::vector<std::pair<double, std::size_t>> turns;  // most first, of equals the earlier
  for (std::size_t i = 0; i < segments.size(); ++i) {
    turns.emplace_back(-turned_rad(segments[i]), i);
  }
  std::sort(turns.begin(), turns.end());
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < max_segments; ++i) {
    kept.push_back(turns[i].second);
  }
  std::sort(kept.begin(), kept.end());
  std::vector<Segment> result;
  for (const std::size_t i : kept) {
    result.push_back(std::move(segments[i]));
  }
  segments = std::move(result);
}

}  // namespace stemvo::calibration
