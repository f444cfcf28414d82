// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "geometry/bundle.hpp"
#include "mapping/kept_map.hpp"
#include "mapping/map_adjustment.hpp"
#include "odometry/estimator.hpp"
#include "odometry/phased_odometry.hpp"
#include "stemvo/error.hpp"
#include "stemvo/map.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Everything that is known of all frames so far, to be adjusted at once beside an odometry that
/// goes on.
struct WholeMap {
  explicit WholeMap(const PhasedOdometry& odometry);

  /// Places keyframes and all frames where loops bend them.
  void close_loops();
  /// Places keyframes and their landmarks where everything agrees best, and all frames among them.
  /// `covariance_of`: frames of keyframes. Error: one of them is none.
  [[nodiscard]] Status adjust(const std::vector<int>& covariance_of, bool has_sigmas = true);
  [[nodiscard]] AdjustedMap answer() const;

  KeptMap kept;
  std::vector<KeptLandmark> landmarks;
  std::vector<Rigid3> trajectory;
  std::vector<double> times_s;
  std::vector<Similarity3> map_from_frame;      ///< by keyframes as they are, or as adjusted
  Camera camera;                                ///< as it was used last, or as adjusted
  std::optional<IntrinsicsDelta> camera_sigma;  ///< before, or after; nullopt: it is not refined
  std::optional<IntrinsicsDelta> prior;         ///< sigmas that adjust() holds the camera with
  std::vector<int> covariance_of;               ///< keyframes
  std::vector<Eigen::Matrix<double, 6, 6>> covariances;

 private:
  void take_in(const MapAdjustment& adjusted);
};

}  // namespace stemvo
