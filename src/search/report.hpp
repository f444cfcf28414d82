// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "search/contact_sheet.hpp"
#include "search/identity.hpp"
#include "search/record_file.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo::search {

inline constexpr const char* kRecordsFile = "records.jsonl";

/// Ranks the records and writes the tables and the sheet (a warning where that cannot be drawn).
/// Where records are missing the search was interrupted. Of a part with one sequence only the work
/// is reported.
[[nodiscard]] Expected<SearchReport> finish(const Folders& folders,
                                            const SearchIdentity& identity,
                                            const std::vector<Record>& records,
                                            std::vector<std::string> warnings);

}  // namespace stemvo::search
