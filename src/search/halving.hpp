// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "search/records.hpp"

namespace stemvo::search {

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

/// FilterRow::mean of these drives.
[[nodiscard]] DriveScore mean_score(const std::vector<DriveScore>& drives);

/// One row per filter from its last rung, ranked: by t_rel, ties by r_rel; then those that were
/// stopped, the later the better; not detected last. Does not depend on the records' order.
[[nodiscard]] std::vector<FilterRow> rank_filters(std::span<const FilterRecord> records,
                                                  std::size_t num_rungs);

/// Of records of one rung, those that go on: indices of the `count` best by their early errors,
/// near ties by inliers. Of filters with the same numbers (R, G and B of a gray sequence) one goes
/// on, the others where there is room.
[[nodiscard]] std::vector<std::size_t> choose_survivors(
    std::span<const FilterRecord* const> records, std::size_t count);

}  // namespace stemvo::search
