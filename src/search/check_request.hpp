// SPDX-License-Identifier: MIT
#pragma once

#include "search/plan.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo::search {

/// What can be said before anything is opened: the configuration, layers asked for twice.
[[nodiscard]] Status check_request(const SearchRequest& request);

/// Of sequences that were opened: each ranks once, under a name of its own, and the held-out one
/// has no frame that ranks.
[[nodiscard]] Status check_sequences(const SearchIdentity& identity);

}  // namespace stemvo::search
