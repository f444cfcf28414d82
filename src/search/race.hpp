// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "search/records.hpp"
#include "stem/stem.hpp"

namespace stemvo::search {

/// A layer of the identity, loaded.
struct PlanLayer {
  Config config;  ///< of its odometry, with the model; the filter is the candidate's
  Stem stem;
  std::size_t max_in_flight = SIZE_MAX;  ///< filters that 1 GB holds, at least 1
};

/// Stem::frame_zoom of a layer on frames of this camera.
[[nodiscard]] inline int frame_zoom(const PlanLayer& layer, const Camera& camera) {
  const Config& config = layer.config;
  return layer.stem.frame_zoom(
      choose_tracking_resolution(config.stem.tracking_resolution, config.features.method, camera));
}

/// A path that holds in any folder.
[[nodiscard]] std::string from_anywhere(const std::filesystem::path& path);

struct Candidate {
  FilterKey key;
  std::size_t layer = 0;  ///< index
  /// No baseline, and can be run on all sequences that rank: what halving chooses from.
  bool races = false;
};

/// One sequence and what can be said of it before work starts.
struct PlanSequence {
  FrameSource sequence;
  bool is_held_out = false;
  std::vector<std::string> problems;  ///< per layer: why it cannot be run here; empty: it can
};

/// A search that was found to be possible.
struct SearchPlan {
  SearchIdentity identity;
  std::vector<PlanLayer> layers;        ///< as those of the identity
  std::vector<PlanSequence> sequences;  ///< those to run
  std::vector<Candidate> candidates;    ///< in the order of layers and filters, baselines last
  std::size_t block = 0;                ///< filters in flight; 0: as memory allows
};

/// Each directory as it is and under each disturbance asked for, and the held-out one.
[[nodiscard]] std::size_t num_sequences(const SearchRequest& request);

/// The sequences of a plan that has its layers, and how many filters fit into memory beside each
/// other. Errors: one that cannot be read, without ground truth, too short to rank by, or named
/// twice; held-out frames that rank.
[[nodiscard]] Status add_sequences(const SearchRequest& request, SearchPlan& plan);

/// Errors: those of run_search.
[[nodiscard]] Expected<SearchPlan> make_plan(const SearchRequest& request);

/// Estimated memory of a filter in flight: its channel of two frames and, per sequence, its
/// odometry. 256 filters of 620x188 take 1.7 to 2.1 MB each (1 and 2 threads), by this 2.0.
[[nodiscard]] std::size_t bytes_in_flight(cv::Size channel,
                                          cv::Size image,
                                          std::size_t num_sequences);

/// Candidates, in the order they are in, in blocks that run in lock-step: those of one layer, which
/// one pass of the stem serves, as many as max_in_flight allows or as the plan asks for.
[[nodiscard]] std::vector<std::vector<std::size_t>> cut_into_blocks(
    const SearchPlan& plan, const std::vector<std::size_t>& candidates);

/// Successive halving (Jamieson and Talwalkar, "Non-stochastic best arm identification and
/// hyperparameter optimization", AISTATS 2016): rungs at 1/16, 1/8, 1/4, 1/2 and all of the frames.
/// As many filters go on, at least 2, as a budget of 25 % of the exhaustive search's filter-frames
/// allows; of fewer than 16 half to 1/4, then a sixth and a twelfth: about the same budget.
[[nodiscard]] Schedule halving_schedule(std::size_t num_filters);
/// Filter-frames over those of the exhaustive search, where odometries go on from rung to rung.
[[nodiscard]] double cost_share(const Schedule& schedule);

/// Frames of a sequence that a rung runs up to: at least 2, at most all.
[[nodiscard]] std::size_t frames_at(const Rung& rung, std::size_t num_frames);

/// The order in which filters go on, by their records of one rung (indices): by the early errors,
/// near ties by inliers. Of the same numbers (R, G and B of a gray sequence) one stands there, the
/// others behind all.
[[nodiscard]] std::vector<std::size_t> best_first(std::span<const FilterRecord* const> records);

/// So many odometries, some 2 MB each, are kept from rung to rung; others start again.
inline constexpr std::size_t kMaxKept = 512;

/// Runs the rungs of a plan but for what is in the file, which grows as blocks end. What a filter
/// does depends neither on threads nor on who runs beside it. Returns warnings: frames that cannot
/// be read, or that a stem refuses. Error: the records cannot be written.
[[nodiscard]] Expected<std::vector<std::string>> run_race(const SearchPlan& plan,
                                                          const SearchProgress& progress,
                                                          RecordFile& file,
                                                          std::size_t max_kept = kMaxKept);

}  // namespace stemvo::search
