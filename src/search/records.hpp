// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "search/search.hpp"

/// records.jsonl: the identity of a search in the first line, then a FilterRecord a line.
namespace stemvo::search {

/// What the layer of gray and input_layer is called in tables.
inline constexpr const char* kInputLayer = "input";
inline constexpr const char* kRecordsFile = "records.jsonl";

/// One rung of successive halving: so many filters run up to this share of the frames.
struct Rung {
  double frame_share = 1.0;
  std::size_t filters = 0;
  bool operator==(const Rung&) const = default;
};

/// The last rung has all frames; an exhaustive search has one: every filter over every frame.
using Schedule = std::vector<Rung>;

/// Filters [first, last) of a layer, and what its response depends on. Members of this and the
/// next two are called like their keys in the file.
struct LayerIdentity {
  std::string model;  ///< the manifest's name, not a path
  std::string layer;
  std::string features;
  int first = 0;
  int last = 0;
  std::string hash;  ///< of the model's file and the manifest's entry
  int sampling_px = 1;
  std::string stem_model;  ///< as stem.model takes it here; not compared
  bool baseline = false;

  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(last - first); }
  [[nodiscard]] FilterKey key(int filter) const { return {model, layer, features, filter}; }
  [[nodiscard]] bool is_layer_of(const FilterKey& key) const {
    return model == key.model && layer == key.layer && features == key.features;
  }
};

struct SequenceIdentity {
  std::string name;
  bool held_out = false;
  std::size_t first_frame = 0;
  std::size_t num_frames = 0;
  std::string frames;  ///< hashes, as pipeline::SequenceHashes; empty: not run here
  std::string calibration;
  std::string ground_truth;
  std::string directory;  ///< where it was found; not compared
};

/// Everything that the records depend on.
struct SearchIdentity {
  int stemvo_search = 3;      ///< the format
  std::string program;        ///< hash
  std::string configuration;  ///< YAML of every key, without the model
  Schedule rungs;             ///< of the filters; the baselines are outside
  std::vector<LayerIdentity> layers;
  std::vector<SequenceIdentity> sequences;   ///< the held-out one is the last
  std::optional<std::size_t> only_sequence;  ///< a part that runs this one of them

  [[nodiscard]] std::size_t num_filters() const;  ///< with the baselines
  [[nodiscard]] std::size_t num_baselines() const;
  /// The layer a row belongs to (checked).
  [[nodiscard]] const LayerIdentity& layer_of(const FilterKey& key) const;
};

/// The configuration of a filter's odometry, from that of all.
[[nodiscard]] Config config_of(Config common, const LayerIdentity& layer, int filter);

/// "the configuration (klt_levels: 3, now klt_levels: 4) and the frames of 00 changed"; empty where
/// nothing did. With `as_parts` other layers, models and filters are no change, nor are frames that
/// a part did not run.
[[nodiscard]] std::string describe_change(const SearchIdentity& before,
                                          const SearchIdentity& now,
                                          bool as_parts);

struct SearchRecords {
  SearchIdentity identity;
  std::vector<FilterRecord> records;
  std::size_t num_good_bytes = 0;  ///< up to the last whole line; a kill may tear the next
};

/// Reads all whole lines. Errors: not there, a whole line that is no record, another format.
[[nodiscard]] Expected<SearchRecords> read_records(const std::filesystem::path& file);

/// Appends records, so that what append() returned for is on the disk. One at a time: a second one
/// for the same file is an error.
class RecordWriter {
 public:
  /// Goes on behind the whole lines of a file; what a kill tore is cut off. With no good bytes a
  /// new file, with the identity in it. Error: there is one already, or it cannot be written.
  [[nodiscard]] static Expected<RecordWriter> open(const std::filesystem::path& file,
                                                   const SearchIdentity& identity,
                                                   std::size_t num_good_bytes = 0);
  [[nodiscard]] Status append(const std::vector<FilterRecord>& records);

 private:
  [[nodiscard]] Status write(const std::string& text);

  std::filesystem::path file_;
  std::shared_ptr<std::FILE> stream_;
};

/// A number of a DriveScore: its key in every file, its decimals in filters.csv.
struct ScoreNumber {
  const char* key;
  std::optional<double> DriveScore::* value;
  int decimals = 4;
};
inline constexpr std::array<ScoreNumber, 8> kScoreNumbers = {{
    {"t_rel_percent", &DriveScore::t_rel_percent},
    {"r_rel_deg_per_100m", &DriveScore::r_rel_deg_per_100m},
    {"average_offset_m", &DriveScore::average_offset_m},
    {"E_t_m", &DriveScore::translation_change_m},
    {"E_r_deg", &DriveScore::rotation_change_deg},
    {"inliers", &DriveScore::mean_inliers, 1},
    {"tracked", &DriveScore::tracked_fraction},
    {"early_error_percent", &DriveScore::early_error_percent},
}};

void to_json(nlohmann::ordered_json& json, const Rung& rung);

}  // namespace stemvo::search

namespace stemvo {
void to_json(nlohmann::ordered_json& json, const FilterKey& key);
void to_json(nlohmann::ordered_json& json, const DriveScore& score);
}  // namespace stemvo
