// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "stemvo/error.hpp"

namespace stemvo::search {

/// The configuration a search starts from: a run's odometry made cheap (pairs of frames, fewer
/// points), steps of the true length. Ranks filters as the defaults of a run do (docs/search.md).
[[nodiscard]] Config search_defaults();

/// True: what takes long is to be left.
using IsStopped = std::function<bool()>;

/// Everything `stemvo search` was asked for.
struct SearchRequest {
  std::vector<std::filesystem::path> sequence_dirs;   ///< all of them rank the filters
  std::optional<std::filesystem::path> held_out_dir;  ///< reported, never ranked by
  /// Each that ranks also under these disturbances (robustness), at their middle strength.
  std::vector<std::string> kinds;
  std::optional<FrameRangeRequest> frames;           ///< of each sequence that ranks
  std::optional<FrameRangeRequest> held_out_frames;  ///< of the held-out one
  std::filesystem::path out_dir;
  std::vector<std::string> models = {"default"};  ///< as StemOptions::model; made by hand too
  std::optional<FrameRangeRequest> filters;       ///< of each model, half open; else all
  bool baselines = true;                          ///< rows of ORB on gray, and of R, G and B
  Config config = search_defaults();              ///< stem.model and .filter are not used
  bool exhaustive = false;                        ///< every filter over every frame; else halving
  /// Index of a sequence: as they are, then under each of `kinds`, the held-out one last. Runs it
  /// alone, as a part for merge_searches. Needs `exhaustive`; writes records.jsonl and no tables.
  std::optional<std::size_t> only_sequence;
  bool resume = false;  ///< go on from what out_dir holds
  /// Asked while records of before are read, which may take long; true: an interrupt.
  IsStopped is_stopped = {};
  int num_threads = 0;       ///< 0: all cores
  std::string command = {};  ///< that repeats the search, for report.html; may be empty
  /// Filters in flight, which a kill may lose; 0: a layer's, as far as 1 GB of odometries allows.
  int block = 0;
};

struct SearchReport {
  std::string text;  ///< for people: the table and the work it took, or what a part holds
  std::string json;  ///< what filters.json holds; of a part {"part": true, "filters": N}
  std::vector<std::string> warnings;
  bool interrupted = false;
};

/// Called after each frame of a block: filter-frames done, and in all as far as known; false stops.
using SearchProgress = std::function<bool(std::size_t, std::size_t)>;

/// Ranks the filters, in parallel. out_dir receives records.jsonl (appended as blocks of filters
/// end, what `resume` reads), filters.csv, filters.json, config.yaml (of all rows), best.yaml (what
/// repeats the first row), report.html and, where the frames can be read, sheet.png. Tables do not
/// depend on threads, blocks or interruptions. Errors, before work starts: unknown model
/// (lists the known ones), filters outside, no ground truth, a path too short for a segment,
/// out_dir holds another search, or with `resume` one of other inputs (says what changed).
[[nodiscard]] Expected<SearchReport> run_search(const SearchRequest& request,
                                                const SearchProgress& progress = {});

/// Joins parts of an exhaustive search (other filters, layers or models, or one sequence only; the
/// same sequences and configuration) into out_dir, whose filters.csv is that of one search over all
/// of them. Errors: a folder without records, parts that differ in more than filters, a filter with
/// two different results or none on a sequence. `is_stopped`: as SearchRequest has it.
[[nodiscard]] Expected<SearchReport> merge_searches(const std::vector<std::filesystem::path>& parts,
                                                    const std::filesystem::path& out_dir,
                                                    const std::string& command = {},
                                                    const IsStopped& is_stopped = {});

}  // namespace stemvo::search
