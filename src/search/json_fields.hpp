// SPDX-License-Identifier: MIT
#pragma once

#include <nlohmann/json.hpp>

#include "report/optional_number.hpp"
#include "search/identity.hpp"
#include "stemvo/search/search.hpp"

/// The keys of a search's files, each once: a visitor writes them, another one reads them.
namespace stemvo::search {

using Json = nlohmann::ordered_json;

class JsonWriter {
 public:
  explicit JsonWriter(Json& json) : json_(json) {}
  void operator()(const char* key, const std::optional<double>& value) const {
    json_[key] = number_or_null(value);
  }
  template <typename Value>
  void operator()(const char* key, const Value& value) const {
    json_[key] = value;
  }

 private:
  Json& json_;
};

/// Throws nlohmann::json::exception where a key is missing or of another type.
class JsonReader {
 public:
  explicit JsonReader(const Json& json) : json_(json) {}
  void operator()(const char* key, std::optional<double>& value) const {
    value = optional_number(json_.at(key));
  }
  template <typename Value>
  void operator()(const char* key, Value& value) const {
    json_.at(key).get_to(value);
  }

 private:
  const Json& json_;
};

// `Key`, `Score` ..: const where they are written.
template <typename Key, typename Visitor>
void visit_key(Key& key, const Visitor& visit) {
  visit("model", key.model);
  visit("layer", key.layer);
  visit("filter", key.filter);
  visit("features", key.features);
}

/// Without the path.
template <typename Score, typename Visitor>
void visit_score(Score& score, const Visitor& visit) {
  visit("sequence", score.sequence);
  visit("frames", score.num_frames);
  visit("detected", score.is_detected);
  visit("reason", score.reason);
  visit("t_rel_percent", score.t_rel_percent);
  visit("r_rel_deg_per_100m", score.r_rel_deg_per_100m);
  visit("average_offset_m", score.average_offset_m);
  visit("E_t_m", score.translation_change_m);
  visit("E_r_deg", score.rotation_change_deg);
  visit("inliers", score.mean_inliers);
  visit("tracked", score.tracked_fraction);
  visit("early_error_percent", score.early_error_percent);
}

template <typename Rung, typename Visitor>
void visit_rung(Rung& rung, const Visitor& visit) {
  visit("frame_share", rung.frame_share);
  visit("filters", rung.num_filters);
}

template <typename Layer, typename Visitor>
void visit_layer(Layer& layer, const Visitor& visit) {
  visit("model", layer.model);
  visit("layer", layer.layer);
  visit("features", layer.features);
  visit("first", layer.first);
  visit("last", layer.last);
  visit("hash", layer.hash);
  visit("sampling_px", layer.sampling_px);
  visit("stem_model", layer.stem_model);
  visit("baseline", layer.is_baseline);
}

template <typename Sequence, typename Visitor>
void visit_sequence(Sequence& sequence, const Visitor& visit) {
  visit("name", sequence.name);
  visit("held_out", sequence.is_held_out);
  visit("first_frame", sequence.first_frame);
  visit("num_frames", sequence.num_frames);
  visit("frames", sequence.frames);
  visit("calibration", sequence.calibration);
  visit("ground_truth", sequence.ground_truth);
  visit("directory", sequence.directory);
}

/// An array with an object per element, written by `write(element, writer)`.
template <typename Elements, typename Write>
Json json_array(const Elements& elements, const Write& write) {
  Json array = Json::array();
  for (const auto& element : elements) {
    Json json;
    write(element, JsonWriter(json));
    array.push_back(std::move(json));
  }
  return array;
}

inline Json rungs_json(const Schedule& schedule) {
  return json_array(schedule, visit_rung<const Rung, JsonWriter>);
}

}  // namespace stemvo::search
