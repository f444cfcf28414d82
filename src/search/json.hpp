// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include <nlohmann/json.hpp>

namespace stemvo::search {

using Json = nlohmann::ordered_json;

/// Null where there is none.
inline Json optional_json(const std::optional<double>& value) {
  return value ? Json(*value) : Json();
}

}  // namespace stemvo::search
