// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
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

/// What is written to a folder, and where named models are found.
struct Results {
  std::filesystem::path out_dir;
  std::filesystem::path models_dir;
  SearchIdentity identity;
  Config config = {};  ///< of all rows
  std::vector<FilterRow> rows = {};
};

/// Ranks the records and writes config.yaml (of all rows), filters.csv, filters.json (the same, and
/// what was searched, how, and the work it took), where a filter was ranked best.yaml (what repeats
/// its row by `stemvo run --config`), and the sheet (a warning where that cannot be drawn). Where
/// records are missing the search was interrupted. Of a part with one sequence only the work is
/// reported.
[[nodiscard]] Expected<SearchReport> write_results(Results results, const FilterRecords& records);

/// A filter of the sheet and what it is there.
struct ShownFilter {
  const char* rank;
  const FilterRow* row;
};
/// Best, median and worst of the filters (no baselines) whose pose was detected, those that halving
/// stopped behind the others, the later the better; the same filter once.
[[nodiscard]] std::vector<ShownFilter> choose_rows(const SearchIdentity& identity,
                                                   const std::vector<FilterRow>& rows);

/// sheet.png: the input and the channels of the filters of choose_rows on the middle frame of the
/// first sequence, above their trajectories (trajectories.png), and where they were stopped.
/// Nothing where there is none. Error: the sequence or the model is not where it was.
[[nodiscard]] Status write_contact_sheet(const Results& results);

}  // namespace stemvo::search
