// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>
#include <opencv2/core.hpp>

#include "evaluation/paired_ratio.hpp"
#include "evaluation/trajectory.hpp"
#include "html/page.hpp"
#include "search/search.hpp"

/// records.jsonl: the identity of a search in the first line, then a FilterRecord a line, each
/// under a hash of it and of the first line: a line that was changed, or is another search's, is
/// none. Members of what is in it are called like their keys.
namespace stemvo::search {

inline constexpr const char* kRecordsFile = "records.jsonl";
/// Most that the file (24,000 drives of a KITTI sequence and more) and one line of it may hold.
inline constexpr int kMaxRecords_MB = 512;
inline constexpr std::size_t kMaxRecordBytes = 8000000;

/// A filter of a layer of a model, and what finds matches on its channel. Ordered as rows are where
/// numbers do not decide.
struct FilterKey {
  std::string model;
  std::string layer;     ///< `input` for the input layer and gray
  std::string features;  ///< `patch`, `klt`, `orb`, `sift`
  int filter = 0;
  auto operator<=>(const FilterKey&) const = default;
};
/// "efficientnetv2-b0 stem 12", with the features where they are not `patch`.
[[nodiscard]] std::string to_string(const FilterKey& key);

/// A filter's odometry over one sequence, as far as it ran, with the true length of each step.
struct DriveScore {
  static constexpr double kMinTracked = 0.5;  ///< less: the pose was not detected
  std::string sequence;
  std::size_t frames = 0;
  bool detected = false;
  std::string reason;  ///< why the pose was not detected, else empty
  // nullopt: no motion was measured, so that there is no trajectory of its own, or no frame ran.
  std::optional<double> t_rel_percent;  ///< nullopt too: no segment fits into the frames run
  std::optional<double> r_rel_deg_per_100m;
  std::optional<double> average_offset_m;
  std::optional<double> E_t_m;                ///< paper, Table 2: mean over consecutive poses
  std::optional<double> E_r_deg;              ///< with R_p transposed
  std::optional<double> early_error_percent;  ///< t_rel of parts of the path: what halving goes by
  // nullopt: no frame ran.
  std::optional<double> inliers;  ///< mean
  std::optional<double> tracked;  ///< share of the frames after the first: motion measured
  /// t_rel of segments of an eighth of the path, at most 400, evenly spaced: what filters that ran
  /// over all frames are told apart by. So many neighbours (`block`) overlap.
  std::vector<double> dense_t_percent;
  std::size_t block = 1;
  /// Metres: at most 400 points, evenly spaced in frames.
  std::vector<std::array<double, 2>> path_xz_m;
  bool operator==(const DriveScore&) const = default;
};

/// A filter's result on one rung.
struct FilterRecord {
  std::size_t rung = 0;
  FilterKey key;
  std::vector<DriveScore> drives;      ///< one per sequence that ranks
  std::optional<DriveScore> held_out;  ///< of filters that ran over all frames
  std::size_t filter_frames = 0;       ///< that this took, with what a kill made it repeat
  std::size_t held_out_filter_frames = 0;

  void add(const DriveScore& score, bool is_held_out, std::size_t num_frames);
  bool operator<(const FilterRecord& other) const {
    return std::tie(rung, key) < std::tie(other.rung, other.key);
  }
};
using FilterRecords = std::set<FilterRecord>;  ///< by rung and filter

/// One rung of successive halving: so many filters run up to this share of the frames.
struct Rung {
  double frame_share = 1.0;
  std::size_t filters = 0;
};

/// The last rung has all frames; an exhaustive search has one: every filter over every frame.
using Schedule = std::vector<Rung>;

/// Filters [first, last) of a layer, and what its response depends on.
struct LayerIdentity {
  std::string model = {};  ///< its name, or that of its file
  std::string layer = {};
  std::string features = {};
  int first = 0;
  int last = 0;
  std::string hash = {};  ///< of the model's file
  int sampling_px = 1;
  std::string stem_model = {};  ///< as stem.model takes it here; not compared
  bool baseline = false;

  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(last - first); }
  [[nodiscard]] FilterKey key(int filter) const { return {model, layer, features, filter}; }
  [[nodiscard]] bool is_layer_of(const FilterKey& one) const {
    return one.model == model && one.layer == layer && one.features == features;
  }
};

struct SequenceIdentity {
  std::string name;
  bool held_out = false;
  std::string disturbance = {};  ///< "_dusk_0.03", the end of the name; empty: as the frames are
  std::size_t first_frame = 0;
  std::size_t num_frames = 0;
  std::string frames;  ///< hashes, as SequenceHashes; empty: not run here
  std::string calibration;
  std::string ground_truth;
  std::string directory;  ///< where it was found; not compared

  [[nodiscard]] std::size_t end_frame() const { return first_frame + num_frames; }
};

/// Everything that the records depend on.
struct SearchIdentity {
  std::string program;        ///< hash
  std::string configuration;  ///< YAML of every key, without the model
  Schedule rungs;             ///< of the filters; the baselines are outside
  std::vector<LayerIdentity> layers;
  std::vector<SequenceIdentity> sequences;   ///< the held-out one is the last
  std::optional<std::size_t> only_sequence;  ///< a part that runs this one of them

  /// Filters, or baselines.
  [[nodiscard]] std::size_t count(bool baselines) const;
  [[nodiscard]] std::size_t num_rows() const { return count(false) + count(true); }
  /// The sequence's name without its disturbance; empty: none of that name.
  [[nodiscard]] std::string road_of(const std::string& sequence) const;
  /// The layer a row belongs to (checked).
  [[nodiscard]] const LayerIdentity& layer_of(const FilterKey& key) const;
  /// "the configuration (klt_levels: 3, now klt_levels: 4) and the frames of 00 changed"; empty
  /// where nothing did. With `as_parts` other layers, models and filters are no change, nor are
  /// frames that a part did not run.
  [[nodiscard]] std::string change_to(const SearchIdentity& now, bool as_parts) const;
};

