// SPDX-License-Identifier: MIT
#include "search/record_json.hpp"

#include <fmt/format.h>

#include "search/json_fields.hpp"

namespace stemvo::search {
namespace {

constexpr int kFormat = 3;

Json score_json(const DriveScore& score) {
  Json json;
  visit_score(score, JsonWriter(json));
  json["path_xz_m"] = Json::array();
  for (const PathPoint& point : score.path) {
    json["path_xz_m"].push_back({point.x_m, point.z_m});
  }
  return json;
}

DriveScore read_score(const Json& json) {
  DriveScore score;
  visit_score(score, JsonReader(json));
  for (const Json& point : json.at("path_xz_m")) {
    score.path.push_back({point.at(0).get<double>(), point.at(1).get<double>()});
  }
  return score;
}

/// One element per object of an array, read by `read(element, reader)`.
template <typename Element, typename Read>
std::vector<Element> read_array(const Json& array, const Read& read) {
  std::vector<Element> elements;
  for (const Json& json : array) {
    read(elements.emplace_back(), JsonReader(json));
  }
  return elements;
}

SearchIdentity read_identity(const Json& json) {
  SearchIdentity identity;
  identity.program = json.at("program").get<std::string>();
  identity.configuration = json.at("configuration").get<std::string>();
  identity.schedule = read_array<Rung>(json.at("rungs"), visit_rung<Rung, JsonReader>);
  identity.layers =
      read_array<LayerIdentity>(json.at("layers"), visit_layer<LayerIdentity, JsonReader>);
  identity.sequences = read_array<SequenceIdentity>(json.at("sequences"),
                                                    visit_sequence<SequenceIdentity, JsonReader>);
  if (const Json& only = json.at("only_sequence"); !only.is_null()) {
    identity.only_sequence = only.get<std::size_t>();
  }
  return identity;
}

Record read_record(const Json& json) {
  Record record;
  visit_key(record.key, JsonReader(json));
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
  json["rungs"] = rungs_json(identity.schedule);
  json["layers"] = json_array(identity.layers, visit_layer<const LayerIdentity, JsonWriter>);
  json["sequences"] =
      json_array(identity.sequences, visit_sequence<const SequenceIdentity, JsonWriter>);
  json["only_sequence"] = identity.only_sequence ? Json(*identity.only_sequence) : Json();
  return one_line(json);
}

std::string record_line(const Record& record) {
  Json json;
  visit_key(record.key, JsonWriter(json));
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
