// SPDX-License-Identifier: MIT
#include "report/check.hpp"

#include <algorithm>
#include <limits>
#include <set>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "config/config_yaml.hpp"
#include "report/json_file.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"

namespace stemvo {

namespace {

using Json = nlohmann::ordered_json;

std::string first_line(std::string_view text) {
  return std::string(text.substr(0, text.find('\n')));
}

/// `{max: 1.0}`, `{min: 0.99}` or both under each metric's name.
Expected<std::vector<ThresholdResult>> read_thresholds(const std::filesystem::path& file) {
  const Expected<YAML::Node> root =
      read_text_file(file, kMaxSettings_MB).and_then([&](const std::string& text) {
        return config::parse_document(text, file.string());
      });
  if (!root) {
    return fail(first_line(root.error().message));
  }
  if (!root->IsMap() || root->size() == 0) {
    return fail(fmt::format("{}: expected lines like 't_rel_percent: {{max: 1.0}}', found none",
                            file.string()));
  }
  const auto fail_at = [&](const YAML::Node& node, const std::string& problem) {
    return fail(fmt::format("{}:{}: {}", file.string(), node.Mark().line + 1, one_line(problem)));
  };
  std::vector<ThresholdResult> bounds;
  std::set<std::pair<std::string, std::string>> seen;
  for (const auto& entry : *root) {
    const YAML::Node& key_node = entry.first;
    const YAML::Node& bounds_node = entry.second;
    const std::string key = key_node.Scalar();
    if (!key_node.IsScalar()) {
      return fail_at(key_node, "expected the name of a metric, found another kind of key");
    }
    if (!seen.emplace(key, "").second) {
      return fail_at(key_node, fmt::format("expected {} once, found it twice", key));
    }
    if (!bounds_node.IsMap() || bounds_node.size() == 0) {
      return fail_at(key_node,
                     fmt::format("{}: expected {{max: NUMBER}} or {{min: NUMBER}}, found '{}'", key,
                                 bounds_node.IsScalar() ? bounds_node.Scalar() : "no bound"));
    }
    double min = std::numeric_limits<double>::lowest();
    double max = std::numeric_limits<double>::max();
    for (const auto& bound : bounds_node) {
      const YAML::Node& name_node = bound.first;
      const std::string name = name_node.Scalar();
      if (name != "min" && name != "max") {
        return fail_at(name_node, fmt::format("{}: expected min or max, found '{}'", key, name));
      }
      if (!seen.emplace(key, name).second) {
        return fail_at(name_node, fmt::format("{}: expected {} once, found it twice", key, name));
      }
      const Expected<std::vector<double>> limit = parse_numbers(bound.second.Scalar(), 1);
      if (!limit) {
        return fail_at(name_node, fmt::format("{}.{}: {}", key, name, limit.error().message));
      }
      (name == "max" ? max : min) = limit->front();
      if (min > max) {
        return fail_at(name_node,
                       fmt::format("{}: expected min up to max, found {} and {}", key, min, max));
      }
      bounds.push_back(
          {key, name == "max", limit->front(), key_node.Mark().line + 1, std::nullopt, false});
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
  const Expected<Json> metrics = read_json_object(metrics_file);
  if (!metrics) {
    return metrics.error();
  }
  for (ThresholdResult& result : *results) {
    const Json* metric = find_metric(*metrics, result.key);
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
