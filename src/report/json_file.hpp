// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "stemvo/error.hpp"

namespace stemvo {

/// Errors: the file cannot be read, is no JSON or holds no object.
[[nodiscard]] Expected<nlohmann::ordered_json> read_json_object(const std::filesystem::path& file,
                                                                bool has_comments = false);

}  // namespace stemvo
