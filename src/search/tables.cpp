// SPDX-License-Identifier: MIT
#include "search/tables.hpp"

#include <algorithm>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "report/metrics_keys.hpp"
#include "search/json.hpp"
#include "search/ranking.hpp"
#include "stemvo/check.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"

namespace stemvo::search {
namespace {

/// RFC 4180: quoted where it must be.
std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) {
    return text;
  }
  std::string quoted = "\"";
  for (const char c : text) {
    quoted.append(c == '"' ? 2 : 1, c);
  }
  quoted += '"';
  return quoted;
}

std::string number(const std::optional<double>& value, int decimals) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : std::string();
}

std::vector<std::string> ranking_sequences(const SearchIdentity& identity) {
  std::vector<std::string> names;
  for (const SequenceIdentity& sequence : identity.sequences) {
    if (!sequence.is_held_out) {
      names.push_back(sequence.name);
    }
  }
  return names;
}

bool has_held_out(const SearchIdentity& identity) {
  return std::any_of(identity.sequences.begin(), identity.sequences.end(),
                     [](const SequenceIdentity& sequence) { return sequence.is_held_out; });
}

std::vector<std::string> csv_header(const SearchIdentity& identity) {
  std::vector<std::string> cells = {"model",
                                    "layer",
                                    "filter",
                                    "features",
                                    "status",
                                    "t_rel_percent",
                                    "r_rel_deg_per_100m",
                                    "average_offset_m",
                                    "E_t_m",
                                    "E_r_deg",
                                    "inliers",
                                    "tracked",
                                    "frames"};
  const auto names = ranking_sequences(identity);
  for (std::size_t i = 0; names.size() > 1 && i < names.size(); ++i) {
    cells.push_back("t_rel_percent_" + names[i]);
    cells.push_back("r_rel_deg_per_100m_" + names[i]);
  }
  if (has_held_out(identity)) {
    cells.insert(cells.end(), {"held_out_t_rel_percent", "held_out_r_rel_deg_per_100m",
                               "held_out_average_offset_m"});
  }
  cells.emplace_back("reason");
  return cells;
}

std::vector<std::string> csv_row(const SearchIdentity& identity, const FilterRow& row) {
  const MeanScore mean = mean_score(row.drives);
  std::vector<std::string> cells = {row.key.model,
                                    row.key.layer,
                                    std::to_string(row.key.filter),
                                    row.key.features,
                                    std::string(to_string(row.status)),
                                    number(mean.t_rel_percent, 4),
                                    number(mean.r_rel_deg_per_100m, 4),
                                    number(mean.average_offset_m, 4),
                                    number(mean.translation_change_m, 4),
                                    number(mean.rotation_change_deg, 4),
                                    number(mean.mean_inliers, 1),
                                    number(mean.tracked_fraction, 4),
                                    std::to_string(mean.num_frames)};
  for (std::size_t i = 0; row.drives.size() > 1 && i < row.drives.size(); ++i) {
    cells.push_back(number(row.drives[i].t_rel_percent, 4));
    cells.push_back(number(row.drives[i].r_rel_deg_per_100m, 4));
  }
  if (has_held_out(identity)) {
    const bool has = row.held_out && row.held_out->is_detected;
    cells.push_back(has ? number(row.held_out->t_rel_percent, 4) : "");
    cells.push_back(has ? number(row.held_out->r_rel_deg_per_100m, 4) : "");
    cells.push_back(has ? number(row.held_out->average_offset_m, 4) : "");
  }
  cells.push_back(reason_of(row));
  return cells;
}

Json drive_json(const DriveScore& drive) {
  Json json;
  json["sequence"] = drive.sequence;
  json["frames"] = drive.num_frames;
  json["detected"] = drive.is_detected;
  if (!drive.is_detected) {
    json["reason"] = drive.reason;
  }
  json["t_rel_percent"] = optional_json(drive.t_rel_percent);
  json["r_rel_deg_per_100m"] = optional_json(drive.r_rel_deg_per_100m);
  json["average_offset_m"] = drive.average_offset_m;
  json["E_t_m"] = drive.translation_change_m;
  json["E_r_deg"] = drive.rotation_change_deg;
  json["inliers"] = drive.mean_inliers;
  json["tracked"] = drive.tracked_fraction;
  json["early_error_percent"] = drive.early_error_percent;
  return json;
}

