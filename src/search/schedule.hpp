// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <vector>

namespace stemvo::search {

/// One rung of successive halving: so many filters run up to this share of the frames.
struct Rung {
  double frame_share = 1.0;
  std::size_t num_filters = 0;
};
inline bool operator==(const Rung& a, const Rung& b) {
  return a.frame_share == b.frame_share && a.num_filters == b.num_filters;
}

/// The last rung has all frames.
using Schedule = std::vector<Rung>;

/// Every filter over every frame.
[[nodiscard]] inline Schedule exhaustive_schedule(std::size_t num_filters) {
  return {{1.0, num_filters}};
}

/// Successive halving (Jamieson and Talwalkar, AISTATS 2016): see schedule.cpp.
[[nodiscard]] Schedule halving_schedule(std::size_t num_filters);

/// Frames of a sequence that a rung runs up to: at least 2, at most all.
[[nodiscard]] std::size_t frames_at(const Rung& rung, std::size_t num_frames);

}  // namespace stemvo::search
