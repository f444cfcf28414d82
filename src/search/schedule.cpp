// SPDX-License-Identifier: MIT
#include "search/schedule.hpp"

#include <algorithm>
#include <cmath>

namespace stemvo::search {

Schedule halving_schedule(std::size_t num_filters) {
  constexpr int kNumRungs = 5;
  Schedule schedule;
  double share = std::pow(0.5, kNumRungs - 1);
  std::size_t count = num_filters;
  for (int i = 0; i < kNumRungs; ++i) {
    schedule.push_back({share, count});
    share *= 2.0;
    count = std::min(count, std::max<std::size_t>(2, (count + 1) / 2));
  }
  return schedule;
}

std::size_t frames_at(const Rung& rung, std::size_t num_frames) {
  const auto frames =
      static_cast<std::size_t>(std::ceil(rung.frame_share * static_cast<double>(num_frames)));
  return std::clamp<std::size_t>(frames, std::min<std::size_t>(2, num_frames), num_frames);
}

}  // namespace stemvo::search
