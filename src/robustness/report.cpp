// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <numeric>

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

bool is_refused(const std::vector<Outcome>& outcomes) {
  return std::ranges::any_of(outcomes, &Outcome::is_refused);
}

/// nullopt: one was refused.
std::optional<double> mean_tracked(const std::vector<Outcome>& outcomes) {
  const double sum = std::transform_reduce(outcomes.begin(), outcomes.end(), 0.0, std::plus(),
                                           [](const Outcome& one) { return one.tracked; });
  return is_refused(outcomes) ? std::nullopt
                              : std::optional(sum / static_cast<double>(outcomes.size()));
}

std::optional<std::size_t> longest_recovery(const std::vector<Outcome>& outcomes) {
  std::optional<std::size_t> longest;
  for (const Outcome& one : outcomes) {
    if (one.recovery_frames) {
      longest = std::max(longest.value_or(0), *one.recovery_frames);
    }
  }
  return longest;
}

/// "0.31", where frames were not tracked "0.31 (0.97)".
std::string cell(const std::vector<Outcome>& outcomes) {
  const std::optional<double> tracked = mean_tracked(outcomes);
  const std::string error = number_or_dash(mean_rotation_error(outcomes), 2);
  return !tracked           ? "refused"
         : *tracked > 0.995 ? error
                            : fmt::format("{} ({:.2f})", error, *tracked);
}

/// "0.84 0.75-0.95", with a star where the interval leaves out 1; "-" where there is none.
std::string words(const ErrorRatio& ratio) {
  if (!std::isfinite(ratio.high)) {
    return "-";
  }
  return fmt::format("{}{:.2f} {:.2f}-{:.2f}", ratio.is_decided() ? "*" : "", ratio.ratio,
                     ratio.low, ratio.high);
}

Json interval(const ErrorRatio& ratio) {
  return {{"ratio", ratio.ratio},
          {"low", ratio.low},
          {"high", ratio.high},
          {"decided", ratio.is_decided()}};
}

std::vector<std::string> groups_of(const std::vector<Row>& rows) {
  std::vector<std::string> groups;
  for (const Row& row : rows) {
    if (std::ranges::find(groups, row.group) == groups.end()) {
      groups.push_back(row.group);
    }
  }
  return groups;
}

/// nullopt: of nothing.
std::optional<double> geometric_mean(const std::vector<double>& ratios) {
  double sum = 0.0;
  for (const double ratio : ratios) {
    sum += std::log(ratio);
  }
  return ratios.empty() ? std::nullopt
                        : std::optional(std::exp(sum / static_cast<double>(ratios.size())));
}

Summary summarize(const std::string& group,
                  const std::vector<const Row*>& rows,
                  std::size_t control) {
  Summary result{group, rows.size(), {}, {}, 0, 0};
  std::vector<double> rotation;
  std::vector<double> translation;
  const auto add = [](const ErrorRatio& one, std::vector<double>& ratios) {
    if (std::isfinite(one.high)) {
      ratios.push_back(one.ratio);
    }
  };
  for (const Row* row : rows) {
    const Verdict& verdict = row->verdicts.at(control);
    add(verdict.rotation, rotation);
    add(verdict.translation, translation);
    if (verdict.rotation.is_decided()) {
      ++(verdict.rotation.ratio < 1.0 ? result.num_for_judged : result.num_for_control);
    }
  }
  result.rotation_ratio = geometric_mean(rotation);
  result.translation_ratio = geometric_mean(translation);
  return result;
}

/// Groups of the rows, then all: r_rel's ratio, and how many rows are decided for whom.
std::string format_summaries(const RobustnessReport& report) {
  const std::size_t num_controls = report.contenders.size() - 1;
  TextTable table("lr" + std::string(num_controls, 'r'));
  std::vector<std::string> head = {"group", "rows"};
  std::vector<std::vector<Summary>> columns;
  for (std::size_t i = 0; i < num_controls; ++i) {
    head.push_back("over " + report.contenders[i + 1]);
    columns.push_back(summaries(report.rows, i));
  }
  table.add(head);
  table.rule();
  for (std::size_t line = 0; line < columns.front().size(); ++line) {
    const Summary& first = columns.front()[line];
    std::vector<std::string> cells = {first.group, std::to_string(first.num_rows)};
    for (const auto& column : columns) {
      const Summary& one = column[line];
      cells.push_back(fmt::format("{} ({}, {})", number_or_dash(one.rotation_ratio, 2),
                                  one.num_for_judged, one.num_for_control));
    }
    table.add(std::move(cells));
  }
  table.rule();
  for (std::size_t drive = 0; drive < report.drives.size(); ++drive) {
    std::vector<std::string> cells = {"on " + report.drives[drive],
                                      std::to_string(report.rows.size())};
    for (std::size_t i = 0; i < num_controls; ++i) {
      cells.push_back(number_or_dash(ratio_on_drive(report.rows, i, drive), 2));
    }
    table.add(std::move(cells));
  }
  return table.str();
}

std::string format_rows(const RobustnessReport& report) {
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
    for (const Verdict& verdict : row.verdicts) {
      cells.push_back(words(verdict.rotation));
    }
    table.add(std::move(cells));
  }
  return table.str();
}

}  // namespace

