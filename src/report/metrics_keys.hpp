// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "evaluation/metrics.hpp"
#include "stemvo/error.hpp"

/// An optional without a value is null in JSON.
template <typename T>
struct nlohmann::adl_serializer<std::optional<T>> {
  template <typename Json>
  static void to_json(Json& json, const std::optional<T>& value) {
    json = value ? Json(*value) : Json();
  }
  template <typename Json>
  static void from_json(const Json& json, std::optional<T>& value) {
    value.reset();
    if (!json.is_null()) {
      json.get_to(value.emplace());
    }
  }
};

namespace stemvo {

struct MetricsReport;
/// The document that metrics.json holds.
[[nodiscard]] nlohmann::ordered_json metrics_document(const MetricsReport& report);

/// Adds the keys of metrics.json that need ground truth; all null without metrics.
void add_metrics(nlohmann::ordered_json& json, const std::optional<Metrics>& metrics);

/// Indented, ends with a newline. A number that is not finite becomes null, bytes that are not
/// UTF-8 the replacement character.
[[nodiscard]] std::string to_text(const nlohmann::ordered_json& json);

/// Errors: the file cannot be read, is no JSON or holds no object.
[[nodiscard]] Expected<nlohmann::ordered_json> read_json_object(const std::filesystem::path& file,
                                                                bool has_comments = false);

}  // namespace stemvo
