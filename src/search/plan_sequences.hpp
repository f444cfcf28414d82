// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "search/race.hpp"
#include "search/search.hpp"

namespace stemvo::search {

/// Each directory as it is and under each disturbance asked for, and the held-out one.
[[nodiscard]] std::size_t num_sequences(const SearchRequest& request);

/// A path that holds in any folder.
[[nodiscard]] std::string from_anywhere(const std::filesystem::path& path);

/// The sequences of a plan that has its layers, and how many filters fit into memory beside each
/// other. Errors: one that cannot be read, without ground truth, too short to rank by, or named
/// twice; held-out frames that rank.
[[nodiscard]] Status add_sequences(const SearchRequest& request, SearchPlan& plan);

}  // namespace stemvo::search
