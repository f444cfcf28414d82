// SPDX-License-Identifier: MIT
#include "stemvo/report/check.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string_view>

#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <yaml-cpp/yaml.h>

#include "report/text_table.hpp"
#include "text/text_file.hpp"

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

std::string at(const std::filesystem::path& file, const YAML::Node& node) {
  return fmt::format("{}:{}", file.string(), node.Mark().line + 1);
}

/// `{max: 1.0}`, `{min: 0.99}` or both.
Expected<std::vector<Bound>> parse_bounds(const std::filesystem::path& file,
                                          const YAML::Node& key_node,
                                          const YAML::Node& bounds_node) {
  const std::string key = key_node.Scalar();
  if (!bounds_node.IsMap() || bounds_node.size() == 0) {
    return fail(fmt::format("{}: {}: expected {{max: NUMBER}} or {{min: NUMBER}}, found '{}'",
                            at(file, key_node), key,
                            bounds_node.IsScalar() ? bounds_node.Scalar() : "no bound"));
  }
  std::vector<Bound> bounds;
  std::set<std::string> seen;
  for (const auto& entry : bounds_node) {
    const std::string name = entry.first.IsScalar() ? entry.first.Scalar() : "";
    if (name != "min" && name != "max") {
      return fail(
          fmt::format("{}: {}: expected min or max, found '{}'", at(file, entry.first), key, name));
    }
    if (!seen.insert(name).second) {
      return fail(fmt::format("{}: {}: expected {} once, found it twice", at(file, entry.first),
                              key, name));
    }
    const Expected<std::vector<double>> limit =
        parse_numbers(entry.second.IsScalar() ? entry.second.Scalar() : "", 1);
    if (!limit) {
      return fail(
          fmt::format("{}: {}.{}: {}", at(file, entry.first), key, name, limit.error().message));
    }
    bounds.push_back({key, name == "max", limit->front(), key_node.Mark().line + 1});
  }
  return bounds;
}

Expected<std::vector<Bound>> read_thresholds(const std::filesystem::path& file) {
  const Expected<std::string> text = read_text_file(file);
  if (!text) {
    return text.error();
  }
  YAML::Node root;
  try {
    root = YAML::Load(*text);
  } catch (const YAML::Exception& error) {
    return fail(fmt::format("{}:{}: not YAML: {}", file.string(), error.mark.line + 1,
                            first_line(error.msg)));
  }
  if (!root.IsMap() || root.size() == 0) {
    return fail(fmt::format("{}: expected lines like 't_rel_percent: {{max: 1.0}}', found none",
                            file.string()));
  }
  std::vector<Bound> all;
  std::set<std::string> seen;
  for (const auto& entry : root) {
    if (!entry.first.IsScalar()) {
      return fail(fmt::format("{}: expected the name of a metric, found another kind of key",
                              at(file, entry.first)));
    }
    if (!seen.insert(entry.first.Scalar()).second) {
      return fail(fmt::format("{}: expected {} once, found it twice", at(file, entry.first),
                              entry.first.Scalar()));
    }
    const Expected<std::vector<Bound>> bounds = parse_bounds(file, entry.first, entry.second);
    if (!bounds) {
      return bounds;
    }
    all.insert(all.end(), bounds->begin(), bounds->end());
  }
  return all;
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
  ThresholdResult result{bound.key, fmt::format("{} {}", bound.is_max ? "<=" : ">=", bound.limit),
                         "null", false};
  if (metric.is_number()) {
    const double value = metric.get<double>();
    result.value = shown(value, bound.limit);
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
  std::size_t failed = 0;
  for (const ThresholdResult& result : results) {
    table.add({result.key, result.value, result.bound, result.passed ? "ok" : "FAILED"});
    failed += result.passed ? 0 : 1;
  }
  const std::string summary =
      failed == 0 ? fmt::format("all {} bounds kept\n", results.size())
                  : fmt::format("{} of {} bounds not kept\n", failed, results.size());
  return table.str() + summary;
}

}  // namespace stemvo
