// SPDX-License-Identifier: MIT
#include <algorithm>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "report/metrics_keys.hpp"
#include "search/results.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"

namespace stemvo {

std::string to_string(const FilterKey& key) {
  return fmt::format("{} {} {}{}", key.model, key.layer, key.filter,
                     key.features == "klt" ? "" : " " + key.features);
}

std::string_view to_string(FilterStatus status) {
  switch (status) {
    case FilterStatus::kRanked:
      return "ranked";
    case FilterStatus::kStopped:
      return "stopped";
    default:
      return "not detected";
  }
}

std::string format_search_table(const SearchReport& report) {
  const auto cell = [](const std::optional<double>& value, int decimals) {
    return value ? fmt::format("{:.{}f}", *value, decimals) : std::string("-");
  };
  const bool has_held_out = std::ranges::any_of(
      report.rows, [](const FilterRow& row) { return row.held_out.has_value(); });
  TextTable table("rllrlrrrrrrrrrl");
  table.add({"", "model", "layer", "filter", "by", "t_rel %", "r_rel deg/100m", "offset m", "E_t m",
             "E_r deg", "inliers", "tracked %", "frames", has_held_out ? "held out t_rel %" : "",
             ""});
  table.rule();
  int rank = 0;
  for (const FilterRow& row : report.rows) {
    DriveScore mean = row.mean;
    std::string remark = row.status == FilterStatus::kStopped ? "stopped" : "";
    if (row.status == FilterStatus::kNotDetected) {
      mean.t_rel_percent.reset();
      mean.r_rel_deg_per_100m.reset();
      remark = "pose not detected: " + mean.reason;
    }
    if (mean.tracked_fraction) {
      *mean.tracked_fraction *= 100.0;
    }
    table.add(
        {row.status == FilterStatus::kRanked ? std::to_string(++rank) : "", row.key.model,
         row.key.layer, std::to_string(row.key.filter), row.key.features,
         cell(mean.t_rel_percent, 3), cell(mean.r_rel_deg_per_100m, 3),
         cell(mean.average_offset_m, 2), cell(mean.translation_change_m, 3),
         cell(mean.rotation_change_deg, 3), cell(mean.mean_inliers, 0),
         cell(mean.tracked_fraction, 1), std::to_string(mean.num_frames),
         row.held_out && row.held_out->is_detected ? cell(row.held_out->t_rel_percent, 3) : "",
         remark});
  }
  return table.str();
}

}  // namespace stemvo

namespace stemvo::search {
namespace {

using Json = nlohmann::ordered_json;

/// The early error is that of halving alone.
constexpr auto kTableNumbers = std::span(kScoreNumbers).first<kScoreNumbers.size() - 1>();

/// RFC 4180: quoted where it must be.
std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) {
    return text;
  }
  std::string quoted = "\"";
  for (const char c : text) {
    quoted.append(c == '"' ? 2 : 1, c);
  }
  return quoted + '"';
}

/// A column's name, and what the row has there.
using Column = std::pair<std::string, std::string>;

std::vector<Column> csv_columns(const SearchIdentity& identity, const FilterRow& row) {
  std::vector<Column> columns = {{"model", row.key.model},
                                 {"layer", row.key.layer},
                                 {"filter", std::to_string(row.key.filter)},
                                 {"features", row.key.features},
                                 {"status", std::string(to_string(row.status))}};
  const auto add = [&columns](const std::string& name, const ScoreNumber& number,
                              const DriveScore& score) {
    const std::optional<double>& value = score.*number.value;
    columns.emplace_back(name, value ? fmt::format("{:.{}f}", *value, number.decimals) : "");
  };
  for (const ScoreNumber& number : kTableNumbers) {
    add(number.key, number, row.mean);
  }
  columns.emplace_back("frames", std::to_string(row.mean.num_frames));
  const bool has_held_out = identity.sequences.back().held_out;
  const std::size_t num_ranking = identity.sequences.size() - (has_held_out ? 1 : 0);
  for (std::size_t i = 0; num_ranking > 1 && i < num_ranking; ++i) {
    for (const ScoreNumber& number : kTableNumbers.first<2>()) {
      add(number.key + ("_" + identity.sequences[i].name), number,
          row.drives.empty() ? DriveScore() : row.drives[i]);
    }
  }
  const bool is_known = row.held_out && row.held_out->is_detected;
  for (const ScoreNumber& number : kTableNumbers.first<3>()) {
    if (has_held_out) {
      add(std::string("held_out_") + number.key, number, is_known ? *row.held_out : DriveScore());
    }
  }
  columns.emplace_back("reason", row.mean.reason);
  return columns;
}

