// SPDX-License-Identifier: MIT
#include "report/check.hpp"

#include <algorithm>
#include <set>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "config/config_yaml.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"

namespace stemvo {

namespace {

struct Bound {
  std::string key;
  bool is_max = true;
  double limit = 0.0;
  int line = 0;
};

std::string first_line(std::string_view text) {
  return std::string(text.substr(0, text.find('\n')));
}

/// `{max: 1.0}`, `{min: 0.99}` or both under each metric's name.
Expected<std::vector<Bound>> read_thresholds(const std::filesystem::path& file) {
  const Expected<YAML::Node> root = read_text_file(file).and_then(
      [&](const std::string& text) { return config::parse_document(text, file.string()); });
  if (!root) {
    return fail(first_line(root.error().message));
  }
  if (!root->IsMap() || root->size() == 0) {
    return fail(fmt::format("{}: expected lines like 't_rel_percent: {{max: 1.0}}', found none",
                            file.string()));
  }
  const auto fail_at = [&](const YAML::Node& node, const std::string& problem) {
    return fail(fmt::format("{}:{}: {}", file.string(), node.Mark().line + 1, problem));
  };
  std::vector<Bound> bounds;
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
      bounds.push_back({key, name == "max", limit->front(), key_node.Mark().line + 1});
    }
  }
  return bounds;
}

Expected<nlohmann::json> read_metrics(const std::filesystem::path& file) {
  const Expected<std::string> text = read_text_file(file);
  if (!text) {
    return text.error();
  }
  try {
    nlohmann::json json = nlohmann::json::parse(*text);
    if (!json.is_object()) {
      return fail(
          fmt::format("{}: expected a JSON object, found {}", file.string(), json.type_name()));
    }
    return json;
  } catch (const nlohmann::json::exception& error) {
    const std::string_view what = error.what();
    return fail(fmt::format("{}: not JSON: {}", file.string(),
                            first_line(what.substr(std::min(what.find("] ") + 2, what.size())))));
  }
}

/// Goes down along the dots; null when there is no such key.
const nlohmann::json* find_metric(const nlohmann::json& root, std::string_view key) {
  const nlohmann::json* node = &root;
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
std::string shown(double value, double limit) {
  const std::string rounded = fmt::format("{:.6g}", value);
  return rounded == fmt::format("{:.6g}", limit) ? fmt::format("{}", value) : rounded;
}

ThresholdResult hold_against(const Bound& bound, const nlohmann::json& metric) {
  ThresholdResult result{
      bound.key,    fmt::format("{} {}", bound.is_max ? "<=" : ">=", bound.limit),
      "null",       false,
      bound.is_max, bound.limit,
      std::nullopt};
  if (metric.is_number()) {
    const double value = metric.get<double>();
    result.value = shown(value, bound.limit);
    result.number = value;
    result.passed = bound.is_max ? value <= bound.limit : value >= bound.limit;  // NaN fails both
  }
  return result;
}

}  // namespace

Expected<std::vector<ThresholdResult>> check_metrics(const std::filesystem::path& metrics_file,
                                                     const std::filesystem::path& thresholds_file) {
  const Expected<std::vector<Bound>> bounds = read_thresholds(thresholds_file);
  if (!bounds) {
    return bounds.error();
  }
  const Expected<nlohmann::json> metrics = read_metrics(metrics_file);
  if (!metrics) {
    return metrics.error();
  }
  std::vector<ThresholdResult> results;
  for (const Bound& bound : *bounds) {
    const nlohmann::json* metric = find_metric(*metrics, bound.key);
    if (metric == nullptr) {
      return fail(fmt::format("{}:{}: expected a metric of {}, found '{}'",
                              thresholds_file.string(), bound.line, metrics_file.string(),
                              bound.key));
    }
    if (!metric->is_number() && !metric->is_null()) {
      return fail(fmt::format("{}: {}: expected a number, found {}", metrics_file.string(),
                              bound.key, metric->type_name()));
    }
    results.push_back(hold_against(bound, *metric));
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
    table.add({result.key, result.value, result.bound, result.passed ? "ok" : "FAILED"});
  }
  const auto failed = std::count_if(results.begin(), results.end(),
                                    [](const ThresholdResult& r) { return !r.passed; });
  const std::string summary =
      failed == 0 ? fmt::format("all {} bounds kept\n", results.size())
                  : fmt::format("{} of {} bounds not kept\n", failed, results.size());
  return table.str() + summary;
}

}  // namespace stemvo
