// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "stemvo/error.hpp"

/// JSON that somebody else may have written. Objects keep the order of their keys, which are
/// looked for one by one: there may be at most a thousand in one, and 64 levels.
namespace stemvo {

/// Errors: it cannot be read, is no JSON, has more keys or levels than that or a key twice, or
/// holds no object.
[[nodiscard]] Expected<nlohmann::ordered_json> read_json_object(const std::filesystem::path& file,
                                                                bool has_comments = false);

}  // namespace stemvo
