// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "config/config.hpp"
#include "dataset/sequence.hpp"
#include "evaluation/paired_ratio.hpp"
#include "stemvo/error.hpp"

namespace stemvo::robustness {

/// The row of the frames as they are.
inline constexpr const char* kUndisturbed = "none";

struct RobustnessRequest {
  std::vector<std::filesystem::path> sequence_dirs;  ///< with ground truth
  std::optional<FrameRangeRequest> frames;           ///< of each
  std::filesystem::path out_dir;
  std::filesystem::path models_dir;
  Config config;                      ///< of the channel that is judged
  std::vector<std::string> kinds;     ///< of disturbances, and `none`; empty: all
  std::vector<std::string> controls;  ///< what it is judged against; empty: all_controls()
  int num_threads = 0;                ///< 0: all cores
  /// Before a run, e.g. "12/804 03, gaussian_blur 2, gray"; false stops, here and after a frame.
  std::function<bool(const std::string& run)> on_run = {};
  std::function<bool(std::size_t, std::size_t)> on_frame = {};
};

/// gray, log, census: hand-made channels, all else alike; red, green, blue: the same where frames
/// are colour; orb, sift: the paper's pairs of frames on gray. A control may also be MODEL:FILTER,
/// another filter of a network.
[[nodiscard]] const std::vector<std::string>& all_controls();

/// One drive under one disturbance through one channel.
struct Outcome {
  std::optional<double> t_rel_percent;  ///< KITTI's, steps of the true length
  std::optional<double> r_rel_deg_per_100m;
  double tracked = 0.0;  ///< share of frames with a measured motion
  /// Frames without a measured motion after a disturbed one, the longest such stretch; null where
  /// no frame is undisturbed after a disturbed one.
  std::optional<std::size_t> recovery_frames;
  /// Rotations wrong by more than a degree from one frame to the next, while the state says
  /// tracked.
  std::size_t jumps = 0;
  /// Of segments of an eighth of the path, one from every frame on.
  std::vector<double> dense_t_percent;
  std::vector<double> dense_r_deg_per_100m;
  std::size_t block = 1;  ///< frames of such a segment
};

/// One disturbance at one strength.
struct Row {
  std::string disturbance;  ///< `none`: as the frames are
  double strength = 0.0;
  std::vector<std::vector<Outcome>> outcomes;  ///< per contender, per drive
};

/// The judged channel's errors over those of one control.
struct Verdict {
  ErrorRatio rotation;
  ErrorRatio translation;
};

struct RobustnessReport {
  std::vector<std::string> drives;
  std::vector<std::string> contenders;  ///< the judged channel first
  std::vector<Row> rows;
  std::vector<std::string> warnings;
  bool interrupted = false;  ///< rows are those that were finished
};

/// Runs all contenders on all drives under all disturbances, each frame's step having its true
/// length (unless the configuration says otherwise). OUT gets robustness.csv, .json, .txt and .png,
/// also when stopped. Errors: no ground truth, an unknown kind or control, whatever a run refuses.
[[nodiscard]] Expected<RobustnessReport> run_robustness(const RobustnessRequest& request);

/// Per control, over the drives of some rows (all: the geometric mean).
[[nodiscard]] std::vector<Verdict> verdicts(const RobustnessReport& report,
                                            const std::vector<const Row*>& rows);

/// r_rel in degrees per 100 m, the mean over drives; nullopt: one has no segment.
[[nodiscard]] std::optional<double> mean_rotation_error(const std::vector<Outcome>& outcomes);

/// For people: r_rel of each contender, and how many times as large the judged one's is.
[[nodiscard]] std::string format_table(const RobustnessReport& report);
/// A line per row, drive and contender.
[[nodiscard]] std::string format_csv(const RobustnessReport& report);
[[nodiscard]] std::string format_json(const RobustnessReport& report);
/// Error over strength, a panel per disturbance. CV_8UC3, RGB.
[[nodiscard]] cv::Mat draw_figure(const RobustnessReport& report);

}  // namespace stemvo::robustness
