// SPDX-License-Identifier: MIT
#include "report/metrics_json.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "report/evaluate_report.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kFewBelieved = 0.5;  ///< a smaller share is warned of
constexpr double kFewContradicted = 0.05;
constexpr double kMostMetric = 0.9;  ///< where speeds are given, a smaller share is warned of
constexpr double kFewTracked = 0.5;  ///< a smaller share of frames that were measured is, too
constexpr double kInPlace = 0.95;    ///< a larger share of frames in place is told

std::string scale_explained(const MetricsReport& report) {
  const std::string& source = report.scale_source;
  const std::string shown = source == "none" ? source : source + ", no road believed";
  if (report.is_up_to_scale() && report.metrics) {
    return shown + " (files: up to scale; here: fitted to the true metres)";
  }
  return source == "ground_truth"     ? source + " (each step rescaled to its true length)"
         : source == "constant_speed" ? source + " (every step the same length: not metric)"
         : report.is_up_to_scale()    ? shown + " (up to scale: units, not metres)"
                                      : source;
}

std::string head(const MetricsReport& report) {
  TextTable table("ll");
  const std::size_t end = report.first_frame + report.num_frames;
  table.add({"sequence", fmt::format("{}, {} frames ({}:{})", report.sequence, report.num_frames,
                                     report.first_frame, end)});
  table.add({"model", fmt::format("{}, filter {}", report.model, report.filter)});
  table.add({"scale", scale_explained(report)});
  table.add({"speed", fmt::format("{:.1f} frames/s", report.fps)});
  table.add({"tracked", fmt::format("{:.1f} % of the frames have a measured pose",
                                    100.0 * report.tracked_fraction)});
  if (report.in_place_fraction > kInPlace) {
    table.add(
        {"motion",
         fmt::format("hardly any ({:.1f} % of the frames in place): lengths and % mean little",
                     100.0 * report.in_place_fraction)});
  }
  if (const auto& sigma = report.camera.sigma) {
    const Camera& camera = report.camera.camera;
    table.add(
        {"camera", fmt::format("principal point {:.1f}, {:.1f} px, known to {:.1f}, {:.1f} px",
                               camera.cx_px, camera.cy_px, sigma->cx_px, sigma->cy_px)});
    table.add({"", fmt::format("focal length {:.1f} px, known to {:.1f} px", camera.fx_px,
                               sigma->fx_px)});
    if (const Eigen::Vector2d& k = report.camera.radial; !k.isZero()) {
      table.add({"", fmt::format("frames have a distortion k1 {:.4f}, k2 {:.4f}: taken out", k[0],
                                 k[1])});
    }
  }
  if (report.road_measured_fraction) {
    table.add({"road", fmt::format("measured on {:.1f} % of the frames, believed on {:.1f} %",
                                   100.0 * *report.road_measured_fraction,
                                   100.0 * report.road_believed_fraction.value_or(0.0))});
  }
  if (report.map) {
    const MapReport& map = *report.map;
    const std::string adjusted =
        map.adjustment_s ? fmt::format(", adjusted in {:.1f} s", *map.adjustment_s) : "";
    table.add({"map", fmt::format("{} keyframes, {} loops, {} relocalizations{}", map.num_keyframes,
                                  map.num_loops, map.num_relocalizations, adjusted)});
  }
  if (report.metrics) {
    table.add({"path", format_length(report.metrics->path_length_m, 1) + " m (ground truth)"});
  }
  return table.str();
}

std::string error_table(const MetricsReport& report) {
  const Metrics& m = *report.metrics;
  const std::string segments = m.num_segments == 0
                                   ? fmt::format(
                                         "no segment of {} fits into {:.1f} m: see "
                                         "evaluation.segment_lengths_m",
                                         length_range(m.segment_lengths_m), m.path_length_m)
                                   : fmt::format("mean over {} segments of {}", m.num_segments,
                                                 length_range(m.segment_lengths_m));
  const std::string fitted(to_string(m.alignment));
  struct Row {
    std::string error, unit, alignment, note;
  };
  const Row rows[] = {
      {"translation t_rel", "%", fitted, segments},
      {"rotation r_rel", "deg/100 m", fitted, "the same segments"},
      {"average offset", "m", fitted, "mean of |dx| + |dz|"},
      {"  of zero motion", "m", "none", "the same for a camera that stays at the start"},
      {"position ATE", "m", "none", "root mean square position error"},
      {"position ATE", "m", "scale", "one scale fitted"},
      {"position ATE", "m", "se3", "rotation and shift fitted"},
      {"position ATE", "m", "sim3", "rotation, shift and scale fitted"},
      {"translation per frame", "m", fitted, "mean over steps of one frame (RPE)"},
      {"rotation per frame", "deg", fitted, "the same steps"}};
  const auto in_map = report.map ? report.map->metrics : std::nullopt;
  TextTable table(in_map ? "lrrlll" : "lrlll");
  const auto add = [&](const Row& row, const std::string& value, const std::string& map) {
    table.add(in_map ? std::vector{row.error, value, map, row.unit, row.alignment, row.note}
                     : std::vector{row.error, value, row.unit, row.alignment, row.note});
  };
  add({"error", "unit", "alignment", ""}, "value", "map");
  table.rule();
  const auto values = metric_texts(m);
  const auto map_values = metric_texts(in_map.value_or(m));
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool is_unscaled = i == kAteText || i == kAteText + 2;
    if (!report.is_up_to_scale() || !is_unscaled) {  // else units against metres
      add(rows[i], values[i], map_values[i]);
    }
  }
  return table.str();
}

}  // namespace

