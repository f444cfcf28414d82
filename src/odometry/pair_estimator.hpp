// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <vector>

#include "odometry/estimator.hpp"
#include "odometry/metric_scale.hpp"
#include "odometry/motion_chain.hpp"
#include "odometry/two_view_estimator.hpp"
#include "stemvo/config.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo {

/// The paper's chain (`odometry.mode: two_frame`): motions between consecutive frames, composed.
class PairEstimator final : public Estimator {
 public:
  PairEstimator(const Config& config, const Camera& camera);

  [[nodiscard]] LocalizedFrame localize(const TrackedFrame& frame) override;
  void optimize(const TrackedFrame& frame, LocalizedFrame& localized) override;

  [[nodiscard]] const std::vector<Rigid3>& trajectory() const override { return trajectory_; }
  [[nodiscard]] std::vector<Rigid3> refined_trajectory() const override { return trajectory_; }
  [[nodiscard]] std::vector<MapLandmark> landmarks() const override { return {}; }

 private:
  void measure_step(const TrackedFrame& frame);

  TwoViewEstimator two_view_;
  MotionChain chain_;
  MetricScale scale_;
  bool asks_road_;
  std::uint64_t seed_;
  double last_step_;       ///< of one frame that was tracked; its length is the unit
  int image_before_ = -1;  ///< the one before the frame in work
  int last_image_ = -1;    ///< number of the last frame that had one
  bool is_first_ = false;  ///< the frame in work starts the chain
  MeasuredMotion motion_;  ///< of the frame in work
  std::vector<Rigid3> trajectory_;
};

}  // namespace stemvo
