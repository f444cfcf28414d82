// SPDX-License-Identifier: MIT
#pragma once

#include "search/records.hpp"

namespace stemvo::search {

/// records.jsonl is input: anybody may have written to it. Error, without file and line: what no
/// search writes (no layers, no sequences, rungs or ranges that are none).
[[nodiscard]] Status check_identity(const SearchIdentity& identity);

/// The same for a record of that search: a filter, a rung or sequences that are not its own,
/// numbers that no drive has.
[[nodiscard]] Status check_record(const FilterRecord& record, const SearchIdentity& identity);

}  // namespace stemvo::search