std::optional<double> mean_rotation_error(const std::vector<Outcome>& outcomes) {
  return mean(outcomes, &Outcome::r_rel_deg_per_100m);
}

std::vector<Summary> summaries(const std::vector<Row>& rows, std::size_t control) {
  std::vector<Summary> result;
  std::vector<const Row*> all;
  for (const std::string& group : groups_of(rows)) {
    std::vector<const Row*> members;
    for (const Row& row : rows) {
      if (row.group == group) {
        members.push_back(&row);
      }
    }
    result.push_back(summarize(group, members, control));
    all.insert(all.end(), members.begin(), members.end());
  }
  result.push_back(summarize("all", all, control));
  return result;
}

std::optional<double> ratio_on_drive(const std::vector<Row>& rows,
                                     std::size_t control,
                                     std::size_t drive) {
  std::vector<double> ratios;
  for (const Row& row : rows) {
    const auto judged = row.outcomes.front().at(drive).r_rel_deg_per_100m;
    const auto other = row.outcomes.at(control + 1).at(drive).r_rel_deg_per_100m;
    if (judged && other && *judged > 0.0 && *other > 0.0) {
      ratios.push_back(*judged / *other);
    }
  }
  return geometric_mean(ratios);
}

std::string format_table(const RobustnessReport& report) {
  std::string text = format_rows(report);
  if (!report.rows.empty() && report.contenders.size() > 1) {
    text += "\nTimes a control's rotation error (rows decided for " + report.contenders.front() +
            ", for the control):\n" + format_summaries(report);
  }
  return text;
}

std::string format_csv(const RobustnessReport& report) {
  std::string text =
      "disturbance,strength,channel,drive,t_rel_percent,r_rel_deg_per_100m,tracked,recovery_frames,"
      "recovered,jumps\n";
  const auto number = [](const auto& value) { return value ? fmt::format("{}", *value) : ""; };
  for (const Row& row : report.rows) {
    for (std::size_t i = 0; i < report.contenders.size(); ++i) {
      for (std::size_t drive = 0; drive < report.drives.size(); ++drive) {
        const Outcome& one = row.outcomes[i][drive];
        text += fmt::format("{},{},{},{},", row.disturbance, row.strength,
                            csv_cell(report.contenders[i]), csv_cell(report.drives[drive]));
        text += one.is_refused
                    ? ",,,,,\n"
                    : fmt::format("{},{},{},{},{},{}\n", number(one.t_rel_percent),
                                  number(one.r_rel_deg_per_100m), one.tracked,
                                  number(one.recovery_frames), one.is_recovered, one.jumps);
      }
    }
  }
  return text;
}

Json document(const RobustnessReport& report) {
  Json rows = Json::array();
  for (const Row& row : report.rows) {
    Json channels = Json::array();
    for (std::size_t i = 0; i < report.contenders.size(); ++i) {
      const auto& outcomes = row.outcomes[i];
      const bool refused = is_refused(outcomes);
      const auto jumps = [](std::size_t sum, const Outcome& one) { return sum + one.jumps; };
      channels.push_back(
          {{"channel", report.contenders[i]},
           {"t_rel_percent", mean(outcomes, &Outcome::t_rel_percent)},
           {"r_rel_deg_per_100m", mean_rotation_error(outcomes)},
           {"tracked", mean_tracked(outcomes)},
           {"recovery_frames", longest_recovery(outcomes)},
           {"recovered",
            refused ? Json() : Json(std::ranges::all_of(outcomes, &Outcome::is_recovered))},
           {"jumps", refused ? Json()
                             : Json(std::accumulate(outcomes.begin(), outcomes.end(),
                                                    std::size_t{0}, jumps))}});
      if (i > 0) {
        channels.back()["rotation_ratio"] = interval(row.verdicts[i - 1].rotation);
        channels.back()["translation_ratio"] = interval(row.verdicts[i - 1].translation);
      }
    }
    rows.push_back({{"disturbance", row.disturbance},
                    {"group", row.group},
                    {"strength", row.strength},
                    {"channels", channels}});
  }
  Json groups = Json::array();
  Json drives = Json::array();
  for (std::size_t i = 1; i < report.contenders.size(); ++i) {
    for (const Summary& one : summaries(report.rows, i - 1)) {
      groups.push_back({{"group", one.group},
                        {"rows", one.num_rows},
                        {"control", report.contenders[i]},
                        {"rotation_ratio", one.rotation_ratio},
                        {"translation_ratio", one.translation_ratio},
                        {"decided_for_judged", one.num_for_judged},
                        {"decided_for_control", one.num_for_control}});
    }
    for (std::size_t drive = 0; drive < report.drives.size(); ++drive) {
      drives.push_back({{"drive", report.drives[drive]},
                        {"control", report.contenders[i]},
                        {"rotation_ratio", ratio_on_drive(report.rows, i - 1, drive)}});
    }
  }
  return {{"drives", report.drives},
          {"interrupted", report.interrupted},
          {"groups", groups},
          {"by_drive", drives},
          {"rows", rows}};
}

}  // namespace stemvo::robustness
