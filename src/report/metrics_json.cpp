// SPDX-License-Identifier: MIT
#include "report/metrics_json.hpp"

#include <limits>
#include <type_traits>

#include <fmt/format.h>

#include "report/evaluate_report.hpp"
#include "report/metrics_keys.hpp"
#include "text/text_file.hpp"

namespace stemvo {
namespace {

using Json = nlohmann::ordered_json;

struct Writer {
  Json& json;

  template <typename Value>
  void operator()(const char* key, const Value& value) const {
    json[key] = value;
  }
};

/// Throws Json::exception where a key is missing or of another type.
struct Reader {
  const Json& json;

  template <typename Value>
  void operator()(const char* key, Value& value) const {
    const Json& found = json.at(key);
    if constexpr (std::is_same_v<Value, double>) {
      value = found.is_null() ? std::numeric_limits<double>::quiet_NaN() : found.get<double>();
    } else {
      read_value(found, value);
    }
  }
};

// Each key once, in the file's order: what is visited is const where it is written.

template <typename Report, typename Visitor>
void visit_run(Report& report, const Visitor& visit) {
  visit("stemvo_version", report.stemvo_version);
  visit("sequence", report.sequence);
  visit("first_frame", report.first_frame);
  visit("frames", report.num_frames);
  visit("model", report.model);
  visit("filter", report.filter);
  visit("fps", report.fps);
  visit("scale_source", report.scale_source);
  visit("tracked_fraction", report.tracked_fraction);
  visit("camera", report.camera);
  visit("road_measured_fraction", report.road_measured_fraction);
}

template <typename M, typename Visitor>
void visit_metrics(M& metrics, const Visitor& visit) {
  visit("path_length_m", metrics.path_length_m);
  visit("average_offset_m", metrics.average_offset_m);
  visit("null_offset_m", metrics.null_offset_m);
  visit("t_rel_percent", metrics.t_rel_percent);
  visit("r_rel_deg_per_100m", metrics.r_rel_deg_per_100m);
  visit("segment_lengths_m", metrics.segment_lengths_m);
  visit("segments", metrics.num_segments);
  visit("ate_rmse_m", metrics.ate_rmse);
  visit("rpe_rotation_deg", metrics.rpe_rotation_deg);
}

/// What is kept of a refined trajectory.
template <typename M, typename Visitor>
void visit_refined(M& metrics, const Visitor& visit) {
  visit("average_offset_m", metrics.average_offset_m);
  visit("t_rel_percent", metrics.t_rel_percent);
  visit("r_rel_deg_per_100m", metrics.r_rel_deg_per_100m);
  visit("rpe_rotation_deg", metrics.rpe_rotation_deg);
}

template <typename Ate, typename Visitor>
void visit_ate(Ate& ate, const Visitor& visit) {
  visit("none", ate.none_m);
  visit("scale", ate.scale_m);
  visit("se3", ate.se3_m);
  visit("sim3", ate.sim3_m);
}

}  // namespace

// Found by nlohmann's library.
void to_json(Json& json, const CameraReport& report) {
  const Camera& camera = report.camera;
  json = {{"fx_px", camera.fx_px},
          {"fy_px", camera.fy_px},
          {"cx_px", camera.cx_px},
          {"cy_px", camera.cy_px}};
  json["cx_sigma_px"] = report.sigma_px ? Json(report.sigma_px->x()) : Json();
  json["cy_sigma_px"] = report.sigma_px ? Json(report.sigma_px->y()) : Json();
}
void from_json(const Json& json, CameraReport& report) {
  const Reader read{json};
  read("fx_px", report.camera.fx_px);
  read("fy_px", report.camera.fy_px);
  read("cx_px", report.camera.cx_px);
  read("cy_px", report.camera.cy_px);
  report.sigma_px.reset();
  if (!json.at("cx_sigma_px").is_null()) {
    report.sigma_px = {json.at("cx_sigma_px").get<double>(), json.at("cy_sigma_px").get<double>()};
  }
}
void to_json(Json& json, const AbsoluteTrajectoryError& ate) { visit_ate(ate, Writer{json}); }
void from_json(const Json& json, AbsoluteTrajectoryError& ate) { visit_ate(ate, Reader{json}); }
void to_json(Json& json, const TimeSummary& time) {
  json = {{"median_ms", time.median_ms}, {"p95_ms", time.p95_ms}};
}

void to_json(Json& json, const TimingReport& report) {
  json["threads"] = report.num_threads;
  json["fps"] = report.fps;
  json["loop_fps"] = static_cast<double>(report.num_frames) / report.loop_s;
  json["interval"] = report.interval;
  json["latency"] = report.latency;
  json["peak_memory_mib"] = report.peak_memory_mib;
  json["cpu_s"] = report.cpu_s;
  json["start_cpu_s"] = report.start_cpu_s;
  json["other_cpu_s"] = report.rest_cpu_s;
  for (const TrackCount& track : report.tracks) {
    json["tracks"][track.name] = track.count;
  }
  json["stages"] = Json::object();
  for (const StageTiming& stage : report.stages) {
    json["stages"][stage.name] = {{"calls", stage.calls},
                                  {"median_ms", stage.wall.median_ms},
                                  {"p95_ms", stage.wall.p95_ms},
                                  {"cpu_s", stage.cpu_s},
                                  {"share_percent", stage.share_percent}};
  }
}

void add_metrics(Json& json, const std::optional<Metrics>& metrics) {
  const Metrics none;
  visit_metrics(metrics ? *metrics : none, [&](const char* key, const auto& value) {
    json[key] = metrics ? Json(value) : Json();
  });
}

std::string to_text(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

Json metrics_document(const MetricsReport& report) {
  Json json;
  visit_run(report, Writer{json});
  json["alignment"] = report.metrics ? Json(to_string(report.metrics->alignment)) : Json();
  add_metrics(json, report.metrics);
  json["refined"] = nullptr;
  if (report.refined) {
    visit_refined(*report.refined, Writer{json["refined"]});
  }
  if (report.timing) {
    json["timing"] = *report.timing;
  }
  return json;
}

Status write_metrics_json(const std::filesystem::path& file, const MetricsReport& report) {
  return write_text_file(file, to_text(metrics_document(report)));
}

Expected<MetricsReport> read_metrics_json(const std::filesystem::path& file) {
  const Expected<std::string> text = read_text_file(file);
  if (!text) {
    return text.error();
  }
  try {
    const Json json = Json::parse(*text);
    MetricsReport report;
    visit_run(report, Reader{json});
    if (!json.at("refined").is_null()) {
      visit_refined(report.refined.emplace(), Reader{json["refined"]});
    }
    if (!json.at("segment_lengths_m").is_null()) {  // all of them are null without ground truth
      visit_metrics(report.metrics.emplace(), Reader{json});
      report.metrics->alignment =
          parse_alignment(json.at("alignment").get<std::string>()).value_or(Alignment::kNone);
    }
    return report;
  } catch (const Json::exception& error) {
    return fail(
        fmt::format("{}: expected the metrics of a run, found: {}", file.string(), error.what()));
  }
}

}  // namespace stemvo
