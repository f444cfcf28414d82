// SPDX-License-Identifier: MIT
#include "stemvo/report/metrics_json.hpp"

#include <string_view>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "report/metrics_keys.hpp"
#include "report/optional_number.hpp"
#include "report/text_table.hpp"
#include "report/timing_json.hpp"
#include "stemvo/report/evaluate_report.hpp"
#include "text/text_file.hpp"

namespace stemvo {

namespace {

std::string number_or_dash(const std::optional<double>& value, int decimals) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : "-";
}

std::string scale_explained(const std::string& source) {
  if (source == "ground_truth") {
    return "ground_truth (each step rescaled to its true length)";
  }
  if (source == "constant") {
    return "constant (every step the same length: not metric)";
  }
  if (source == "none") {
    return "none (up to scale: units, not metres)";
  }
  return source;
}

nlohmann::ordered_json refined_json(const Metrics& metrics) {
  nlohmann::ordered_json json;
  json["average_offset_m"] = metrics.average_offset_m;
  json["t_rel_percent"] = number_or_null(metrics.t_rel_percent);
  json["r_rel_deg_per_100m"] = number_or_null(metrics.r_rel_deg_per_100m);
  json["rpe_rotation_deg"] = metrics.rpe_rotation_deg;
  return json;
}

std::string head(const MetricsReport& report) {
  TextTable table("ll");
  const std::size_t end = report.first_frame + report.num_frames;
  table.add({"sequence", fmt::format("{}, {} frames ({}:{})", report.sequence, report.num_frames,
                                     report.first_frame, end)});
  table.add({"model", fmt::format("{}, filter {}", report.model, report.filter)});
  table.add({"scale", scale_explained(report.scale_source)});
  table.add({"speed", fmt::format("{:.1f} frames/s", report.fps)});
  table.add({"tracked", fmt::format("{:.1f} % of the frames have a measured pose",
                                    100.0 * report.tracked_fraction)});
  if (report.road_measured_fraction) {
    table.add({"road", fmt::format("measured on {:.1f} % of the frames",
                                   100.0 * *report.road_measured_fraction)});
  }
  if (report.metrics) {
    table.add({"path", fmt::format("{:.1f} m (ground truth)", report.metrics->path_length_m)});
  }
  return table.str();
}

std::string error_table(const MetricsReport& report) {
  const Metrics& m = *report.metrics;
  const std::string segments = m.num_segments == 0 ? "no segment fits into the drive"
                                                   : fmt::format("mean over {} segments of {}",
                                                                 m.num_segments, length_range(m));
  const std::string fitted(to_string(m.alignment));
  TextTable table("lrlll");
  table.add({"error", "value", "unit", "alignment", ""});
  table.rule();
  table.add({"translation t_rel", number_or_dash(m.t_rel_percent, 2), "%", fitted, segments});
  if (report.refined) {
    table.add({"  with look-ahead", number_or_dash(report.refined->t_rel_percent, 2), "%",
               std::string(to_string(report.refined->alignment)), "trajectory_refined_kitti.txt"});
  }
  table.add({"rotation r_rel", number_or_dash(m.r_rel_deg_per_100m, 3), "deg/100 m", fitted,
             "the same segments"});
  table.add({"average offset", fmt::format("{:.2f}", m.average_offset_m), "m", fitted,
             "mean of |dx| + |dz|"});
  table.add({"  if it never moved", fmt::format("{:.2f}", m.null_offset_m), "m", "none",
             "the same for a camera that stays at the start"});
  const std::pair<std::string_view, double> ates[] = {{"none", m.ate_rmse.none_m},
                                                      {"scale", m.ate_rmse.scale_m},
                                                      {"se3", m.ate_rmse.se3_m},
                                                      {"sim3", m.ate_rmse.sim3_m}};
  for (const auto& [alignment, rmse_m] : ates) {
    const std::string_view note = alignment == "none"    ? "root mean square position error"
                                  : alignment == "scale" ? "one scale fitted"
                                  : alignment == "se3"   ? "rotation and shift fitted"
                                                         : "rotation, shift and scale fitted";
    table.add({"position ATE", fmt::format("{:.2f}", rmse_m), "m", std::string(alignment),
               std::string(note)});
  }
  table.add({"rotation per frame", fmt::format("{:.4f}", m.rpe_rotation_deg), "deg", fitted,
             "mean over steps of one frame (RPE)"});
  return table.str();
}

}  // namespace

void add_metrics(nlohmann::ordered_json& json, const Metrics* metrics) {
  static const Metrics kNoMetrics;
  const Metrics& m = metrics != nullptr ? *metrics : kNoMetrics;
  nlohmann::ordered_json values;
  values["path_length_m"] = m.path_length_m;
  values["average_offset_m"] = m.average_offset_m;
  values["null_offset_m"] = m.null_offset_m;
  values["t_rel_percent"] = number_or_null(m.t_rel_percent);
  values["r_rel_deg_per_100m"] = number_or_null(m.r_rel_deg_per_100m);
  values["segment_lengths_m"] = m.segment_lengths_m;
  values["segments"] = m.num_segments;
  values["ate_rmse_m"]["none"] = m.ate_rmse.none_m;
  values["ate_rmse_m"]["scale"] = m.ate_rmse.scale_m;
  values["ate_rmse_m"]["se3"] = m.ate_rmse.se3_m;
  values["ate_rmse_m"]["sim3"] = m.ate_rmse.sim3_m;
  values["rpe_rotation_deg"] = m.rpe_rotation_deg;
  for (const auto& [key, value] : values.items()) {
    json[key] = metrics != nullptr ? value : nlohmann::ordered_json();
  }
}

std::string to_text(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + '\n';
}

std::string length_range(const Metrics& metrics) {
  const std::vector<double>& lengths = metrics.segment_lengths_m;
  return lengths.size() == 1 ? fmt::format("{:g} m", lengths.front())
                             : fmt::format("{:g}..{:g} m", lengths.front(), lengths.back());
}

Status write_metrics_json(const std::filesystem::path& file, const MetricsReport& report) {
  nlohmann::ordered_json json;
  json["stemvo_version"] = report.stemvo_version;
  json["sequence"] = report.sequence;
  json["first_frame"] = report.first_frame;
  json["frames"] = report.num_frames;
  json["model"] = report.model;
  json["filter"] = report.filter;
  json["fps"] = report.fps;
  json["scale_source"] = report.scale_source;
  json["tracked_fraction"] = report.tracked_fraction;
  json["road_measured_fraction"] = number_or_null(report.road_measured_fraction);
  json["alignment"] = report.metrics ? nlohmann::ordered_json(to_string(report.metrics->alignment))
                                     : nlohmann::ordered_json();
  add_metrics(json, report.metrics ? &*report.metrics : nullptr);
  json["refined"] = report.refined ? refined_json(*report.refined) : nlohmann::ordered_json();
  if (report.timing) {
    json["timing"] = timing_json(*report.timing);
  }
  return write_text_file(file, to_text(json));
}

std::string format_metrics_table(const MetricsReport& report) {
  if (!report.metrics) {
    return head(report) + "\nNo ground truth: the errors are not known.\n";
  }
  return head(report) + '\n' + error_table(report);
}

}  // namespace stemvo
