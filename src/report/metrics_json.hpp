// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "evaluation/metrics.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "stemvo/frame_result.hpp"
#include "timing/stage_timer.hpp"

/// An optional without a value is null in JSON.
template <typename T>
struct nlohmann::adl_serializer<std::optional<T>> {
  template <typename Json>
  static void to_json(Json& json, const std::optional<T>& value) {
    json = value ? Json(*value) : Json();
  }
};

namespace stemvo {

struct CameraReport {
  Camera camera;
  std::optional<CameraSigma> sigma;  ///< nullopt: it is not refined
  Eigen::Vector2d radial = Eigen::Vector2d::Zero();
};

struct MapReport {
  std::size_t num_keyframes = 0;
  std::size_t num_loops = 0;            ///< places seen again while the camera was tracked
  std::size_t num_relocalizations = 0;  ///< frames that found the camera again after a loss
  std::optional<double> adjustment_s;   ///< how long the adjustment of everything took
  std::optional<Metrics> metrics;       ///< of trajectory_map_kitti.txt
  bool is_apart = false;                ///< from the map that was given: none of it was seen
};

/// The numbers of metrics.json. Everything in `metrics` is null in the file without ground truth.
struct MetricsReport {
  std::string sequence;         ///< folder name, e.g. "03"
  std::size_t first_frame = 0;  ///< in the folder's numbering
  std::size_t num_frames = 0;   ///< key `frames`
  std::string model;            ///< as asked for, e.g. "default", "gray"
  int filter = 0;
  double fps = 0.0;  ///< frames over wall time, process start to trajectory written
  std::string scale_source;
  double tracked_fraction = 0.0;              ///< frames whose pose was measured, over all
  int num_maps = 0;                           ///< key `maps`
  std::vector<std::size_t> scale_new_frames;  ///< where one of them began, counted from 0
  double in_place_fraction = 0.0;  ///< frames behind the first that measured no translation
  CameraReport camera;
  std::optional<double> road_measured_fraction;  ///< nullopt: the road is not asked
  /// Frames whose scale was in metres: `measured` or `held`; nullopt as above.
  std::optional<double> road_believed_fraction;
  double road_contradicted_fraction = 0.0;  ///< frames whose speed says another scale
  double metric_fraction = 1.0;             ///< frames in metres, where speeds are given
  std::optional<Metrics> metrics;
  std::optional<MapReport> map;        ///< nullopt: nothing is remembered
  std::optional<TimingReport> timing;  ///< nullopt: nobody asked, and the key is not in the file

  /// Lengths are units: nobody gave metres, or the road that should was never believed.
  [[nodiscard]] bool is_up_to_scale() const {
    return scale_source == "none" || road_believed_fraction == 0.0;
  }
};

/// The warning about metres of few frames, or of which road and speeds say otherwise; else empty.
[[nodiscard]] std::string warn_of_scale(const MetricsReport& report);
/// The same where most of the path is no measurement.
[[nodiscard]] std::string warn_of_gaps(const MetricsReport& report);

/// The document that metrics.json holds; `alignment` is that of the offset, t_rel, r_rel, the RPE.
[[nodiscard]] nlohmann::ordered_json metrics_document(const MetricsReport& report);

/// Adds the keys of metrics.json that need ground truth; all null without metrics.
void add_metrics(nlohmann::ordered_json& json, const std::optional<Metrics>& metrics);

/// Indented, ends with a newline. A number that is not finite becomes null, bytes that are not
/// UTF-8 the replacement character.
[[nodiscard]] std::string to_text(const nlohmann::ordered_json& json);

/// Errors: the file cannot be read, is no JSON or holds no object.
[[nodiscard]] Expected<nlohmann::ordered_json> read_json_object(const std::filesystem::path& file);

[[nodiscard]] std::string format_metrics_table(const MetricsReport& report);
/// Numbers for people: t_rel, r_rel, offset, that of zero motion, the ATE after each alignment in
/// its order from kAteText on, RPE of position and of rotation.
[[nodiscard]] std::array<std::string, 10> metric_texts(const Metrics& metrics);
inline constexpr std::size_t kAteText = 4;
[[nodiscard]] std::string format_timing_table(const TimingReport& report);

}  // namespace stemvo
