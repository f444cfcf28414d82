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

/// Successive halving (Jamieson and Talwalkar, "Non-stochastic best arm identification and
/// hyperparameter optimization", AISTATS 2016): rungs at 1/16, 1/8, 1/4, 1/2 and all of the frames.
/// The number of filters falls as a power of the share, as slowly as a budget of 25 % of the
/// exhaustive search's filter-frames allows, to 2. Of fewer than 16 filters half go on to 1/4, then
/// a sixth and a twelfth: about the same budget.
[[nodiscard]] Schedule halving_schedule(std::size_t num_filters);
/// Filter-frames over those of the exhaustive search, where odometries go on from rung to rung.
[[nodiscard]] double cost_share(const Schedule& schedule);

/// Frames of a sequence that a rung runs up to: at least 2, at most all.
[[nodiscard]] std::size_t frames_at(const Rung& rung, std::size_t num_frames);

}  // namespace stemvo::search
