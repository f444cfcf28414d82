// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include "search/identity.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo::search {

/// filters.csv: a header, then the rows by rank; `model,layer,filter` first, no times. Columns per
/// sequence where there are several, and of the held-out one.
[[nodiscard]] std::string format_csv(const SearchIdentity& identity, const SearchReport& report);
/// filters.json: the same, and what was searched, how, and the work it took.
[[nodiscard]] std::string format_json(const SearchIdentity& identity, const SearchReport& report);

/// config.yaml (of all rows), filters.csv, filters.json and, where a filter was ranked, best.yaml:
/// what repeats its row by `stemvo run --config`.
[[nodiscard]] Status write_tables(const std::filesystem::path& out_dir,
                                  const SearchIdentity& identity,
                                  const SearchReport& report);

/// The configuration of one row's odometry.
[[nodiscard]] Expected<Config> config_of(const std::filesystem::path& out_dir,
                                         const SearchIdentity& identity,
                                         const FilterKey& key);

}  // namespace stemvo::search
