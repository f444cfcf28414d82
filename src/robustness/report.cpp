// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "report/metrics_keys.hpp"
#include "robustness/robustness.hpp"
#include "text/text_table.hpp"

namespace stemvo::robustness {
namespace {

using Json = nlohmann::ordered_json;

/// Over the drives; nullopt: one has none.
std::optional<double> mean(const std::vector<Outcome>& outcomes,
                           std::optional<double> Outcome::* member) {
  double sum = 0.0;
  for (const Outcome& one : outcomes) {
    if (!(one.*member)) {
      return std::nullopt;
    }
    sum += *(one.*member);
  }
  return sum / static_cast<double>(outcomes.size());
}

double mean_tracked(const std::vector<Outcome>& outcomes) {
  double sum = 0.0;
  for (const Outcome& one : outcomes) {
    sum += one.tracked;
  }
  return sum / static_cast<double>(outcomes.size());
}

/// "0.31", where frames were not tracked "0.31 (0.97)".
std::string cell(const std::vector<Outcome>& outcomes) {
  const double tracked = mean_tracked(outcomes);
  const std::string error = number_or_dash(mean_rotation_error(outcomes), 2);
  return tracked > 0.995 ? error : fmt::format("{} ({:.2f})", error, tracked);
}

/// "0.84 0.75-0.95", with a star where the interval leaves out 1.
std::string words(const ErrorRatio& ratio) {
  return fmt::format("{}{:.2f} {:.2f}-{:.2f}", ratio.is_decided() ? "*" : "", ratio.ratio,
                     ratio.low, ratio.high);
}

std::vector<const Row*> all_rows(const RobustnessReport& report) {
  std::vector<const Row*> rows;
  for (const Row& row : report.rows) {
    rows.push_back(&row);
  }
  return rows;
}

Json interval(const ErrorRatio& ratio) {
  return {{"ratio", ratio.ratio}, {"low", ratio.low}, {"high", ratio.high}};
}

}  // namespace

std::optional<double> mean_rotation_error(const std::vector<Outcome>& outcomes) {
  return mean(outcomes, &Outcome::r_rel_deg_per_100m);
}

std::string format_table(const RobustnessReport& report) {
  const std::size_t num = report.contenders.size();
  TextTable table("ll" + std::string(2 * num - 1, 'r'));
  std::vector<std::string> head = {"disturbance", "strength"};
  head.insert(head.end(), report.contenders.begin(), report.contenders.end());
  for (std::size_t i = 1; i < num; ++i) {
    head.push_back("over " + report.contenders[i]);
  }
  table.add(head);
  table.rule();
  for (const Row& row : report.rows) {
    std::vector<std::string> cells = {row.disturbance, fmt::format("{}", row.strength)};
    for (const auto& outcomes : row.outcomes) {
      cells.push_back(cell(outcomes));
    }
    for (const Verdict& verdict : verdicts(report, {&row})) {
      cells.push_back(words(verdict.rotation));
    }
    table.add(std::move(cells));
  }
  if (!report.rows.empty()) {
    table.rule();
    // No interval: the rows are the same frames, disturbed.
    std::vector<std::string> cells(2 + num);
    cells.front() = "all";
    for (const Verdict& verdict : verdicts(report, all_rows(report))) {
      cells.push_back(fmt::format("{:.2f}", verdict.rotation.ratio));
    }
    table.add(std::move(cells));
  }
  return table.str();
}

std::string format_csv(const RobustnessReport& report) {
  std::string text =
      "disturbance,strength,channel,drive,t_rel_percent,r_rel_deg_per_100m,tracked,recovery_frames,"
      "jumps\n";
  const auto number = [](const auto& value) { return value ? fmt::format("{}", *value) : ""; };
  for (const Row& row : report.rows) {
    for (std::size_t i = 0; i < report.contenders.size(); ++i) {
      for (std::size_t drive = 0; drive < report.drives.size(); ++drive) {
        const Outcome& one = row.outcomes[i][drive];
        text += fmt::format("{},{},{},{},{},{},{},{},{}\n", row.disturbance, row.strength,
                            report.contenders[i], report.drives[drive], number(one.t_rel_percent),
                            number(one.r_rel_deg_per_100m), one.tracked,
                            number(one.recovery_frames), one.jumps);
      }
    }
  }
  return text;
}

std::string format_json(const RobustnessReport& report) {
  Json rows = Json::array();
  for (const Row& row : report.rows) {
    Json channels = Json::array();
    const std::vector<Verdict> found = verdicts(report, {&row});
    for (std::size_t i = 0; i < report.contenders.size(); ++i) {
      const auto& outcomes = row.outcomes[i];
      const auto number = [](const std::optional<double>& value) {
        return value ? Json(*value) : Json();
      };
      channels.push_back({{"channel", report.contenders[i]},
                          {"t_rel_percent", number(mean(outcomes, &Outcome::t_rel_percent))},
                          {"r_rel_deg_per_100m", number(mean_rotation_error(outcomes))},
                          {"tracked", mean_tracked(outcomes)}});
      if (i > 0) {
        channels.back()["rotation_ratio"] = interval(found[i - 1].rotation);
        channels.back()["translation_ratio"] = interval(found[i - 1].translation);
      }
    }
    rows.push_back(
        {{"disturbance", row.disturbance}, {"strength", row.strength}, {"channels", channels}});
  }
  return to_text({{"drives", report.drives}, {"interrupted", report.interrupted}, {"rows", rows}});
}

}  // namespace stemvo::robustness
