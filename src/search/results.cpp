// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "report/frame_image.hpp"
#include "report/metrics_keys.hpp"
#include "search/records.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"

namespace stemvo::search {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// A number of a DriveScore: its key, and its decimals in filters.csv.
struct ScoreNumber {
  const char* key;
  std::optional<double> DriveScore::* value;
  int decimals;
};
constexpr std::array<ScoreNumber, 7> kScoreNumbers = {{
    {"t_rel_percent", &DriveScore::t_rel_percent, 4},
    {"r_rel_deg_per_100m", &DriveScore::r_rel_deg_per_100m, 4},
    {"average_offset_m", &DriveScore::average_offset_m, 4},
    {"E_t_m", &DriveScore::E_t_m, 4},
    {"E_r_deg", &DriveScore::E_r_deg, 4},
    {"inliers", &DriveScore::inliers, 1},
    {"tracked", &DriveScore::tracked, 4},
}};

constexpr const char* kStatusWords[] = {"ranked", "stopped", "not detected"};
std::string word_for(FilterStatus status) { return kStatusWords[static_cast<int>(status)]; }

/// Frames times filters, and what was run again after a kill: of the filters, of all on the
/// held-out sequence, of the baselines, and of an exhaustive search of all filters that can run.
Json work_of(const SearchIdentity& identity,
             const FilterRecords& records,
             const std::vector<FilterRow>& rows) {
  std::size_t done = 0;
  std::size_t held_out = 0;
  std::size_t baselines = 0;
  std::size_t exhaustive = 0;
  for (const FilterRecord& record : records) {
    (identity.layer_of(record.key).baseline ? baselines : done) += record.filter_frames;
    held_out += record.held_out_filter_frames;
  }
  for (const FilterRow& row : rows) {
    for (std::size_t i = 0; i < row.drives.size() && !identity.layer_of(row.key).baseline; ++i) {
      exhaustive += row.drives[i].frames > 0 ? identity.sequences[i].num_frames : 0;
    }
  }
  return {{"filter_frames", done},
          {"held_out_filter_frames", held_out},
          {"baseline_filter_frames", baselines},
          {"exhaustive_filter_frames", exhaustive}};
}

/// A column's name, and what the row has there.
using Column = std::pair<std::string, std::string>;

std::vector<Column> csv_columns(const SearchIdentity& identity, const FilterRow& row) {
  std::vector<Column> columns = {{"model", row.key.model},
                                 {"layer", row.key.layer},
                                 {"filter", std::to_string(row.key.filter)},
                                 {"features", row.key.features},
                                 {"status", word_for(row.status)}};
  const auto add = [&](const std::string& name, const ScoreNumber& number, const DriveScore& of) {
    const std::optional<double>& value = of.*number.value;
    columns.emplace_back(name, value ? fmt::format("{:.{}f}", *value, number.decimals) : "");
  };
  for (const ScoreNumber& number : kScoreNumbers) {
    add(number.key, number, row.mean);
  }
  const bool is_ranked = row.status == FilterStatus::kRanked;
  const auto if_ranked = [&](const std::string& text) { return is_ranked ? text : ""; };
  const bool has_interval = std::isfinite(row.over_best.high);
  columns.emplace_back("over_best", if_ranked(fmt::format("{:.4f}", row.over_best.ratio)));
  for (const auto& [name, bound] : {std::pair("over_best_low", row.over_best.low),
                                    std::pair("over_best_high", row.over_best.high)}) {
    columns.emplace_back(name, has_interval ? if_ranked(fmt::format("{:.4f}", bound)) : "");
  }
  columns.emplace_back("equal", if_ranked(row.is_equal ? "yes" : "no"));
  columns.emplace_back("frames", std::to_string(row.mean.frames));
  const bool has_held_out = identity.sequences.back().held_out;
  const std::size_t num_ranking = identity.sequences.size() - (has_held_out ? 1 : 0);
  for (std::size_t i = 0; num_ranking > 1 && i < num_ranking; ++i) {
    for (const ScoreNumber& number : std::span(kScoreNumbers).first<2>()) {
      add(number.key + ("_" + identity.sequences[i].name), number,
          row.drives.empty() ? DriveScore() : row.drives[i]);
    }
  }
  const bool is_known = row.held_out && row.held_out->detected;
  for (const ScoreNumber& number : std::span(kScoreNumbers).first<3>()) {
    if (has_held_out) {
      add(std::string("held_out_") + number.key, number, is_known ? *row.held_out : DriveScore());
    }
  }
  columns.emplace_back("reason", row.mean.reason);
  return columns;
}

/// Table for people of the columns that tell filters apart: numbers to the right.
std::string format_table(const SearchIdentity& identity, const std::vector<FilterRow>& rows) {
  static const std::map<std::string, char> kShown = {{"model", 'l'},
                                                     {"layer", 'l'},
                                                     {"filter", 'r'},
                                                     {"features", 'l'},
                                                     {"status", 'l'},
                                                     {"t_rel_percent", 'r'},
                                                     {"r_rel_deg_per_100m", 'r'},
                                                     {"inliers", 'r'},
                                                     {"tracked", 'r'},
                                                     {"over_best", 'r'},
                                                     {"over_best_low", 'r'},
                                                     {"over_best_high", 'r'},
                                                     {"frames", 'r'},
                                                     {"held_out_t_rel_percent", 'r'},
                                                     {"reason", 'l'}};
  const auto cells_of = [&](std::string rank, const FilterRow& row, std::string Column::* part) {
    std::vector<std::string> cells = {std::move(rank)};
    for (const Column& column : csv_columns(identity, row)) {
      if (kShown.contains(column.first)) {
        cells.push_back(column.*part);
      }
    }
    return cells;
  };
  const std::vector<std::string> head = cells_of("", FilterRow(), &Column::first);
  std::string alignment = "r";
  std::for_each(head.begin() + 1, head.end(),
                [&](const std::string& name) { alignment += kShown.at(name); });
  TextTable table(alignment);
  table.add(head);
  table.rule();
  int rank = 0;
  for (const FilterRow& row : rows) {
    const bool is_ranked = row.status == FilterStatus::kRanked;
    table.add(cells_of(is_ranked ? std::to_string(++rank) : "", row, &Column::second));
  }
  return table.str();
}

Json drive_json(const DriveScore& drive) {
  Json json = drive;
  json.erase("path_xz_m");
  json.erase("dense_t_percent");
  json.erase("block");
  if (drive.detected) {
    json.erase("reason");
  }
  return json;
}

Json row_json(const FilterRow& row) {
  Json json = row.key;
  json["status"] = word_for(row.status);
  json["t_rel_percent"] = row.mean.t_rel_percent;
  json["r_rel_deg_per_100m"] = row.mean.r_rel_deg_per_100m;
  if (row.status == FilterStatus::kRanked) {
    json["over_best"] = {
        {"ratio", row.over_best.ratio}, {"low", row.over_best.low}, {"high", row.over_best.high}};
    json["equal"] = row.is_equal;
  }
  json["rung"] = row.rung;
  json["sequences"] = Json::array();
  std::ranges::transform(row.drives, std::back_inserter(json["sequences"]), drive_json);
  if (row.held_out) {
    json["held_out"] = drive_json(*row.held_out);
  }
  return json;
}

std::string format_json(const Results& results, const Json& work, bool is_complete) {
  const SearchIdentity& identity = results.identity;
  Json json;
  json["stemvo_version"] = std::string(version());
  json["complete"] = is_complete;
  json["search"] = identity.rungs.size() == 1 ? "exhaustive" : "successive halving";
  json["rungs"] = identity.rungs;
  json["sequences"] = Json::array();
  for (const SequenceIdentity& sequence : identity.sequences) {
    json["sequences"].push_back({{"name", sequence.name},
                                 {"first_frame", sequence.first_frame},
                                 {"frames", sequence.num_frames},
                                 {"held_out", sequence.held_out}});
  }
  json["work"] = work;
  json["filters"] = Json::array();
  std::ranges::transform(results.rows, std::back_inserter(json["filters"]), row_json);
  json["configuration"] = identity.configuration;
  return to_text(json);
}

/// Lines below the table.
std::string format_summary(const Results& results, const Json& work) {
  const auto num_frames = work["filter_frames"].get<std::size_t>();
  const auto num_exhaustive = work["exhaustive_filter_frames"].get<double>();
  const auto num_equal = std::ranges::count(results.rows, true, &FilterRow::is_equal);
  const fs::path& folder = results.target.out_dir;
  std::string equals;
  if (num_equal > 1) {
    equals = has_intervals(results.rows)
                 ? fmt::format(
                       "filters 1 to {} cannot be told from the best (over best: errors "
                       "over its errors, 95 % interval)\n",
                       num_equal)
                 : "the path is too short for 95 % intervals, which say what is worse than the "
                   "best (over best: errors over its errors)\n";
  }
  return equals +
         fmt::format(
             "work: {} filter-frames, {:.1f} % of an exhaustive search; baselines: {}\ntable: "
             "{}\nreport: {}\n",
             num_frames, 100.0 * static_cast<double>(num_frames) / std::max(num_exhaustive, 1.0),
             work["baseline_filter_frames"].get<std::size_t>(), (folder / "filters.csv").string(),
             (folder / "report.html").string());
}

/// best.yaml: what repeats the first row.
std::string format_best(const Results& results) {
  const FilterRow& best = results.rows.front();
  const Config config =
      config_of(results.config, results.identity.layer_of(best.key), best.key.filter);
  return fmt::format(
      "# stemvo {}\n"
      "# {}: the best of the search, t_rel {:.4f} %{}\n"
      "# What repeats its row: the search's fast odometry, steps of the true length.\n"
      "# The filter with the defaults of a run: stemvo run SEQUENCE --out DIR --set stem.model={} "
      "--set stem.filter={}\n\n{}",
      version(), to_string(best.key), best.mean.t_rel_percent.value_or(0.0),
      results.identity.rungs.size() > 1 ? " (successive halving)" : "", config.stem.model,
      config.stem.filter, dump_config(config));
}

/// All but config.yaml.
Status write_files(const Results& results, SearchReport& report) {
  const fs::path& folder = results.target.out_dir;
  std::vector<std::pair<const char*, std::string>> files = {
      {"filters.csv", format_csv(results.identity, results.rows)}, {"filters.json", report.json}};
  if (!results.rows.empty() && results.rows.front().status == FilterStatus::kRanked) {
    files.emplace_back("best.yaml", format_best(results));
  }
  for (const auto& [name, text] : files) {
    if (const Status status = write_text_file(folder / name, text); !status) {
      return status;
    }
  }
  const Expected<Pictures> pictures = draw_pictures(results);
  if (!pictures) {
    report.warnings.push_back("no sheet.png: " + pictures.error().message);
  } else if (!pictures->sheet.empty()) {
    if (const Status status = write_image(folder / "sheet.png", pictures->sheet); !status) {
      return status;
    }
  }
  const Status page = write_page(results, pictures ? *pictures : Pictures(), report.text);
  return page && !pictures && pictures.error().lacks_memory
             ? fail(report.warnings.back() + "; all else is written")
             : page;
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

Expected<SearchReport> write_results(const SearchIdentity& identity,
                                     const FilterRecords& records,
                                     const ResultsTarget& target) {
  const auto num_done = std::ranges::count(records, identity.rungs.size() - 1, &FilterRecord::rung);
  SearchReport report;
  report.interrupted =
      static_cast<std::size_t>(num_done) != identity.rungs.back().filters + identity.count(true);
  if (identity.only_sequence) {
    report.text = fmt::format(
        "part: {} filters on one sequence; 'stemvo search --merge' joins it with the others\n",
        identity.num_rows());
    report.json = to_text({{"part", true}, {"filters", identity.num_rows()}});
    return report;
  }
  const fs::path config_file = target.out_dir / "config.yaml";
  const Expected<Config> config =
      write_text_file(config_file, identity.configuration).and_then([&] {
        return load_config(config_file);
      });
  if (!config) {
    return config.error();
  }
  const Results results = {target, identity, *config, rank_filters(identity, records)};
  const Json work = work_of(identity, records, results.rows);
  report.json = format_json(results, work, !report.interrupted);
  report.text = format_table(identity, results.rows);
  if (const Status written = write_files(results, report); !written) {
    return written.error();
  }
  report.text += format_summary(results, work);
  return report;
}

}  // namespace stemvo::search