// Found by nlohmann's library.
void to_json(Json& json, const CameraReport& report) {
  const Camera& camera = report.camera;
  json = {{"fx_px", camera.fx_px}, {"fy_px", camera.fy_px},  {"cx_px", camera.cx_px},
          {"cy_px", camera.cy_px}, {"k1", report.radial[0]}, {"k2", report.radial[1]}};
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
  Json json = {{"stemvo_version", version()},
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
               {"road_contradicted_fraction", report.road_contradicted_fraction},
               {"alignment", report.metrics ? Json(to_string(report.metrics->alignment)) : Json()}};
  add_metrics(json, report.metrics);
  json["map"] = report.map;
  if (report.timing) {
    json["timing"] = *report.timing;
  }
  return json;
}

std::array<std::string, 10> metric_texts(const Metrics& metrics) {
  const auto& ate = metrics.ate_rmse;
  return {number_or_dash(metrics.t_rel_percent, 2),
          number_or_dash(metrics.r_rel_deg_per_100m, 3),
          format_length(metrics.average_offset_m, 2),
          format_length(metrics.null_offset_m, 2),
          format_length(ate.none_m, 2),
          format_length(ate.scale_m, 2),
          format_length(ate.se3_m, 2),
          format_length(ate.sim3_m, 2),
          fmt::format("{:.4f}", metrics.rpe_translation_m),
          fmt::format("{:.4f}", metrics.rpe_rotation_deg)};
}

std::string warn_of_gaps(const MetricsReport& report) {
  return report.tracked_fraction >= kFewTracked
             ? ""
             : fmt::format(
                   "tracked: {:.1f} % of the frames only have a measured pose; the others' are a "
                   "guess (state in frames.csv)",
                   100.0 * report.tracked_fraction);
}

std::string warn_of_scale(const MetricsReport& report) {
  const double share = report.road_believed_fraction.value_or(1.0);
  return share == 0.0 ? "scale: no road was believed at scale.camera_height_m below the camera; "
                        "the path is in units, not metres"
         : share < kFewBelieved
             ? fmt::format(
                   "scale: a road was believed on {:.1f} % of the frames only, and may be none; "
                   "lengths are a guess (scale_state in frames.csv)",
                   100.0 * share)
         : report.road_contradicted_fraction > kFewContradicted
             ? fmt::format(
                   "scale: road and speeds contradict each other on {:.1f} % of the frames; the "
                   "speeds are followed (check scale.camera_height_m and the speeds' unit)",
                   100.0 * report.road_contradicted_fraction)
         : report.metric_fraction < kMostMetric
             ? fmt::format("scale: {:.1f} % of the frames only are in metres (see frames.csv)",
                           100.0 * report.metric_fraction)
             : "";
}

std::string format_metrics_table(const MetricsReport& report) {
  if (!report.metrics) {
    return head(report) + "\nNo ground truth: the errors are not known.\n";
  }
  return head(report) + '\n' + error_table(report);
}

std::string format_timing_table(const TimingReport& report) {
  TextTable table("lrrrrr");
  table.add({"stage", "calls", "median ms", "p95 ms", "CPU ms/frame", "share %"});
  table.rule();
  const auto add = [&](std::vector<std::string> row, double cpu_s) {
    row.push_back(fmt::format("{:.3f}", 1e3 * cpu_s / static_cast<double>(report.num_frames)));
    row.push_back(fmt::format("{:.1f}", 100.0 * cpu_s / report.cpu_s));
    table.add(row);
  };
  for (const StageTiming& stage : report.stages) {
    add({stage.name, fmt::format("{}", stage.calls), fmt::format("{:.3f}", stage.median_ms),
         fmt::format("{:.3f}", stage.p95_ms)},
        stage.cpu_s);
  }
  add({"start, other, OpenCV's threads", "", "", ""}, report.rest_cpu_s);
  table.rule();
  add({"processor time", "", "", ""}, report.cpu_s);
  return table.str() + fmt::format("\n{:.1f} frames/s, {} frames, {} threads, {:.0f} MiB at most\n",
                                   report.fps, report.num_frames, report.num_threads,
                                   report.peak_memory_mib);
}

}  // namespace stemvo
