// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "search/block_runner.hpp"
#include "search/drive_score.hpp"
#include "search/plan.hpp"
#include "search/ranking.hpp"
#include "search/record_file.hpp"
#include "stemvo/search/search.hpp"

namespace stemvo::search {

/// Candidates whose odometries are kept from rung to rung, some 2 MB each: the best; should others
/// go on, they start again, which counts.
inline constexpr std::size_t kMostKept = 512;

/// Runs the rungs of a plan's schedule, in blocks of filters (blocks.hpp); each block's records are
/// appended as it ends. Records of an earlier call are not repeated.
class Race {
 public:
  /// The plan must outlive it.
  Race(const SearchPlan& plan,
       const SearchRequest& request,
       SearchProgress progress,
       RecordWriter writer,
       std::vector<Record> records,
       std::size_t most_kept = kMostKept);

  /// Error: the records cannot be written.
  [[nodiscard]] Status run();

  [[nodiscard]] const std::vector<Record>& records() const { return records_; }
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  /// A candidate's odometry on each sequence; none where it has not started, or cannot.
  using Drives = std::vector<std::optional<FilterDrive>>;
  using Block = std::vector<std::size_t>;  // indices of candidates

  [[nodiscard]] bool is_last(std::size_t rung) const;
  [[nodiscard]] std::size_t frames_planned() const;
  [[nodiscard]] const Record* find(std::size_t candidate, std::size_t rung) const;
  void add_record(Record record);
  void keep(std::size_t rung, const Block& block, std::vector<Drives> drives);
  [[nodiscard]] Block survivors(const Block& alive, std::size_t rung);
  Status run_rung(std::size_t rung, const Block& alive);
  [[nodiscard]] std::vector<Block> cut(const Block& group) const;
  [[nodiscard]] cv::Size picture_size(std::size_t layer, const PlanSequence& sequence) const;
  Status run_block_of(std::size_t rung, const Block& block);
  /// False: stopped before the last frame.
  bool run_sequence_of(std::size_t rung,
                       std::size_t sequence,
                       const Block& block,
                       std::vector<Drives>& drives,
                       std::vector<Record>& records);
  void add_score(const PlanSequence& planned,
                 const Candidate& candidate,
                 const std::optional<FilterDrive>& drive,
                 std::size_t num_frames,
                 Record& record) const;
  [[nodiscard]] FilterDrive make_drive(const Candidate& candidate, const Camera& camera) const;

  const SearchPlan& plan_;
  EvaluationOptions evaluation_;
  std::size_t block_size_;  ///< 0: by memory
  std::size_t most_kept_;
  SearchProgress progress_;
  RecordWriter writer_;
  std::vector<Record> records_;
  /// Per rung of records_, the first of each filter.
  std::map<int, std::map<FilterKey, std::size_t, KeyOrder>> record_of_;
  std::map<std::size_t, Drives> kept_;  ///< of candidates that may go on to the next rung
  std::vector<std::string> warnings_;
  std::size_t frames_done_ = 0;
  bool is_stopped_ = false;
};

}  // namespace stemvo::search