Json row_json(const FilterRow& row) {
  const MeanScore mean = mean_score(row.drives);
  Json json;
  json["model"] = row.key.model;
  json["layer"] = row.key.layer;
  json["filter"] = row.key.filter;
  json["features"] = row.key.features;
  json["status"] = to_string(row.status);
  json["t_rel_percent"] = optional_json(mean.t_rel_percent);
  json["r_rel_deg_per_100m"] = optional_json(mean.r_rel_deg_per_100m);
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

Json sequence_json(const SequenceIdentity& sequence) {
  Json json;
  json["name"] = sequence.name;
  json["first_frame"] = sequence.first_frame;
  json["frames"] = sequence.num_frames;
  json["held_out"] = sequence.is_held_out;
  return json;
}

Json work_json(const SearchWork& work) {
  Json json;
  json["filter_frames"] = work.filter_frames;
  json["held_out_filter_frames"] = work.held_out_filter_frames;
  json["exhaustive_filter_frames"] = work.exhaustive_filter_frames;
  return json;
}

/// The head of best.yaml, as comments.
std::string best_head(const FilterRow& best, const Config& config, bool was_stopped_early) {
  const MeanScore mean = mean_score(best.drives);
  std::string text = fmt::format("# stemvo {}\n", version());
  text += fmt::format("# {}: the best of the search, t_rel {:.4f} %{}\n", to_string(best.key),
                      mean.t_rel_percent.value_or(0.0),
                      was_stopped_early ? " (successive halving)" : "");
  text += "# What repeats its row: the search's fast odometry, steps of the true length.\n";
  text += fmt::format(
      "# The filter with the defaults of a run: stemvo run SEQUENCE --out DIR --set "
      "stem.model={} --set stem.layer={} --set stem.filter={}\n\n",
      config.stem.model, config.stem.layer, config.stem.filter);
  return text;
}

}  // namespace

std::string format_csv(const SearchIdentity& identity, const SearchReport& report) {
  std::string text;
  const auto add_line = [&text](const std::vector<std::string>& cells) {
    for (std::size_t i = 0; i < cells.size(); ++i) {
      text += i > 0 ? "," : "";
      text += csv_cell(cells[i]);
    }
    text += '\n';
  };
  add_line(csv_header(identity));
  for (const FilterRow& row : report.rows) {
    add_line(csv_row(identity, row));
  }
  return text;
}

std::string format_json(const SearchIdentity& identity, const SearchReport& report) {
  Json json;
  json["stemvo_version"] = std::string(version());
  json["complete"] = !report.interrupted;
  json["search"] = identity.schedule.size() == 1 ? "exhaustive" : "successive halving";
  json["rungs"] = Json::array();
  for (const Rung& rung : identity.schedule) {
    json["rungs"].push_back({{"frame_share", rung.frame_share}, {"filters", rung.num_filters}});
  }
  json["sequences"] = Json::array();
  for (const SequenceIdentity& sequence : identity.sequences) {
    json["sequences"].push_back(sequence_json(sequence));
  }
  json["work"] = work_json(report.work);
  json["filters"] = Json::array();
  for (const FilterRow& row : report.rows) {
    json["filters"].push_back(row_json(row));
  }
  json["configuration"] = identity.configuration;
  return to_text(json);
}

Expected<Config> config_of(const std::filesystem::path& out_dir,
                           const SearchIdentity& identity,
                           const FilterKey& key) {
  Expected<Config> config = load_config(out_dir / "config.yaml");
  if (!config) {
    return config;
  }
  const auto layer = std::find_if(
      identity.layers.begin(), identity.layers.end(), [&key](const LayerIdentity& candidate) {
        return candidate.model == key.model && candidate.layer == key.layer &&
               candidate.features == key.features && candidate.first <= key.filter &&
               key.filter < candidate.last;
      });
  STEMVO_CHECK(layer != identity.layers.end(), "each row has a layer");
  config->stem.model = layer->stem_model;
  const bool is_network = key.model != "gray" && key.model != "input_layer";
  config->stem.layer = is_network ? key.layer : StemOptions().layer;
  config->stem.filter = key.filter;
  config->stem.sampling_px = layer->sampling_px;
  config->features.method = key.features;
  return config;
}

Status write_tables(const std::filesystem::path& out_dir,
                    const SearchIdentity& identity,
                    const SearchReport& report) {
  Status status = write_text_file(out_dir / "config.yaml", identity.configuration);
  if (status) {
    status = write_text_file(out_dir / "filters.csv", format_csv(identity, report));
  }
  if (status) {
    status = write_text_file(out_dir / "filters.json", format_json(identity, report));
  }
  if (!status || report.rows.empty() || report.rows.front().status != FilterStatus::kRanked) {
    return status;
  }
  const FilterRow& best = report.rows.front();
  const Expected<Config> config = config_of(out_dir, identity, best.key);
  if (!config) {
    return tl::unexpected(config.error());
  }
  return write_text_file(
      out_dir / "best.yaml",
      best_head(best, *config, identity.schedule.size() > 1) + dump_config(*config));
}

}  // namespace stemvo::search
