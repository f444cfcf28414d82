// SPDX-License-Identifier: MIT
#include "report/evaluate_report.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "report/metrics_keys.hpp"
#include "text/spared_inputs.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"

namespace stemvo {

namespace {

constexpr std::array<std::string_view, 4> kAlignments = {"none", "scale", "se3", "sim3"};

/// TUM rows have eight numbers, KITTI rows twelve; only TUM has comments.
bool looks_like_tum(const std::string& text) {
  for (const std::string_view line : split_lines(text)) {
    const std::vector<std::string_view> words = split_words(line);
    if (!words.empty()) {
      return words.front().starts_with('#') || words.size() == 8;
    }
  }
  return false;
}

Expected<Trajectory> read_poses(const std::filesystem::path& file) {
  const Expected<std::string> text = read_text_file(file);
  if (text && looks_like_tum(*text)) {
    Expected<TimedTrajectory> timed = read_tum_trajectory(file);
    if (!timed) {
      return timed.error();
    }
    return std::move(timed->world_from_camera);
  }
  return read_kitti_trajectory(file);
}

void add_row(TextTable& table, const EvaluationRow& row, Alignment alignment) {
  const Metrics& m = row.metrics;
  table.add({row.name, number_or_dash(m.t_rel_percent, 2), number_or_dash(m.r_rel_deg_per_100m, 3),
             fmt::format("{:.2f}", m.average_offset_m),
             fmt::format("{:.2f}", m.ate_rmse.after_m(alignment)),
             fmt::format("{:.4f}", m.rpe_rotation_deg)});
}

nlohmann::ordered_json row_json(const EvaluationRow& row) {
  nlohmann::ordered_json json;
  json["file"] = row.name;
  add_metrics(json, row.metrics);
  return json;
}

}  // namespace

Expected<EvaluationReport> evaluate_files(const EvaluationRequest& request) {
  if (request.json) {
    std::vector<std::filesystem::path> inputs = request.estimates;
    inputs.push_back(request.ground_truth);
    if (const Status status = check_spares_inputs({*request.json}, inputs); !status) {
      return status.error();
    }
  }
  const Expected<Trajectory> truth = read_poses(request.ground_truth);
  if (!truth) {
    return truth.error();
  }
  EvaluationReport report;
  report.ground_truth = request.ground_truth.string();
  report.num_poses = truth->size();
  report.alignment = request.alignment;
  for (const std::filesystem::path& file : request.estimates) {
    const Expected<Trajectory> estimate = read_poses(file);
    if (!estimate) {
      return estimate.error();
    }
    if (estimate->size() != truth->size()) {
      return fail(
          fmt::format("{}: expected {} poses as in {}, found {} (poses are compared line by "
                      "line, KITTI or TUM; nothing is matched by time)",
                      file.string(), truth->size(), report.ground_truth, estimate->size()));
    }
    report.rows.push_back({file.string(), evaluate_aligned(*estimate, *truth, request.alignment)});
  }
  // No alignment: a fit would move the whole heap of points into the middle of the drive.
  report.zero_motion = {"(zero motion)", evaluate(Trajectory(truth->size()), *truth)};
  return report;
}

std::string format_evaluation_table(const EvaluationReport& report) {
  const Metrics& zero_motion = report.zero_motion.metrics;
  TextTable table("lrrrrr");
  table.add({"estimate", "t_rel %", "r_rel deg/100 m", "offset m", "ATE m", "RPE deg"});
  table.rule();
  for (const EvaluationRow& row : report.rows) {
    add_row(table, row, report.alignment);
  }
  add_row(table, report.zero_motion, Alignment::kNone);
  const std::string segments =
      zero_motion.num_segments == 0
          ? "no segment fits into the drive: no t_rel and r_rel"
          : fmt::format("t_rel and r_rel: mean over {} segments of {}", zero_motion.num_segments,
                        length_range(zero_motion.segment_lengths_m));
  return fmt::format(
      "ground truth  {}, {} poses, {:.1f} m\nalignment     {} (the last row: none)\n\n{}\n{}\n"
      "offset: mean of |dx| + |dz|; ATE: root mean square position error; RPE: mean rotation error "
      "per frame\n",
      report.ground_truth, report.num_poses, zero_motion.path_length_m, to_string(report.alignment),
      table.str(), segments);
}

Status write_evaluation_json(const std::filesystem::path& file, const EvaluationReport& report) {
  nlohmann::ordered_json json;
  json["ground_truth"] = report.ground_truth;
  json["poses"] = report.num_poses;
  json["alignment"] = to_string(report.alignment);
  json["estimates"] = nlohmann::ordered_json::array();
  for (const EvaluationRow& row : report.rows) {
    json["estimates"].push_back(row_json(row));
  }
  json["never_moves"] = row_json(report.zero_motion);
  return write_text_file(file, to_text(json));
}

Expected<Alignment> parse_alignment(const std::string& text) {
  const auto* const found = std::find(kAlignments.begin(), kAlignments.end(), text);
  if (found == kAlignments.end()) {
    return fail(fmt::format("alignment: expected none, scale, se3 or sim3, found '{}'", text));
  }
  return static_cast<Alignment>(found - kAlignments.begin());
}

std::string_view to_string(Alignment alignment) {
  return kAlignments.at(static_cast<std::size_t>(alignment));
}

}  // namespace stemvo