/// The configuration of a filter's odometry, from that of all.
[[nodiscard]] Config config_of(Config common, const LayerIdentity& layer, int filter);

struct SearchRecords {
  SearchIdentity identity;
  std::string first_line;  ///< the identity's text
  FilterRecords records;
  std::size_t num_good_bytes = 0;     ///< up to the last whole line; a kill may tear the next
  std::vector<std::string> warnings;  ///< lines that are no record of the search, and left out
};

/// Reads all whole lines. Errors: not there, the first line is no identity of this version, more
/// than a thousand others are no records, stopped.
[[nodiscard]] Expected<SearchRecords> read_records(const std::filesystem::path& file,
                                                   const IsStopped& is_stopped = {});

/// Records that grow, on the disk when append() returns. A second writer of a file is an error.
class RecordFile {
 public:
  /// A new file or, with `resume`, one of the same search, if there is one; what a kill tore is cut
  /// off. Errors: it is there, or is of another search (says what changed), or those of
  /// read_records.
  [[nodiscard]] static Expected<RecordFile> open(const std::filesystem::path& file,
                                                 const SearchIdentity& identity,
                                                 bool resume,
                                                 const IsStopped& is_stopped = {});
  /// Error: they cannot be written, or would make it larger than what is read again.
  [[nodiscard]] Status append(const std::vector<FilterRecord>& records);
  [[nodiscard]] const FilterRecords& records() const { return records_; }
  /// Warnings about its content when it was opened.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  [[nodiscard]] Status write(const std::string& text);

  std::filesystem::path file_;
  std::shared_ptr<std::FILE> stream_;
  std::string first_line_;
  FilterRecords records_;
  std::vector<std::string> warnings_;
};

/// Ran over all frames, so that it has a t_rel; was stopped by halving, others being better on the
/// frames it ran; the paper's "pose not detected".
enum class FilterStatus { kRanked, kStopped, kNotDetected };

/// A filter's record of the last rung it ran.
struct FilterRow : FilterRecord {
  FilterStatus status = FilterStatus::kRanked;
  DriveScore mean;  ///< of the drives
  // Set in ranked rows only:
  ErrorRatio over_best;   ///< dense errors over those of the row that has the lowest, drives'
                          ///< geometric mean
  bool is_equal = false;  ///< the interval does not say that it is worse
};

/// Over the sequences that rank; nullopt where one of them has none, `frames` is the sum, the
/// reason that of the first sequence whose pose was not detected.
[[nodiscard]] DriveScore mean_score(const std::vector<DriveScore>& drives);

/// Compares unfinished filters: early errors, near ties by inliers.
[[nodiscard]] double early_error(const DriveScore& mean);

/// One row per filter from its last rung: those that cannot be told from the best, by
/// over_best; the others by t_rel, ties by r_rel; then those that were stopped, the later the
/// better; not detected last.
[[nodiscard]] std::vector<FilterRow> rank_filters(const SearchIdentity& identity,
                                                  const FilterRecords& records);

/// False: the path is too short for any.
[[nodiscard]] bool has_intervals(const std::vector<FilterRow>& rows);

/// filters.csv: a header, then the rows by rank; `model,layer,filter` first, no times. Columns per
/// sequence where there are several, and of the held-out one.
[[nodiscard]] std::string format_csv(const SearchIdentity& identity,
                                     const std::vector<FilterRow>& rows);

/// Everything written to a folder, where named models are found, and the command that repeats the
/// search, which may be empty.
struct ResultsTarget {
  std::filesystem::path out_dir;
  std::string command = {};
};

/// Ranks the records and writes the files of run_search, of which filters.json says what was
/// searched, how, and the work it took; without sheet.png, with a warning, where frames or models
/// are not where they were. Where records are missing the search was interrupted. Of a part with
/// one sequence nothing is written.
[[nodiscard]] Expected<SearchReport> write_results(const SearchIdentity& identity,
                                                   const FilterRecords& records,
                                                   const ResultsTarget& target);

/// Best, median and worst of the filters whose pose was detected, those that halving stopped behind
/// the others, the later the better; the same filter once. Then the baselines, by rank.
using ShownFilters = std::vector<std::pair<std::string_view, const FilterRow*>>;
[[nodiscard]] ShownFilters choose_rows(const SearchIdentity& identity,
                                       const std::vector<FilterRow>& rows);

struct Results {
  ResultsTarget target;
  SearchIdentity identity;
  Config config;  ///< of all rows
  std::vector<FilterRow> rows;
};
/// Pictures of a search's first sequence for its results.
struct Pictures {
  cv::Mat sheet;  ///< RGB; empty: nothing was found. The input and the channels of choose_rows
  std::vector<html::CaptionedImage> channels;  ///< those of the sheet
  std::optional<Trajectory> ground_truth;
};
/// Error: the sequence or a model is not where it was.
[[nodiscard]] Expected<Pictures> draw_pictures(const Results& results);

/// report.html; `table`: as the program prints it. Error: it cannot be written.
[[nodiscard]] Status write_page(const Results& results,
                                const Pictures& pictures,
                                const std::string& table);

void to_json(nlohmann::ordered_json& json, const FilterKey& key);
void to_json(nlohmann::ordered_json& json, const DriveScore& score);
void to_json(nlohmann::ordered_json& json, const Rung& rung);

}  // namespace stemvo::search
