// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/config.hpp"
#include "dataset/sequence.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// The configuration a search starts from: the same odometry as a run's, made cheap (pairs of
/// frames on images of the channel's own size, fewer points), steps of the true length. Ranks
/// filters as the defaults of a run do (docs/search.md).
[[nodiscard]] Config search_defaults();

/// Everything `stemvo search` was asked for.
struct SearchRequest {
  std::vector<std::filesystem::path> sequence_dirs;   ///< ranked by the mean over them
  std::optional<std::filesystem::path> held_out_dir;  ///< reported, never ranked by
  std::optional<FrameRangeRequest> frames;            ///< of each sequence that ranks
  std::optional<FrameRangeRequest> held_out_frames;   ///< of the held-out one
  std::filesystem::path out_dir;
  std::filesystem::path models_dir;
  std::string model = "default";             ///< as StemOptions::model; gray and input_layer too
  std::vector<std::string> layers;           ///< of the model; empty: all it has
  std::optional<FrameRangeRequest> filters;  ///< of each layer, half open; else all
  bool baselines = true;                     ///< rows of ORB on gray, and of R, G and B
  Config config = search_defaults();         ///< stem.model, .layer and .filter are not used
  bool exhaustive = false;                   ///< every filter over every frame; else halving
  /// Runs one sequence only, a part for merge_searches: index in sequence_dirs, the held-out one is
  /// behind them. Needs `exhaustive`; writes records.jsonl and no tables.
  std::optional<std::size_t> only_sequence;
  bool resume = false;  ///< go on from what out_dir holds
  int num_threads = 0;  ///< 0: all cores
  /// Filters in flight, which is what a kill may lose; 0: those of a whole layer, so that one pass
  /// of the stem serves them all, as far as some 1 GB of channels and odometries allows.
  int block = 0;
};

/// A filter of a layer of a model, and what finds matches on its channel. Ordered as rows are where
/// numbers do not decide.
struct FilterKey {
  std::string model;
  std::string layer;     ///< `input` for the input layer and gray
  std::string features;  ///< `klt`, `orb`, `sift`
  int filter = 0;
  auto operator<=>(const FilterKey&) const = default;
};
/// "efficientnetv2-b0 stem 12", with the features where they are not `klt`.
[[nodiscard]] std::string to_string(const FilterKey& key);

/// A filter's odometry over one sequence, as far as it ran, with the true length of each step.
struct DriveScore {
  std::string sequence;
  std::size_t num_frames = 0;
  bool is_detected = false;
  std::string reason;  ///< why the pose was not detected, else empty
  // nullopt: no motion was measured, so that there is no trajectory of its own, or no frame ran.
  std::optional<double> t_rel_percent;  ///< nullopt too: no segment fits into the frames run
  std::optional<double> r_rel_deg_per_100m;
  std::optional<double> average_offset_m;
  std::optional<double> translation_change_m;  ///< paper, Table 2: E_t, mean over consecutive poses
  std::optional<double> rotation_change_deg;   ///< E_r, with R_p transposed
  std::optional<double> early_error_percent;   ///< t_rel of parts of the path: what halving goes by
  // nullopt: no frame ran.
  std::optional<double> mean_inliers;
  std::optional<double> tracked_fraction;  ///< of the frames after the first: motion measured
  /// x and z, metres: at most 400 points, evenly spaced in frames.
  std::vector<std::array<double, 2>> path;
  bool operator==(const DriveScore&) const = default;
};

/// What a filter did on one rung.
struct FilterRecord {
  FilterKey key;
  std::size_t rung = 0;
  std::vector<DriveScore> drives;      ///< one per sequence that ranks
  std::optional<DriveScore> held_out;  ///< of filters that ran over all frames
  std::size_t filter_frames = 0;       ///< that this took, with what a kill made it repeat
  std::size_t held_out_filter_frames = 0;
};

/// What became of a filter.
enum class FilterStatus {
  kRanked,       ///< ran over all frames, has a t_rel
  kStopped,      ///< halving: others were better on the frames it ran
  kNotDetected,  ///< the paper's "pose not detected"
};
[[nodiscard]] std::string_view to_string(FilterStatus status);

/// A filter's record of the last rung it ran.
struct FilterRow : FilterRecord {
  FilterStatus status = FilterStatus::kRanked;
  /// Over the sequences that rank; nullopt where one of them has none, `num_frames` is the sum, the
  /// reason that of the first sequence whose pose was not detected.
  DriveScore mean;
};

/// What a search costs: frames times filters, and what was run again after a kill.
struct SearchWork {
  std::size_t filter_frames = 0;             ///< of the filters, on the sequences that rank
  std::size_t baseline_filter_frames = 0;    ///< of the baselines, which always run to the end
  std::size_t held_out_filter_frames = 0;    ///< of both
  std::size_t exhaustive_filter_frames = 0;  ///< of all filters that can run, on all frames
};

struct SearchReport {
  std::vector<FilterRow> rows;  ///< by rank; none of a part (only_sequence)
  std::size_t num_filters = 0;  ///< asked for; more than rows where it was interrupted
  SearchWork work;
  std::vector<std::string> warnings;
  bool interrupted = false;
  bool is_part = false;  ///< of SearchRequest::only_sequence
};

/// Called after each frame of a block: filter-frames done, and in all as far as known; false stops.
using SearchProgress = std::function<bool(std::size_t, std::size_t)>;

/// Ranks the filters. Each has an odometry of its own; one pass of the stem serves all filters of a
/// layer; filters run in parallel. out_dir receives records.jsonl (appended as blocks of filters
/// end, what `resume` reads), filters.csv, filters.json, config.yaml, best.yaml and, where the
/// frames can be read, sheet.png and trajectories.png. The tables do not depend on threads, blocks
/// or interruptions. Errors, before work starts: unknown model or layer (lists the known ones),
/// filters outside, no ground truth, a path too short for a segment, out_dir holds another search,
/// or with `resume` one of another model, sequence or configuration (says what changed).
[[nodiscard]] Expected<SearchReport> run_search(const SearchRequest& request,
                                                const SearchProgress& progress = {});

/// Joins parts of an exhaustive search (other filters, layers or models, or one sequence only; the
/// same sequences and configuration) into out_dir, whose filters.csv is that of one search over all
/// of them. Errors: a folder without records, parts that differ in more than filters, a filter with
/// two different results or none on a sequence.
[[nodiscard]] Expected<SearchReport> merge_searches(const std::vector<std::filesystem::path>& parts,
                                                    const std::filesystem::path& out_dir,
                                                    const std::filesystem::path& models_dir);

/// The ranked table for people.
[[nodiscard]] std::string format_search_table(const SearchReport& report);

}  // namespace stemvo
