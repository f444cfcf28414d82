// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "search/records.hpp"
#include "search/search.hpp"
#include "stem/stem.hpp"

namespace stemvo::search {

/// A layer of the identity, loaded.
struct PlanLayer {
  Config config;  ///< of its odometry, with the model and layer; the filter is the candidate's
  Stem stem;
  std::size_t pass = 0;  ///< layers with the same one come from one pass over a frame
  std::size_t max_in_flight = SIZE_MAX;  ///< filters that 1 GB holds, at least 1
};

struct Candidate {
  FilterKey key;
  std::size_t layer = 0;  ///< index
  bool is_baseline = false;
  /// No baseline, and can be run on all sequences that rank: what halving chooses from.
  bool races = false;
};

/// One sequence and what can be said of it before work starts.
struct PlanSequence {
  KittiSequence sequence;
  bool is_held_out = false;
  std::vector<std::string> problems;  ///< per layer: why it cannot be run here; empty: it can
};

/// A search that was found to be possible.
struct SearchPlan {
  SearchIdentity identity;
  std::vector<PlanLayer> layers;        ///< as those of the identity
  std::vector<Candidate> candidates;    ///< in the order of layers and filters, baselines last
  std::vector<PlanSequence> sequences;  ///< those to run
  std::size_t block = 0;                ///< filters in flight; 0: as memory allows
};

/// Bytes of a filter in flight, by an estimate: its channel of this frame and of the next (floats),
/// and, once per sequence, its odometry: the image (8 bits) with its pyramid and derivatives, where
/// the channel is brought to another size a buffer of floats, and the path. 256 filters of 620x188
/// take 1.7 to 2.1 MB each (1 and 2 threads), by this 2.0.
[[nodiscard]] std::size_t bytes_in_flight(cv::Size channel,
                                          cv::Size image,
                                          std::size_t num_sequences);

/// Loads the model's layers, those asked for, and the baselines into the plan and its identity.
/// Errors: unknown model or layer (lists the known ones), filters outside, a file that is not that
/// of the manifest.
[[nodiscard]] Status add_layers(const SearchRequest& request, SearchPlan& plan);

/// Errors: those of run_search.
[[nodiscard]] Expected<SearchPlan> make_plan(const SearchRequest& request);

}  // namespace stemvo::search
