// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "config/config.hpp"
#include "dataset/frame_source.hpp"
#include "evaluation/paired_ratio.hpp"
#include "robustness/outcome.hpp"
#include "stemvo/error.hpp"

namespace stemvo::robustness {

/// The row of the frames as they are, and its group.
inline constexpr const char* kUndisturbed = "none";

struct RobustnessRequest {
  std::vector<std::filesystem::path> sequence_dirs;  ///< with ground truth
  std::optional<FrameRangeRequest> frames;           ///< of each
  std::filesystem::path out_dir;
  Config config;                      ///< of the channel that is judged
  std::string command;                ///< that repeats it, for report.html; may be empty
  std::vector<std::string> kinds;     ///< of disturbances, and `none`; empty: all
  std::vector<std::string> controls;  ///< what it is judged against; empty: all_controls()
  int num_threads = 0;                ///< 0: all cores
  /// After each frame and each run: runs done, runs in all; false stops.
  std::function<bool(std::size_t, std::size_t)> progress = {};
};

/// The judged channel's errors over those of one control, drives together.
struct Verdict {
  ErrorRatio rotation;
  ErrorRatio translation;
};

/// One disturbance at one strength.
struct Row {
  std::string disturbance;
  std::string group;
  double strength = 0.0;
  std::vector<std::vector<Outcome>> outcomes;  ///< per contender, per drive
  std::vector<Verdict> verdicts;               ///< per control
};

struct RobustnessReport {
  std::vector<std::string> drives;
  std::vector<std::string> contenders;  ///< the judged channel first
  std::vector<Row> rows;                ///< that were finished
  std::vector<std::string> warnings;    ///< each once
  bool interrupted = false;
};

/// Runs all contenders on all drives under all disturbances, each frame's step having its true
/// length (unless the configuration says otherwise). OUT gets robustness.csv, .json, .txt and
/// report.html, written after every row. A run that is refused leaves its outcome empty, with a
/// warning. Errors: no ground truth, an unknown kind or control, whatever is refused before the
/// first run.
[[nodiscard]] Expected<RobustnessReport> run_robustness(const RobustnessRequest& request);

/// Rows of one group, or all (`group` "all"), judged against one control.
struct Summary {
  std::string group;
  std::size_t num_rows = 0;
  /// Geometric means over the rows that have an interval. None of their own: the rows are the same
  /// frames. nullopt: no row has one.
  std::optional<double> rotation_ratio;
  std::optional<double> translation_ratio;
  std::size_t num_for_judged = 0;  ///< rows whose rotation is decided
  std::size_t num_for_control = 0;
};
/// Groups in the order of the rows, then all. `control` counts from 0.
[[nodiscard]] std::vector<Summary> summaries(const std::vector<Row>& rows, std::size_t control);

/// The judged channel's r_rel over a control's on one drive, geometric mean over the rows that have
/// both; nullopt: none has. Drives disagree where a channel suits one kind of image.
[[nodiscard]] std::optional<double> ratio_on_drive(const std::vector<Row>& rows,
                                                   std::size_t control,
                                                   std::size_t drive);

/// r_rel in degrees per 100 m, the mean over drives; nullopt: one has no segment.
[[nodiscard]] std::optional<double> mean_rotation_error(const std::vector<Outcome>& outcomes);

/// For people: r_rel of each contender, and how many times as large the judged one's is.
[[nodiscard]] std::string format_table(const RobustnessReport& report);
/// A line per row, drive and contender.
[[nodiscard]] std::string format_csv(const RobustnessReport& report);
/// Content of robustness.json.
[[nodiscard]] nlohmann::ordered_json document(const RobustnessReport& report);
/// A page for a browser: ratios with their intervals, error over strength. Error: cannot be
/// written.
[[nodiscard]] Status write_page(const std::filesystem::path& file,
                                const RobustnessReport& report,
                                const RobustnessRequest& request);

}  // namespace stemvo::robustness
