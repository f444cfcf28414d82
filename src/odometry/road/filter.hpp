// SPDX-License-Identifier: MIT
#pragma once

#include <deque>

#include <Eigen/Core>

#include "odometry/road/model.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Kalman filter of log(metres per unit), a random walk. A measurement far from the state counts
/// little (Huber; still less beyond three sigmas), but several in a row on the same side, as many
/// as were believed before, say that the state is wrong: it opens up.
class RoadFilter {
 public:
  explicit RoadFilter(const RoadOptions& options) : options_(options) {}

  static constexpr double kUnknownSigma = 1.0;

  /// One frame passes: the map may have drifted.
  void predict();
  /// Returns whether the measurement was believed; always where frames are not joined.
  bool update(double log_scale, double sigma);
  void shift(double log_factor) { log_scale_ += log_factor; }
  void restart();

  [[nodiscard]] bool is_initialized() const { return is_initialized_; }
  [[nodiscard]] double log_scale() const { return log_scale_; }
  [[nodiscard]] double sigma() const { return sigma_; }

 private:
  RoadOptions options_;
  bool is_initialized_ = false;
  double log_scale_ = 0.0;
  double sigma_ = kUnknownSigma;
  int num_doubts_ = 0;    ///< measurements in a row on one side; the sign is the side
  int num_believed_ = 0;  ///< since it opened up, as far as it counts
};

/// The way that the camera came: it lies above the road at the camera's height, but for the car's
/// bouncing, and tells the slope and the bend of the road under the car, whatever the camera's
/// pitch. Without it a crest ahead looks like a larger step (the plane through the road ahead
/// passes closer under the camera than the road does): 1 mrad of bend between car and strip is 0.3
/// % of scale.
class RoadPath {
 public:
  explicit RoadPath(const RoadOptions& options) : options_(options) {}

  /// `cur_from_prev`: in units of the map.
  void move(const Rigid3& cur_from_prev);
  void rescale(double factor);
  void restart() { positions_.clear(); }

  /// Fills slope, drop and their information: y = y0 + slope z + drop / height z^2 through the
  /// positions, y0: the current vertical bounce.
  void predict(double metres_per_unit, RoadPrior& prior) const;

 private:
  RoadOptions options_;
  std::deque<Eigen::Vector3d> positions_;  ///< in the current camera, map units; newest first
};

}  // namespace stemvo
