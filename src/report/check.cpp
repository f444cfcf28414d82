// SPDX-License-Identifier: MIT
#include "report/check.hpp"

#include <algorithm>
#include <array>
#include <sstream>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "config/config_yaml.hpp"
#include "report/metrics_json.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

using Json = nlohmann::ordered_json;

/// Adds the bounds of one key: `{max: 1.0}`, `{min: 0.99}` or both.
void add_bounds(const std::filesystem::path& file,
                const YAML::Node& name,
                const YAML::Node& node,
                std::vector<ThresholdResult>& bounds) {
  const auto where = [&](const YAML::Node& at) {
    return fmt::format("{}:{}: ", file.string(), at.Mark().line + 1);
  };
  const std::string& key = name.Scalar();
  if (!name.IsScalar() || !node.IsMap() || node.size() == 0) {
    const std::string found = node.IsScalar() ? node.Scalar() : "no bound";
    bounds.push_back(
        {.key = key,
         .problem = where(name) + one_line(fmt::format(
                                      "{}: expected {{max: NUMBER}} or {{min: NUMBER}}, found '{}'",
                                      key, found))});
    return;
  }
  for (const auto& bound : node) {
    const std::string side = bound.first.Scalar();
    const auto limit = parse_numbers(bound.second.Scalar(), 1);
    const std::string problem = side != "min" && side != "max"
                                    ? fmt::format("{}: expected min or max, found '{}'", key, side)
                                : limit
                                    ? ""
                                    : fmt::format("{}.{}: {}", key, side, limit.error().message);
    bounds.push_back({.key = key,
                      .is_max = side == "max",
                      .limit = limit ? limit->front() : 0.0,
                      .place = where(name),
                      .problem = problem.empty() ? "" : where(bound.first) + one_line(problem)});
  }
}

Expected<std::vector<ThresholdResult>> read_thresholds(const std::filesystem::path& file) {
  STEMVO_TRY_GET(const YAML::Node root, config::read_document(file));
  if (!root.IsMap() || root.size() == 0) {
    return fail(fmt::format("{}: expected lines like 't_rel_percent: {{max: 1.0}}', found none",
                            file.string()));
  }
  std::vector<ThresholdResult> bounds;
  for (const auto& entry : root) {
    add_bounds(file, entry.first, entry.second, bounds);
  }
  return bounds;
}

/// Goes down along the dots; null when there is no such key.
const Json* find_metric(const Json& root, const std::string& key) {
  const Json* node = &root;
  std::istringstream parts(key);
  // Without ground truth a whole group is null: so is everything in it.
  for (std::string part; !node->is_null() && std::getline(parts, part, '.');) {
    if (!node->is_object() || !node->contains(part)) {
      return nullptr;
    }
    node = &(*node)[part];
  }
  return node;
}

/// The result's folder stands for its metrics.json.
std::filesystem::path metrics_file(const std::filesystem::path& given) {
  return is_folder(given) ? given / "metrics.json" : given;
}

Expected<std::vector<ThresholdResult>> read_baseline(const std::filesystem::path& file,
                                                     double tolerance,
                                                     const Json& metrics) {
  constexpr std::array kErrors = {"t_rel_percent",   "r_rel_deg_per_100m", "average_offset_m",
                                  "ate_rmse_m.none", "ate_rmse_m.scale",   "ate_rmse_m.se3",
                                  "ate_rmse_m.sim3", "rpe_translation_m",  "rpe_rotation_deg"};
  STEMVO_TRY_GET(const Json baseline, read_json_object(file));
  std::vector<ThresholdResult> bounds;
  const std::string place = file.string() + ": ";
  const auto add = [&](const std::string& key, bool is_max) {
    const Json* number = find_metric(baseline, key);
    if (number != nullptr && number->is_number()) {
      const double share = is_max ? 1.0 + tolerance : 1.0 - tolerance;
      bounds.push_back({key, is_max, share * number->get<double>(), place});
    }
  };
  for (const char* group : {"", "map."}) {
    for (const char* error : kErrors) {
      add(std::string(group) + error, true);
    }
  }
  add("tracked_fraction", false);
  if (bounds.empty()) {
    return fail(place + "expected numbers of a run, as metrics.json has them, found none");
  }
  for (const char* same : {"sequence", "first_frame", "frames", "alignment",
                           "scale_source"}) {  // else the numbers are not comparable
    if (baseline.contains(same) && metrics.contains(same) && baseline[same] != metrics[same]) {
      bounds.push_back({.key = same,
                        .place = place,
                        .problem = fmt::format("{}{}: expected {}{} as in the run, found {}", place,
                                               same, metrics[same].dump(),
                                               metrics[same].is_null() ? " (no ground truth)" : "",
                                               baseline[same].dump())});
    }
  }
  return bounds;
}

