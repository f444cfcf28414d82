// SPDX-License-Identifier: MIT
#include "odometry/road/path.hpp"

#include <cstddef>

#include <Eigen/LU>

namespace stemvo {

namespace {

constexpr std::size_t kMaxPositions = 64;  ///< of a path

}  // namespace

void RoadPath::move(const Rigid3& cur_from_prev) {
  if (!(cur_from_prev.translation.norm() > 0.0)) {
    return;  // standing
  }
  for (Eigen::Vector3d& position : positions_) {
    position = cur_from_prev * position;
  }
  positions_.push_front(cur_from_prev.translation);
  if (positions_.size() > kMaxPositions) {
    positions_.pop_back();
  }
}

void RoadPath::rescale(double factor) {
  for (Eigen::Vector3d& position : positions_) {
    position *= factor;
  }
}

void RoadPath::predict(double metres_per_unit, RoadPrior& prior) const {
  const double weight = 1.0 / (options_.heave_sigma_m * options_.heave_sigma_m);
  Eigen::Matrix3d information =
      Eigen::Vector3d(weight, 1.0 / (options_.free_slope_sigma_rad * options_.free_slope_sigma_rad),
                      1.0 / (options_.bend_sigma_per_m * options_.bend_sigma_per_m))
          .asDiagonal();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& position : positions_) {
    const double z = position.z() * metres_per_unit;
    if (!(z > -options_.path_m && z < 0.0)) {
      break;  // farther back, or turned round: the road may have bent otherwise
    }
    const Eigen::Vector3d row(1.0, z, z * z);
    information += weight * row * row.transpose();
    right += weight * position.y() * metres_per_unit * row;
  }
  const Eigen::Matrix3d covariance = information.inverse();
  const Eigen::Vector3d profile = covariance * right;
  const Eigen::DiagonalMatrix<double, 2> units(1.0, options_.camera_height_m);
  const Eigen::Matrix2d of_slope_and_drop = units * covariance.bottomRightCorner<2, 2>() * units;
  prior.slope_rad = profile[1];
  prior.drop = options_.camera_height_m * profile[2];
  prior.profile_information = of_slope_and_drop.inverse();
}

}  // namespace stemvo
