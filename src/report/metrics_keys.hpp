// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "evaluation/metrics.hpp"

namespace stemvo {

/// As get_to, but a number that is no whole number, or out of the type's range, is an exception of
/// the library too, where get_to casts it as it is.
template <typename Json, typename T>
void read_value(const Json& json, T& value) {
  if constexpr (std::integral<T> && !std::same_as<T, bool>) {
    const bool fits =
        json.is_number_unsigned()
            ? std::in_range<T>(json.template get<std::uint64_t>())
            : json.is_number_integer() && std::in_range<T>(json.template get<std::int64_t>());
    if (!fits) {
      const std::string found = json.is_number() ? json.dump() : json.type_name();
      throw nlohmann::json::other_error::create(
          501, "expected a whole number in range, found " + found, &json);
    }
  }
  json.get_to(value);
}

}  // namespace stemvo

/// What may be missing is null in JSON.
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
      stemvo::read_value(json, value.emplace());
    }
  }
};

namespace stemvo {

struct MetricsReport;
/// What metrics.json holds.
[[nodiscard]] nlohmann::ordered_json metrics_document(const MetricsReport& report);

/// Adds the keys of metrics.json that need ground truth; all null without metrics.
void add_metrics(nlohmann::ordered_json& json, const std::optional<Metrics>& metrics);

/// Indented, ends with a newline. A number that is not finite becomes null, bytes that are not
/// UTF-8 the replacement character.
[[nodiscard]] std::string to_text(const nlohmann::ordered_json& json);

}  // namespace stemvo
