// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "stemvo/evaluation/metrics.hpp"

namespace stemvo {

/// Adds the keys of metrics.json that need ground truth; all null when `metrics` is null.
void add_metrics(nlohmann::ordered_json& json, const Metrics* metrics);

/// Indented, ends with a newline. A number that is not finite becomes null, bytes that are not
/// UTF-8 the replacement character.
[[nodiscard]] std::string to_text(const nlohmann::ordered_json& json);

/// "100..800 m": first and last of the lengths.
[[nodiscard]] std::string length_range(const Metrics& metrics);

}  // namespace stemvo
