// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <optional>
#include <string_view>
#include <vector>

#include "odometry/road/belief.hpp"
#include "odometry/road/image.hpp"
#include "odometry/road/scale.hpp"
#include "odometry/scale_filter.hpp"
#include "odometry/way.hpp"
#include "odometry/window.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/options.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// FrameResult::road_reason where road and ways, both believed, contradict each other.
inline constexpr std::string_view kRoadContradicted = "it contradicts the speed";

/// The frame's lengths are metres, not units.
[[nodiscard]] inline bool has_metres(const FrameResult& result) {
  return result.scale_state == ScaleState::kMeasured || result.scale_state == ScaleState::kHeld;
}

/// Metres per unit of an estimator, from the road (`scale.source: camera_height`), from ways that
/// somebody else measured, or from both; without either every factor is 1. And what each frame's
/// result says of it.
class MetricScale {
 public:
  /// `drift_sigma`: of log(metres per unit), in a second.
  explicit MetricScale(const Options& config, std::optional<double> drift_sigma = {});

  /// Somebody measures.
  [[nodiscard]] bool is_enabled() const { return road_.has_value() || has_ways_; }
  [[nodiscard]] bool asks_road() const { return road_.has_value(); }

  /// The first image, or one that nothing connects with the ones before; `has_scale`: but for the
  /// scale.
  void restart(const RoadImage* road, double time_s, bool has_scale = false);
  /// Ways that came before this frame did.
  void add(const std::vector<Way>& ways) {
    is_scale_new_ = false;
    ways_.add(ways);
    if (!ways.empty() && !is_enabled()) {
      state_ = ScaleState::kNone;
    }
    has_ways_ = has_ways_ || !ways.empty();
  }
  /// A frame whose image comes `cur_from_prev` (units) after the last one given here. Returns the
  /// factor that makes a unit a metre; the caller multiplies its lengths by it. `pixel_units`: as
  /// WayScale::move.
  [[nodiscard]] double measure(const RoadImage* road,
                               const Rigid3& cur_from_prev,
                               double time_s,
                               double pixel_units,
                               const std::vector<RoadLandmark>& landmarks = {});
  /// The map was multiplied by `factor` (new units = factor * old units).
  void rescale(double factor) {
    is_unit_new_ = true;
    filter_.shift(-std::log(factor));
    road_filter_.shift(-std::log(factor));
    ways_.rescale(factor);
    if (road_.has_value()) {
      road_->rescale(factor);
    }
  }
  /// The next motion will not tell how far the camera went since the last one.
  void cut_path(double time_s) { ways_.restart(time_s); }
  /// A frame on which nothing can be measured: the last scale is kept, its sigma grows.
  void keep_last(std::string_view reason, double time_s) {
    const double interval_s = time_s - std::exchange(last_time_s_, time_s);
    if (is_enabled()) {
      filter_.predict(interval_s);
      road_filter_.predict(interval_s);
      state_ = state_ == ScaleState::kMeasured ? ScaleState::kHeld : state_;
      reason_ = road_.has_value() ? reason : "";
    }
  }
  /// A frame without a map to scale.
  void set_unknown(std::string_view reason) {
    if (is_enabled()) {
      state_ = ScaleState::kNone;
      is_road_believed_ = false;
      is_way_measured_ = false;
      apart_ = 0.0;
      reason_ = road_.has_value() ? reason : "";
    }
  }

  /// State, reason and sigma of the last frame given.
  void report(FrameResult& result) const {
    result.scale_state = state_;
    result.road_reason = reason_;
    result.is_scale_new = result.is_scale_new || is_scale_new_;
    if (is_enabled()) {
      result.scale_sigma = is_way_measured_    ? way_sigma()
                           : is_road_believed_ ? std::hypot(road_->sigma(filter_), apart_)
                                               : ScaleFilter::kUnknownSigma;
    }
  }

 private:
  /// Gives the road this frame, and the filter what it says. Returns whether it was measured.
  bool measure_road(const RoadImage& road,
                    const Rigid3& cur_from_prev,
                    const std::vector<RoadLandmark>& landmarks);
  [[nodiscard]] double contradiction() const;  ///< how far apart road and ways are; 0: not
  [[nodiscard]] double way_sigma() const;      ///< of the scale that ways measured

  ScaleFilter filter_;
  /// What the road says by itself: told where to look by ways, it would find what they say.
  ScaleFilter road_filter_;
  std::optional<RoadScale> road_;
  WayScale ways_;
  double way_from_road_ = 0.0;  ///< difference of what they say, mean of the last ways
  int num_compared_ = 0;
  double apart_ = 0.0;        ///< contradiction() when both were measured last
  double last_time_s_ = 0.0;  ///< of the frame before
  bool has_ways_ = false;
  bool is_road_believed_ = false;
  bool is_way_measured_ = false;  ///< since the last restart
  bool is_scale_proven_ = false;  ///< the road was believed, or a way measured, since then
  bool is_unit_new_ = false;      ///< for another reason than that the scale was proven
  bool is_scale_new_ = false;     ///< with this frame, in the middle of a map
  int num_frames_ = 0;            ///< measured on since then
  ScaleState state_ = ScaleState::kDisabled;
  std::string_view reason_;  ///< of the road
};

/// The window's landmarks that a frame sees, as witnesses of the road: those in front of the camera
/// that at least three keyframes see, which a wrong track seldom survives.
[[nodiscard]] std::vector<RoadLandmark> road_landmarks(const Window& window,
                                                       const Rigid3& world_from_camera,
                                                       const Observations& seen,
                                                       const Camera& camera);

}  // namespace stemvo
