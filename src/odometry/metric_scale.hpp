// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string_view>

#include "odometry/road_picture.hpp"
#include "odometry/road_scale.hpp"
#include "stemvo/config.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"
#include "stemvo/odometry/odometry.hpp"

namespace stemvo {

/// Metres per unit of an estimator, from the road (`scale.source: camera_height`; else disabled:
/// every factor is 1), and what each frame is told of it.
class MetricScale {
 public:
  /// `drift_sigma`: of log(metres per unit), per frame.
  MetricScale(const Config& config, const Camera& camera, std::optional<double> drift_sigma = {});

  /// The first image, or one that nothing connects with the ones before.
  void restart(const RoadPicture* road);
  /// A frame whose image comes `cur_from_prev` (units) after the last one given here. Returns the
  /// factor that makes a unit a metre; the caller multiplies its lengths by it.
  [[nodiscard]] double measure(const RoadPicture* road, const Rigid3& cur_from_prev);
  /// A frame on which the road cannot be measured.
  void hold(std::string_view reason);
  /// A frame without a map to scale.
  void wait(std::string_view reason);

  /// State, reason and sigma of the last frame given.
  void report(FrameResult& result) const;

 private:
  void keep(const RoadScaleEstimate& estimate);

  std::optional<RoadScale> road_;
  std::optional<double> sigma_;
  RoadState state_ = RoadState::kDisabled;
  std::string_view reason_;
};

}  // namespace stemvo
