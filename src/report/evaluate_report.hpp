// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "dataset/frame_source.hpp"
#include "evaluation/metrics.hpp"
#include "evaluation/trajectory.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

struct EvaluationRequest {
  std::filesystem::path ground_truth;            ///< KITTI's, TUM's or EuRoC's format
  std::vector<std::filesystem::path> estimates;  ///< the same
  Alignment alignment = Alignment::kNone;
  double tolerance_s = kTimeTolerance_s;  ///< between a pose and its true one
  std::optional<std::filesystem::path> camera_file =
      std::nullopt;                                        ///< with EuRoC's: as read_truth says
  std::optional<FrameRangeRequest> frames = std::nullopt;  ///< of the ground truth's poses
};

struct EvaluationRow {
  std::string name;  ///< the path as given, or "(zero motion)"
  Metrics metrics;
  std::size_t num_poses = 0;                        ///< in the file
  std::size_t num_pairs = 0;                        ///< poses that were compared with a true one
  std::optional<std::string> doubt = std::nullopt;  ///< what other_convention says
};

struct EvaluationReport {
  std::string ground_truth;
  std::size_t num_poses = 0;
  Alignment alignment = Alignment::kNone;
  std::vector<EvaluationRow> rows;  ///< in the order asked for
  EvaluationRow zero_motion;        ///< the baseline that stays at the origin
};

/// Poses are matched by time where both files have times, else line by line. Both then start at the
/// identity. Errors: those of the readers; without times another number of poses than the ground
/// truth, or its `frames`; with times fewer than two pairs.
[[nodiscard]] Expected<EvaluationReport> evaluate_files(const EvaluationRequest& request);

[[nodiscard]] std::string format_evaluation_table(const EvaluationReport& report);
/// {ground_truth, poses, alignment, estimates: [{file, ..}], zero_motion: {..}}: keys of
/// metrics.json.
[[nodiscard]] nlohmann::ordered_json evaluation_document(const EvaluationReport& report);

/// `none`, `scale`, `se3`, `sim3`. Error: another word (lists the known ones).
[[nodiscard]] Expected<Alignment> parse_alignment(const std::string& text);
[[nodiscard]] std::string_view to_string(Alignment alignment);

}  // namespace stemvo
