// SPDX-License-Identifier: MIT
#pragma once

#include "odometry/road_types.hpp"

namespace stemvo {

/// Kalman filter of log(metres per unit), a random walk. A measurement far from the state counts
/// little (Huber), but several in a row on the same side say that the state is wrong: it opens up.
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
  int num_doubts_ = 0;  ///< measurements in a row on one side; the sign is the side
};

}  // namespace stemvo
