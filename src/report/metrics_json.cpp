// SPDX-License-Identifier: MIT
#include "report/metrics_json.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "report/evaluate_report.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

using Json = nlohmann::ordered_json;

}  // namespace

// Found by nlohmann's library.
void to_json(Json& json, const CameraReport& report) {
  const Camera& camera = report.camera;
  json = {{"fx_px", camera.fx_px},
          {"fy_px", camera.fy_px},
          {"cx_px", camera.cx_px},
          {"cy_px", camera.cy_px}};
  const std::optional<CameraSigma>& sigma = report.sigma;
  json["fx_sigma_px"] = sigma ? Json(sigma->fx_px) : Json();
  json["cx_sigma_px"] = sigma ? Json(sigma->cx_px) : Json();
  json["cy_sigma_px"] = sigma ? Json(sigma->cy_px) : Json();
}
void to_json(Json& json, const AbsoluteTrajectoryError& ate) {
  json = {{"none", ate.none_m}, {"scale", ate.scale_m}, {"se3", ate.se3_m}, {"sim3", ate.sim3_m}};
}

void to_json(Json& json, const TimingReport& report) {
  json["threads"] = report.num_threads;
  json["fps"] = report.fps;
  json["peak_memory_mib"] = report.peak_memory_mib;
  json["cpu_s"] = report.cpu_s;
  json["other_cpu_s"] = report.rest_cpu_s;
  json["stages"] = Json::object();
  for (const StageTiming& stage : report.stages) {
    json["stages"][stage.name] = {{"calls", stage.calls},
                                  {"median_ms", stage.median_ms},
                                  {"p95_ms", stage.p95_ms},
                                  {"cpu_s", stage.cpu_s}};
  }
}

void add_metrics(Json& json, const std::optional<Metrics>& metrics) {
  const Metrics m = metrics.value_or(Metrics());
  const Json numbers = {{"path_length_m", m.path_length_m},
                        {"average_offset_m", m.average_offset_m},
                        {"null_offset_m", m.null_offset_m},
                        {"t_rel_percent", m.t_rel_percent},
                        {"r_rel_deg_per_100m", m.r_rel_deg_per_100m},
                        {"segment_lengths_m", m.segment_lengths_m},
                        {"segments", m.num_segments},
                        {"ate_rmse_m", m.ate_rmse},
                        {"rpe_translation_m", m.rpe_translation_m},
                        {"rpe_rotation_deg", m.rpe_rotation_deg}};
  for (const auto& [key, value] : numbers.items()) {
    json[key] = metrics ? value : Json();
  }
}

void to_json(Json& json, const MapReport& report) {
  json = {{"keyframes", report.num_keyframes},
          {"loops", report.num_loops},
          {"relocalizations", report.num_relocalizations},
          {"adjustment_s", report.adjustment_s ? Json(*report.adjustment_s) : Json()},
          {"alignment", report.metrics ? Json(to_string(report.metrics->alignment)) : Json()}};
  add_metrics(json, report.metrics);
}

std::string to_text(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

Expected<Json> read_json_object(const std::filesystem::path& file) {
  STEMVO_TRY_GET(const std::string text, read_text_file(file, kMaxSettings_MB));
  try {
    Json json = Json::parse(text);
    if (json.is_object()) {
      return json;
    }
    return fail(
        fmt::format("{}: expected a JSON object, found {}", file.string(), json.type_name()));
  } catch (const Json::exception& error) {
    const std::string what = error.what();  // "[json.exception.parse_error.101] parse error at .."
    return fail(
        fmt::format("{}: not JSON: {}", file.string(), one_line(what.substr(what.find("] ") + 2))));
  }
}

Json metrics_document(const MetricsReport& report) {
  Json json = {{"stemvo_version", report.stemvo_version},
               {"sequence", report.sequence},
               {"first_frame", report.first_frame},
               {"frames", report.num_frames},
               {"model", report.model},
               {"filter", report.filter},
               {"fps", report.fps},
               {"scale_source", report.scale_source},
               {"tracked_fraction", report.tracked_fraction},
               {"maps", report.num_maps},
               {"scale_new_frames", report.scale_new_frames},
               {"in_place_fraction", report.in_place_fraction},
               {"camera", report.camera},
               {"road_measured_fraction", report.road_measured_fraction},
               {"road_believed_fraction", report.road_believed_fraction},
               {"alignment", report.metrics ? Json(to_string(report.metrics->alignment)) : Json()}};
  add_metrics(json, report.metrics);
  json["map"] = report.map;
  if (report.timing) {
    json["timing"] = *report.timing;
  }
  return json;
}

Status write_metrics_json(const std::filesystem::path& file, const MetricsReport& report) {
  return write_text_file(file, to_text(metrics_document(report)));
}

}  // namespace stemvo
