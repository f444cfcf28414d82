// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "search/records.hpp"
#include "search/search.hpp"

namespace stemvo::search {

/// What became of a filter.
enum class FilterStatus {
  kRanked,       ///< ran over all frames, has a t_rel
  kStopped,      ///< halving: others were better on the frames it ran
  kNotDetected,  ///< the paper's "pose not detected"
};

/// A filter's record of the last rung it ran.
struct FilterRow : FilterRecord {
  FilterStatus status = FilterStatus::kRanked;
  DriveScore mean;  ///< of the drives
};

/// Over the sequences that rank; nullopt where one of them has none, `frames` is the sum, the
/// reason that of the first sequence whose pose was not detected.
[[nodiscard]] DriveScore mean_score(const std::vector<DriveScore>& drives);

/// One row per filter from its last rung, ranked: by t_rel, ties by r_rel; then those that were
/// stopped, the later the better; not detected last.
[[nodiscard]] std::vector<FilterRow> rank_filters(const FilterRecords& records,
                                                  std::size_t num_rungs);

/// filters.csv: a header, then the rows by rank; `model,layer,filter` first, no times. Columns per
/// sequence where there are several, and of the held-out one.
[[nodiscard]] std::string format_csv(const SearchIdentity& identity,
                                     const std::vector<FilterRow>& rows);

/// Ranks the records and writes the files of run_search, of which filters.json says what was
/// searched, how, and the work it took. A sheet that cannot be drawn is a warning. Where records
/// are missing the search was interrupted. Of a part with one sequence nothing is written.
[[nodiscard]] Expected<SearchReport> write_results(const std::filesystem::path& out_dir,
                                                   const std::filesystem::path& models_dir,
                                                   const SearchIdentity& identity,
                                                   const FilterRecords& records);

/// Best, median and worst of the filters (no baselines) whose pose was detected, those that halving
/// stopped behind the others, the later the better; the same filter once.
using ShownFilters = std::vector<std::pair<const char*, const FilterRow*>>;
[[nodiscard]] ShownFilters choose_rows(const SearchIdentity& identity,
                                       const std::vector<FilterRow>& rows);

}  // namespace stemvo::search
