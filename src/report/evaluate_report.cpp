// SPDX-License-Identifier: MIT
#include "stemvo/report/evaluate_report.hpp"

#include <array>
#include <utility>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "report/metrics_keys.hpp"
#include "report/text_table.hpp"
#include "text/text_file.hpp"

namespace stemvo {

namespace {

constexpr std::array<std::pair<Alignment, std::string_view>, 4> kAlignments{
    {{Alignment::kNone, "none"},
     {Alignment::kScale, "scale"},
     {Alignment::kSe3, "se3"},
     {Alignment::kSim3, "sim3"}}};

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

double ate_of(const Metrics& metrics, Alignment alignment) {
  switch (alignment) {
    case Alignment::kNone:
      return metrics.ate_rmse.none_m;
    case Alignment::kScale:
      return metrics.ate_rmse.scale_m;
    case Alignment::kSe3:
      return metrics.ate_rmse.se3_m;
    case Alignment::kSim3:
      return metrics.ate_rmse.sim3_m;
  }
  return metrics.ate_rmse.none_m;
}

std::string number_or_dash(const std::optional<double>& value, int decimals) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : "-";
}

void add_row(TextTable& table, const EvaluationRow& row, Alignment alignment) {
  const Metrics& m = row.metrics;
  table.add({row.name, number_or_dash(m.t_rel_percent, 2), number_or_dash(m.r_rel_deg_per_100m, 3),
             fmt::format("{:.2f}", m.average_offset_m), fmt::format("{:.2f}", ate_of(m, alignment)),
             fmt::format("{:.4f}", m.rpe_rotation_deg)});
}

nlohmann::ordered_json row_json(const EvaluationRow& row) {
  nlohmann::ordered_json json;
  json["file"] = row.name;
  add_metrics(json, &row.metrics);
  return json;
}

}  // namespace

Expected<EvaluationReport> evaluate_files(const EvaluationRequest& request) {
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
    report.rows.push_back(
        {file.string(), evaluate_aligned(*estimate, *truth, request.alignment, request.options)});
  }
  // No alignment: a fit would move the whole heap of points into the middle of the drive.
  report.never_moves = {"(never moves)",
                        evaluate(Trajectory(truth->size()), *truth, request.options)};
  return report;
}

std::string format_evaluation_table(const EvaluationReport& report) {
  const Metrics& null_metrics = report.never_moves.metrics;
  TextTable table("lrrrrr");
  table.add({"estimate", "t_rel %", "r_rel deg/100 m", "offset m", "ATE m", "RPE deg"});
  table.rule();
  for (const EvaluationRow& row : report.rows) {
    add_row(table, row, report.alignment);
  }
  add_row(table, report.never_moves, Alignment::kNone);
  const std::string segments =
      null_metrics.num_segments == 0
          ? "no segment fits into the drive: no t_rel and r_rel"
          : fmt::format("t_rel and r_rel: mean over {} segments of {}", null_metrics.num_segments,
                        length_range(null_metrics));
  return fmt::format(
      "ground truth  {}, {} poses, {:.1f} m\nalignment     {} (the last row: none)\n\n{}\n{}\n"
      "offset: mean of |dx| + |dz|; ATE: root mean square position error; RPE: mean rotation error "
      "per frame\n",
      report.ground_truth, report.num_poses, null_metrics.path_length_m,
      to_string(report.alignment), table.str(), segments);
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
  json["never_moves"] = row_json(report.never_moves);
  return write_text_file(file, to_text(json));
}

Expected<Alignment> parse_alignment(const std::string& text) {
  for (const auto& [alignment, name] : kAlignments) {
    if (name == text) {
      return alignment;
    }
  }
  return fail(fmt::format("alignment: expected none, scale, se3 or sim3, found '{}'", text));
}

std::string_view to_string(Alignment alignment) {
  for (const auto& [known, name] : kAlignments) {
    if (known == alignment) {
      return name;
    }
  }
  return "unknown";
}

}  // namespace stemvo
