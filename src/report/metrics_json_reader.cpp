// SPDX-License-Identifier: MIT
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "report/optional_number.hpp"
#include "stemvo/report/evaluate_report.hpp"
#include "stemvo/report/metrics_json.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

std::optional<double> number_at(const nlohmann::json& json, const char* key) {
  return optional_number(json.at(key));
}

double finite_or_nan(const nlohmann::json& json, const char* key) {
  return number_at(json, key).value_or(std::numeric_limits<double>::quiet_NaN());
}

/// The four numbers that are kept of a refined trajectory.
void read_errors(const nlohmann::json& json, Metrics& metrics) {
  metrics.average_offset_m = finite_or_nan(json, "average_offset_m");
  metrics.t_rel_percent = number_at(json, "t_rel_percent");
  metrics.r_rel_deg_per_100m = number_at(json, "r_rel_deg_per_100m");
  metrics.rpe_rotation_deg = finite_or_nan(json, "rpe_rotation_deg");
}

Metrics metrics_of(const nlohmann::json& json) {
  Metrics metrics;
  read_errors(json, metrics);
  if (const auto alignment = parse_alignment(json.at("alignment").get<std::string>())) {
    metrics.alignment = *alignment;
  }
  metrics.path_length_m = finite_or_nan(json, "path_length_m");
  metrics.null_offset_m = finite_or_nan(json, "null_offset_m");
  metrics.segment_lengths_m = json.at("segment_lengths_m").get<std::vector<double>>();
  metrics.num_segments = json.at("segments").get<int>();
  const nlohmann::json& ate = json.at("ate_rmse_m");
  metrics.ate_rmse = {finite_or_nan(ate, "none"), finite_or_nan(ate, "scale"),
                      finite_or_nan(ate, "se3"), finite_or_nan(ate, "sim3")};
  return metrics;
}

MetricsReport report_of(const nlohmann::json& json) {
  MetricsReport report;
  report.stemvo_version = json.at("stemvo_version").get<std::string>();
  report.sequence = json.at("sequence").get<std::string>();
  report.first_frame = json.at("first_frame").get<std::size_t>();
  report.num_frames = json.at("frames").get<std::size_t>();
  report.model = json.at("model").get<std::string>();
  report.filter = json.at("filter").get<int>();
  report.fps = finite_or_nan(json, "fps");
  report.scale_source = json.at("scale_source").get<std::string>();
  report.tracked_fraction = finite_or_nan(json, "tracked_fraction");
  report.road_measured_fraction = number_at(json, "road_measured_fraction");
  if (!json.at("refined").is_null()) {
    report.refined.emplace();
    read_errors(json.at("refined"), *report.refined);
  }
  if (!json.at("segment_lengths_m").is_null()) {  // all of them are null without ground truth
    report.metrics = metrics_of(json);
  }
  return report;
}

}  // namespace

Expected<MetricsReport> read_metrics_json(const std::filesystem::path& file) {
  const Expected<std::string> text = read_text_file(file);
  if (!text) {
    return text.error();
  }
  try {
    return report_of(nlohmann::json::parse(*text));
  } catch (const nlohmann::json::exception& error) {
    return fail(
        fmt::format("{}: expected the metrics of a run, found: {}", file.string(), error.what()));
  }
}

}  // namespace stemvo