Json drive_json(const DriveScore& drive) {
  Json json = drive;
  json.erase("path_xz_m");
  if (drive.is_detected) {
    json.erase("reason");
  }
  return json;
}

Json row_json(const FilterRow& row) {
  Json json = row.key;
  json["status"] = to_string(row.status);
  json["t_rel_percent"] = row.mean.t_rel_percent;
  json["r_rel_deg_per_100m"] = row.mean.r_rel_deg_per_100m;
  json["rung"] = row.rung;
  json["sequences"] = Json::array();
  for (const DriveScore& drive : row.drives) {
    json["sequences"].push_back(drive_json(drive));
  }
  if (row.held_out) {
    json["held_out"] = drive_json(*row.held_out);
  }
  return json;
}

std::string format_json(const SearchIdentity& identity, const SearchReport& report) {
  Json json;
  json["stemvo_version"] = std::string(version());
  json["complete"] = !report.interrupted;
  json["search"] = identity.rungs.size() == 1 ? "exhaustive" : "successive halving";
  json["rungs"] = identity.rungs;
  json["sequences"] = Json::array();
  for (const SequenceIdentity& sequence : identity.sequences) {
    json["sequences"].push_back({{"name", sequence.name},
                                 {"first_frame", sequence.first_frame},
                                 {"frames", sequence.num_frames},
                                 {"held_out", sequence.held_out}});
  }
  json["work"] = {{"filter_frames", report.work.filter_frames},
                  {"held_out_filter_frames", report.work.held_out_filter_frames},
                  {"baseline_filter_frames", report.work.baseline_filter_frames},
                  {"exhaustive_filter_frames", report.work.exhaustive_filter_frames}};
  json["filters"] = Json::array();
  for (const FilterRow& row : report.rows) {
    json["filters"].push_back(row_json(row));
  }
  json["configuration"] = identity.configuration;
  return to_text(json);
}

/// best.yaml, with a head of comments.
std::string format_best(const FilterRow& best, const Config& config, bool was_halved) {
  return fmt::format(
      "# stemvo {}\n"
      "# {}: the best of the search, t_rel {:.4f} %{}\n"
      "# What repeats its row: the search's fast odometry, steps of the true length.\n"
      "# The filter with the defaults of a run: stemvo run SEQUENCE --out DIR --set stem.model={} "
      "--set stem.layer={} --set stem.filter={}\n\n{}",
      version(), to_string(best.key), best.mean.t_rel_percent.value_or(0.0),
      was_halved ? " (successive halving)" : "", config.stem.model, config.stem.layer,
      config.stem.filter, dump_config(config));
}

}  // namespace

std::string format_csv(const SearchIdentity& identity, const std::vector<FilterRow>& rows) {
  const auto line_of = [&identity](const FilterRow& row, std::string Column::* part) {
    std::vector<std::string> cells;
    for (const Column& column : csv_columns(identity, row)) {
      cells.push_back(csv_cell(column.*part));
    }
    return fmt::format("{}\n", fmt::join(cells, ","));
  };
  std::string text = line_of(FilterRow(), &Column::first);
  for (const FilterRow& row : rows) {
    text += line_of(row, &Column::second);
  }
  return text;
}

Status write_tables(const Folders& folders,
                    const SearchIdentity& identity,
                    const Config& common,
                    const SearchReport& report) {
  Status status =
      write_text_file(folders.out_dir / "filters.csv", format_csv(identity, report.rows));
  if (status) {
    status = write_text_file(folders.out_dir / "filters.json", format_json(identity, report));
  }
  if (!status || report.rows.empty() || report.rows.front().status != FilterStatus::kRanked) {
    return status;
  }
  const FilterRow& best = report.rows.front();
  const Config config = config_of(common, identity.layer_of(best.key), best.key.filter);
  return write_text_file(folders.out_dir / "best.yaml",
                         format_best(best, config, identity.rungs.size() > 1));
}

}  // namespace stemvo::search
