// SPDX-License-Identifier: MIT
#include "report/check.hpp"

#include <algorithm>
#include <string_view>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "report/metrics_keys.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"
#include "try.hpp"

namespace stemvo {

namespace {

using Json = nlohmann::ordered_json;

/// `{max: 1.0}`, `{min: 0.99}` or both under each metric's name.
Expected<std::vector<ThresholdResult>> read_thresholds(const std::filesystem::path& file) {
  const Expected<YAML::Node> root =
      read_text_file(file, kMaxSettings_MB).and_then([&](const std::string& text) {
        return config::parse_document(text, file.string());
      });
  if (!root) {
    return fail(root.error().message.substr(0, root.error().message.find('\n')));
  }
  if (!root->IsMap() || root->size() == 0) {
    return fail(fmt::format("{}: expected lines like 't_rel_percent: {{max: 1.0}}', found none",
                            file.string()));
  }
  const auto fail_at = [&](const YAML::Node& node, const std::string& problem) {
    return fail(fmt::format("{}:{}: {}", file.string(), node.Mark().line + 1, one_line(problem)));
  };
  std::vector<ThresholdResult> bounds;
  for (const auto& entry : *root) {
    const std::string key = entry.first.Scalar();
    if (!entry.first.IsScalar() || !entry.second.IsMap() || entry.second.size() == 0) {
      return fail_at(entry.first,
                     fmt::format("{}: expected {{max: NUMBER}} or {{min: NUMBER}}, found '{}'", key,
                                 entry.second.IsScalar() ? entry.second.Scalar() : "no bound"));
    }
    for (const auto& bound : entry.second) {
      const std::string name = bound.first.Scalar();
      if (name != "min" && name != "max") {
        return fail_at(bound.first, fmt::format("{}: expected min or max, found '{}'", key, name));
      }
      const Expected<std::vector<double>> limit = parse_numbers(bound.second.Scalar(), 1);
      if (!limit) {
        return fail_at(bound.first, fmt::format("{}.{}: {}", key, name, limit.error().message));
      }
      bounds.push_back(
          {key, name == "max", limit->front(), entry.first.Mark().line + 1, std::nullopt, false});
    }
  }
  return bounds;
}

/// Goes down along the dots; null when there is no such key.
const Json* find_metric(const Json& root, std::string_view key) {
  const Json* node = &root;
  while (!key.empty()) {
    const std::size_t dot = key.find('.');
    const std::string part(key.substr(0, dot));
    key.remove_prefix(dot == std::string_view::npos ? key.size() : dot + 1);
    // Without ground truth a whole group is null: so is everything in it.
    if (node->is_null()) {
      return node;
    }
    if (!node->is_object() || !node->contains(part)) {
      return nullptr;
    }
    node = &(*node)[part];
  }
  return node;
}

/// Six digits, or all of them where six would show a passed bound as kept.
std::string shown(const ThresholdResult& result) {
  if (!result.number) {
    return "null";
  }
  const std::string rounded = fmt::format("{:.6g}", *result.number);
  return rounded == fmt::format("{:.6g}", result.limit) ? fmt::format("{}", *result.number)
                                                        : rounded;
}

}  // namespace

Expected<std::vector<ThresholdResult>> check_metrics(const std::filesystem::path& metrics_file,
                                                     const std::filesystem::path& thresholds_file) {
  auto results = read_thresholds(thresholds_file);
  if (!results) {
    return results;
  }
  STEMVO_TRY_GET(const Json metrics, read_json_object(metrics_file));
  for (ThresholdResult& result : *results) {
    const Json* metric = find_metric(metrics, result.key);
    if (metric == nullptr) {
      return fail(fmt::format("{}:{}: expected a metric of {}, which lists them, found '{}'",
                              thresholds_file.string(), result.line, metrics_file.string(),
                              result.key));
    }
    if (metric->is_number()) {
      const double value = result.number.emplace(metric->get<double>());
      result.passed = result.is_max ? value <= result.limit : value >= result.limit;  // not NaN
    } else if (!metric->is_null()) {
      return fail(fmt::format("{}: {}: expected a number, found {}", metrics_file.string(),
                              result.key, metric->type_name()));
    }
  }
  return results;
}

bool all_passed(const std::vector<ThresholdResult>& results) {
  return std::all_of(results.begin(), results.end(),
                     [](const ThresholdResult& r) { return r.passed; });
}

std::string format_check_table(const std::vector<ThresholdResult>& results) {
  TextTable table("lrll");
  table.add({"metric", "value", "bound", "result"});
  table.rule();
  for (const ThresholdResult& result : results) {
    table.add({result.key, shown(result),
               fmt::format("{} {}", result.is_max ? "<=" : ">=", result.limit),
               result.passed ? "ok" : "FAILED"});
  }
  const auto failed = std::count_if(results.begin(), results.end(),
                                    [](const ThresholdResult& r) { return !r.passed; });
  const std::string summary =
      failed == 0 ? fmt::format("all {} bounds kept\n", results.size())
                  : fmt::format("{} of {} bounds not kept\n", failed, results.size());
  return table.str() + summary;
}

}  // namespace stemvo
