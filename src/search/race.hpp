// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "search/plan.hpp"
#include "search/records.hpp"

namespace stemvo::search {

/// Candidates whose odometries are kept from rung to rung, some 2 MB each: the best; should others
/// go on, they start again, which counts.
inline constexpr std::size_t kMaxKept = 512;

/// Cuts candidates, in the order they are in, into blocks that run in lock-step: those of one pass
/// of the stem, as far as their layer's max_in_flight allows. With `block` > 0 each block has so
/// many instead.
[[nodiscard]] std::vector<std::vector<std::size_t>> cut_into_blocks(
    const SearchPlan& plan, const std::vector<std::size_t>& candidates, std::size_t block);

/// Runs the rungs of a plan; as a block ends its records are added to `records` and appended to the
/// file. What `records` holds is not run again. Within a block a frame is read once, each layer
/// makes one pass over it, then the filters work side by side, while the next frame is prepared:
/// what a filter does depends neither on the number of threads nor on who runs beside it. Returns
/// warnings: frames that cannot be read, or that a stem refuses. Error: the records cannot be
/// written.
[[nodiscard]] Expected<std::vector<std::string>> run_race(const SearchPlan& plan,
                                                          const SearchProgress& progress,
                                                          RecordWriter& writer,
                                                          std::vector<FilterRecord>& records,
                                                          std::size_t max_kept = kMaxKept);

}  // namespace stemvo::search
