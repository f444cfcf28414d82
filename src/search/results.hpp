// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "search/records.hpp"
#include "search/search.hpp"

namespace stemvo::search {

/// Where results go, and where named models are found.
struct Folders {
  std::filesystem::path out_dir;
  std::filesystem::path models_dir;
};

/// Ranks the records and writes config.yaml (of all rows), the tables and the sheet (a warning
/// where that cannot be drawn). Where records are missing the search was interrupted. Of a part
/// with one sequence only the work is reported.
[[nodiscard]] Expected<SearchReport> write_results(const Folders& folders,
                                                   const SearchIdentity& identity,
                                                   const std::vector<FilterRecord>& records);

/// filters.csv: a header, then the rows by rank; `model,layer,filter` first, no times. Columns per
/// sequence where there are several, and of the held-out one.
[[nodiscard]] std::string format_csv(const SearchIdentity& identity,
                                     const std::vector<FilterRow>& rows);

/// filters.csv, filters.json (the same, and what was searched, how, and the work it took) and,
/// where a filter was ranked, best.yaml: what repeats its row by `stemvo run --config`. `common`:
/// the configuration of all rows.
[[nodiscard]] Status write_tables(const Folders& folders,
                                  const SearchIdentity& identity,
                                  const Config& common,
                                  const SearchReport& report);

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
[[nodiscard]] Status write_contact_sheet(const Folders& folders,
                                         const SearchIdentity& identity,
                                         const Config& common,
                                         const std::vector<FilterRow>& rows);

}  // namespace stemvo::search
