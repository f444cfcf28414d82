// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "search/schedule.hpp"
#include "stemvo/error.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo::search {

/// What the layer of gray and input_layer is called in tables.
inline constexpr const char* kInputLayer = "input";

/// Filters [first, last) of a layer, and what its response depends on.
struct LayerIdentity {
  std::string model;
  std::string layer;
  std::string features;
  int first = 0;
  int last = 0;
  std::string hash;  ///< of the model's file and the manifest's entry
  int sampling_px = 1;
  std::string stem_model;  ///< as stem.model takes it here; not compared
  bool is_baseline = false;
};

struct SequenceIdentity {
  std::string name;
  bool is_held_out = false;
  std::size_t first_frame = 0;
  std::size_t num_frames = 0;
  std::string frames;  ///< hashes, as those of benchmark::SequenceHashes; empty: not run here
  std::string calibration;
  std::string ground_truth;
  std::string directory;  ///< where it was found; not compared
};

/// The first line of records.jsonl: everything that the records depend on.
struct SearchIdentity {
  std::string program;        ///< hash
  std::string configuration;  ///< YAML of every key, without the model
  Schedule schedule;
  std::vector<LayerIdentity> layers;
  std::vector<SequenceIdentity> sequences;
  std::optional<std::size_t> only_sequence;  ///< a part that runs this one of them
};

/// With the baselines.
[[nodiscard]] std::size_t num_filters(const SearchIdentity& identity);
[[nodiscard]] std::size_t num_baselines(const SearchIdentity& identity);
/// The layer a row belongs to (checked).
[[nodiscard]] const LayerIdentity& layer_of(const SearchIdentity& identity, const FilterKey& key);

/// "the configuration (klt_levels: 3, now klt_levels: 4) and the frames of 00 changed"; empty where
/// nothing did. With `as_parts` other layers, models and filters are no change, nor are frames that
/// a part did not run.
[[nodiscard]] std::string describe_change(const SearchIdentity& before,
                                          const SearchIdentity& now,
                                          bool as_parts);

}  // namespace stemvo::search
