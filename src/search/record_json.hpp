// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include "search/record_file.hpp"

namespace stemvo::search {

/// One line each, numbers exact, so that a resumed search gives the same bytes.
[[nodiscard]] std::string identity_line(const SearchIdentity& identity);
[[nodiscard]] std::string record_line(const Record& record);

/// Errors without the file: not JSON, a key missing or of another type, another format.
[[nodiscard]] Status parse_identity(const std::string& line, SearchIdentity& identity);
[[nodiscard]] Status parse_record(const std::string& line, Record& record);

}  // namespace stemvo::search
