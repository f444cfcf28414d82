// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "search/identity.hpp"
#include "stemvo/search/search.hpp"
#include "stemvo/stem/stem.hpp"

namespace stemvo::search {

/// Filters that share one pass of a stem, and the configuration of their odometry.
struct PlanLayer {
  std::string model;  ///< the manifest's name, not a path
  std::string layer;
  Config config;  ///< with the model and layer; the filter is the candidate's
  Stem stem;
  int first = 0;
  int last = 0;
  bool is_baseline = false;
  std::size_t pass = 0;  ///< layers with the same one come from one pass over a frame
};

struct Candidate {
  FilterKey key;
  std::size_t layer = 0;  ///< index of its PlanLayer
  bool is_baseline = false;
  /// No baseline, and can be run on all sequences that rank: what halving chooses from.
  bool races = false;
};

/// One sequence and what can be said of it before work starts.
struct PlanSequence {
  KittiSequence sequence;
  bool is_held_out = false;
  /// One per layer: why its filters cannot be run on frames of this size; empty: they can.
  std::vector<std::string> unusable;
  std::vector<cv::Size> channels;  ///< the size of each layer's; empty where that is not known
};

/// A search that was found to be possible.
struct SearchPlan {
  std::vector<PlanLayer> layers;
  std::vector<Candidate> candidates;    ///< in the order of layers and filters
  std::vector<PlanSequence> sequences;  ///< those to run
  SearchIdentity identity;

  [[nodiscard]] std::size_t num_frames(bool held_out) const;
};

/// Loads the model's layers, those asked for, and the baselines. Errors: unknown model or layer
/// (lists the known ones), filters outside, a file that is not that of the manifest.
[[nodiscard]] Expected<std::vector<PlanLayer>> plan_layers(const SearchRequest& request);

/// Errors: those of plan_layers and run_search.
[[nodiscard]] Expected<SearchPlan> make_plan(const SearchRequest& request);

}  // namespace stemvo::search
