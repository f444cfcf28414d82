// SPDX-License-Identifier: MIT
#include "search/tables.hpp"

#include <fmt/format.h>

#include "report/metrics_keys.hpp"
#include "search/json_fields.hpp"
#include "search/ranking.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"

namespace stemvo::search {
namespace {

Json drive_json(const DriveScore& drive) {
  Json json;
  visit_score(drive, JsonWriter(json));
  if (drive.is_detected) {
    json.erase("reason");
  }
  return json;
}

Json row_json(const FilterRow& row) {
  const MeanScore mean = mean_score(row.drives);
  Json json;
  visit_key(row.key, JsonWriter(json));
  json["status"] = to_string(row.status);
  json["t_rel_percent"] = number_or_null(mean.t_rel_percent);
  json["r_rel_deg_per_100m"] = number_or_null(mean.r_rel_deg_per_100m);
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
  json["baseline_filter_frames"] = work.baseline_filter_frames;
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

std::string format_json(const SearchIdentity& identity, const SearchReport& report) {
  Json json;
  json["stemvo_version"] = std::string(version());
  json["complete"] = !report.interrupted;
  json["search"] = identity.schedule.size() == 1 ? "exhaustive" : "successive halving";
  json["rungs"] = rungs_json(identity.schedule);
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
  const LayerIdentity& layer = layer_of(identity, key);
  config->stem.model = layer.stem_model;
  const bool is_network = key.model != "gray" && key.model != "input_layer";
  config->stem.layer = is_network ? key.layer : StemOptions().layer;
  config->stem.filter = key.filter;
  config->stem.sampling_px = layer.sampling_px;
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
    return config.error();
  }
  return write_text_file(
      out_dir / "best.yaml",
      best_head(best, *config, identity.schedule.size() > 1) + dump_config(*config));
}

}  // namespace stemvo::search
