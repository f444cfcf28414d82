// SPDX-License-Identifier: MIT
#include "search/record_json.hpp"

#include <fmt/format.h>

#include "search/json.hpp"

namespace stemvo::search {
namespace {

constexpr int kFormat = 1;

std::optional<double> optional_number(const Json& json) {
  return json.is_null() ? std::nullopt : std::optional(json.get<double>());
}

Json score_json(const DriveScore& score) {
  Json json;
  json["sequence"] = score.sequence;
  json["frames"] = score.num_frames;
  json["detected"] = score.is_detected;
  json["reason"] = score.reason;
  json["t_rel_percent"] = optional_json(score.t_rel_percent);
  json["r_rel_deg_per_100m"] = optional_json(score.r_rel_deg_per_100m);
  json["average_offset_m"] = score.average_offset_m;
  json["E_t_m"] = score.translation_change_m;
  json["E_r_deg"] = score.rotation_change_deg;
  json["inliers"] = score.mean_inliers;
  json["tracked"] = score.tracked_fraction;
  json["early_error_percent"] = score.early_error_percent;
  json["path_xz_m"] = Json::array();
  for (const PathPoint& point : score.path) {
    json["path_xz_m"].push_back({point.x_m, point.z_m});
  }
  return json;
}

DriveScore read_score(const Json& json) {
  DriveScore score;
  score.sequence = json.at("sequence").get<std::string>();
  score.num_frames = json.at("frames").get<std::size_t>();
  score.is_detected = json.at("detected").get<bool>();
  score.reason = json.at("reason").get<std::string>();
  score.t_rel_percent = optional_number(json.at("t_rel_percent"));
  score.r_rel_deg_per_100m = optional_number(json.at("r_rel_deg_per_100m"));
  score.average_offset_m = json.at("average_offset_m").get<double>();
  score.translation_change_m = json.at("E_t_m").get<double>();
  score.rotation_change_deg = json.at("E_r_deg").get<double>();
  score.mean_inliers = json.at("inliers").get<double>();
  score.tracked_fraction = json.at("tracked").get<double>();
  score.early_error_percent = json.at("early_error_percent").get<double>();
  for (const Json& point : json.at("path_xz_m")) {
    score.path.push_back({point.at(0).get<double>(), point.at(1).get<double>()});
  }
  return score;
}

Json layer_json(const LayerIdentity& layer) {
  Json json;
  json["model"] = layer.model;
  json["layer"] = layer.layer;
  json["features"] = layer.features;
  json["first"] = layer.first;
  json["last"] = layer.last;
  json["hash"] = layer.hash;
  json["sampling_px"] = layer.sampling_px;
  json["stem_model"] = layer.stem_model;
  return json;
}

LayerIdentity read_layer(const Json& json) {
  return {.model = json.at("model").get<std::string>(),
          .layer = json.at("layer").get<std::string>(),
          .features = json.at("features").get<std::string>(),
          .first = json.at("first").get<int>(),
          .last = json.at("last").get<int>(),
          .hash = json.at("hash").get<std::string>(),
          .sampling_px = json.at("sampling_px").get<int>(),
          .stem_model = json.at("stem_model").get<std::string>()};
}

Json sequence_json(const SequenceIdentity& sequence) {
  Json json;
  json["name"] = sequence.name;
  json["held_out"] = sequence.is_held_out;
  json["first_frame"] = sequence.first_frame;
  json["num_frames"] = sequence.num_frames;
  json["frames"] = sequence.frames;
  json["calibration"] = sequence.calibration;
  json["ground_truth"] = sequence.ground_truth;
  json["directory"] = sequence.directory;
  return json;
}

SequenceIdentity read_sequence(const Json& json) {
  return {.name = json.at("name").get<std::string>(),
          .is_held_out = json.at("held_out").get<bool>(),
          .first_frame = json.at("first_frame").get<std::size_t>(),
          .num_frames = json.at("num_frames").get<std::size_t>(),
          .frames = json.at("frames").get<std::string>(),
          .calibration = json.at("calibration").get<std::string>(),
          .ground_truth = json.at("ground_truth").get<std::string>(),
          .directory = json.at("directory").get<std::string>()};
}

SearchIdentity read_identity(const Json& json) {
  SearchIdentity identity;
  identity.program = json.at("program").get<std::string>();
  identity.configuration = json.at("configuration").get<std::string>();
  for (const Json& rung : json.at("rungs")) {
    identity.schedule.push_back(
        {rung.at("frame_share").get<double>(), rung.at("filters").get<std::size_t>()});
  }
  for (const Json& layer : json.at("layers")) {
    identity.layers.push_back(read_layer(layer));
  }
  for (const Json& sequence : json.at("sequences")) {
    identity.sequences.push_back(read_sequence(sequence));
  }
  return identity;
}

Record read_record(const Json& json) {
  Record record;
  record.key = {json.at("model").get<std::string>(), json.at("layer").get<std::string>(),
                json.at("filter").get<int>(), json.at("features").get<std::string>()};
  record.rung = json.at("rung").get<int>();
  record.filter_frames = json.at("filter_frames").get<std::size_t>();
  record.held_out_filter_frames = json.at("held_out_filter_frames").get<std::size_t>();
  for (const Json& drive : json.at("drives")) {
    record.drives.push_back(read_score(drive));
  }
  if (!json.at("held_out").is_null()) {
    record.held_out = read_score(json.at("held_out"));
  }
  return record;
}

/// One line; bytes of a file name that are not UTF-8 become the replacement character.
std::string one_line(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

std::string identity_line(const SearchIdentity& identity) {
  Json json;
  json["stemvo_search"] = kFormat;
  json["program"] = identity.program;
  json["configuration"] = identity.configuration;
  json["rungs"] = Json::array();
  for (const Rung& rung : identity.schedule) {
    json["rungs"].push_back({{"frame_share", rung.frame_share}, {"filters", rung.num_filters}});
  }
  json["layers"] = Json::array();
  for (const LayerIdentity& layer : identity.layers) {
    json["layers"].push_back(layer_json(layer));
  }
  json["sequences"] = Json::array();
  for (const SequenceIdentity& sequence : identity.sequences) {
    json["sequences"].push_back(sequence_json(sequence));
  }
  return one_line(json);
}

std::string record_line(const Record& record) {
  Json json;
  json["model"] = record.key.model;
  json["layer"] = record.key.layer;
  json["filter"] = record.key.filter;
  json["features"] = record.key.features;
  json["rung"] = record.rung;
  json["filter_frames"] = record.filter_frames;
  json["held_out_filter_frames"] = record.held_out_filter_frames;
  json["drives"] = Json::array();
  for (const DriveScore& score : record.drives) {
    json["drives"].push_back(score_json(score));
  }
  json["held_out"] = record.held_out ? score_json(*record.held_out) : Json();
  return one_line(json);
}

Status parse_identity(const std::string& line, SearchIdentity& identity) {
  try {
    const Json json = Json::parse(line);
    const int format = json.at("stemvo_search").get<int>();
    if (format != kFormat) {
      return fail(fmt::format("expected records of format {}, found {}", kFormat, format));
    }
    identity = read_identity(json);
  } catch (const nlohmann::json::exception& error) {
    return fail(fmt::format("expected the identity of a search, found: {}", error.what()));
  }
  return {};
}

Status parse_record(const std::string& line, Record& record) {
  try {
    record = read_record(Json::parse(line));
  } catch (const nlohmann::json::exception& error) {
    return fail(fmt::format("expected the record of a filter, found: {}", error.what()));
  }
  return {};
}

}  // namespace stemvo::search