void judge(ThresholdResult& result, const Json& metrics, const std::filesystem::path& file) {
  const Json* metric = find_metric(metrics, result.key);
  if (metric == nullptr) {
    result.problem = fmt::format("{}expected a metric of {}, which lists them, found '{}'",
                                 result.place, file.string(), result.key);
  } else if (metric->is_number()) {
    const double value = result.number.emplace(metric->get<double>());
    result.passed = result.is_max ? value <= result.limit : value >= result.limit;  // not NaN
  } else if (!metric->is_null()) {
    result.problem = fmt::format("{}: {}: expected a number, found {}", file.string(), result.key,
                                 metric->type_name());
  }
}

std::string bound_of(const ThresholdResult& result) {
  return fmt::format("{} {:.9g}", result.is_max ? "<=" : ">=", result.limit);
}

/// For an attribute of XML; one line.
std::string xml(const std::string& text) {
  std::string escaped;
  for (const char letter : one_line(text)) {
    constexpr std::string_view kLetters = "&<>\"";
    constexpr std::array kNames = {"&amp;", "&lt;", "&gt;", "&quot;"};
    const std::size_t at = kLetters.find(letter);
    escaped += at == std::string_view::npos ? std::string(1, letter) : kNames.at(at);
  }
  return escaped;
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

Expected<std::vector<ThresholdResult>> check_metrics(const CheckRequest& request) {
  std::vector<ThresholdResult> results;
  if (request.thresholds) {
    STEMVO_TRY_GET(results, read_thresholds(*request.thresholds));
  }
  STEMVO_TRY_GET(const Json metrics, read_json_object(metrics_file(request.metrics)));
  if (request.baseline) {
    STEMVO_TRY_GET(const auto bounds,
                   read_baseline(metrics_file(*request.baseline), request.tolerance, metrics));
    results.insert(results.end(), bounds.begin(), bounds.end());
  }
  for (ThresholdResult& result : results) {
    if (result.problem.empty()) {
      judge(result, metrics, request.metrics);
    }
  }
  return results;
}

bool all_passed(const std::vector<ThresholdResult>& results) {
  return std::ranges::all_of(results, &ThresholdResult::passed);
}

std::string format_check_table(const std::vector<ThresholdResult>& results) {
  TextTable table("lrll");
  table.add({"metric", "value", "bound", "result"});
  table.rule();
  std::string problems;
  for (const ThresholdResult& result : results) {
    const bool has_problem = !result.problem.empty();
    problems += has_problem ? result.problem + "\n" : "";
    table.add({result.key, has_problem ? "-" : shown(result), has_problem ? "-" : bound_of(result),
               result.passed ? "ok" : "FAILED"});
  }
  const auto failed = std::ranges::count(results, false, &ThresholdResult::passed);
  const std::string summary =
      failed == 0 ? fmt::format("all {} bounds kept\n", results.size())
                  : fmt::format("{} of {} bounds not kept\n", failed, results.size());
  return table.str() + summary + problems;
}

std::string format_junit(const std::vector<ThresholdResult>& results, const std::string& name) {
  std::string cases;
  std::size_t errors = 0;
  std::size_t failures = 0;
  for (const ThresholdResult& result : results) {
    const bool has_problem = !result.problem.empty();
    const std::string bound = has_problem ? "" : fmt::format(" {}", bound_of(result));
    cases +=
        fmt::format("  <testcase classname=\"{}\" name=\"{}\"", xml(name), xml(result.key + bound));
    (has_problem ? errors : failures) += result.passed ? 0 : 1;
    cases += result.passed ? "/>\n"
                           : fmt::format("><{} message=\"{}\"/></testcase>\n",
                                         has_problem ? "error" : "failure",
                                         xml(has_problem ? result.problem : shown(result)));
  }
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\">\n{}</testsuite>\n",
      xml(name), results.size(), failures, errors, cases);
}

}  // namespace stemvo
