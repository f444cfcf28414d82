// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "odometry/road/image.hpp"
#include "odometry/road/scale.hpp"
#include "stemvo/frame_result.hpp"
#include "stemvo/options.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Metres per unit of an estimator, from the road (`scale.source: camera_height`; else disabled:
/// every factor is 1), and what each frame's result says of it.
class MetricScale {
 public:
  /// `drift_sigma`: of log(metres per unit), per frame.
  explicit MetricScale(const Options& config, std::optional<double> drift_sigma = {});

  [[nodiscard]] bool is_enabled() const { return road_.has_value(); }

  /// The first image, or one that nothing connects with the ones before.
  void restart(const RoadImage* road);
  /// A frame whose image comes `cur_from_prev` (units) after the last one given here. Returns the
  /// factor that makes a unit a metre; the caller multiplies its lengths by it.
  [[nodiscard]] double measure(const RoadImage* road,
                               const Rigid3& cur_from_prev,
                               const std::vector<RoadLandmark>& landmarks = {});
  /// A frame on which the road cannot be measured: the last scale is kept, its sigma grows.
  void keep_last(std::string_view reason);
  /// A frame without a map to scale.
  void set_unknown(std::string_view reason);

  /// State, reason and sigma of the last frame given.
  void report(FrameResult& result) const;

 private:
  void keep(const RoadScaleEstimate& estimate);

  ScaleFilter filter_;
  std::optional<RoadScale> road_;
  std::optional<double> sigma_;
  ScaleState state_ = ScaleState::kDisabled;
  std::string_view reason_;
};

}  // namespace stemvo
