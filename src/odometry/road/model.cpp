// SPDX-License-Identifier: MIT
#include "odometry/road/model.hpp"

#include <algorithm>

#include <Eigen/Cholesky>

namespace stemvo {

void RoadNormal::inflate_variance(const Eigen::Vector3d& spread) {
  const Eigen::Vector3d expected = information.diagonal().head<3>().cwiseMax(1e-12);
  const double chi2_per_dof = spread.cwiseQuotient(expected).mean();
  const double inflation =
      std::max(1.0, chi2_per_dof);  // never below: few groups may agree by luck
  information /= inflation;
  gradient /= inflation;
}

void RoadNormal::add_prior(const RoadWarp& warp,
                           const RoadPrior& prior,
                           double rotation_sigma_rad) {
  const Eigen::Vector3d& m = warp.plane;
  // Slope = -m_z / m_y and drop, together; then roll = -m_x / m_y.
  Eigen::Matrix<double, 2, 7> profile = Eigen::Matrix<double, 2, 7>::Zero();
  profile(0, 1) = m.z() / (m.y() * m.y());
  profile(0, 2) = -1.0 / m.y();
  profile(1, 3) = 1.0;
  const Eigen::Vector2d error(-m.z() / m.y() - prior.slope_rad, warp.drop - prior.drop);
  information += profile.transpose() * prior.profile_information * profile;
  gradient += profile.transpose() * (prior.profile_information * error);
  RoadVector roll = RoadVector::Zero();
  roll[0] = -1.0 / m.y();
  roll[1] = m.x() / (m.y() * m.y());
  const double roll_weight = 1.0 / (prior.roll_sigma * prior.roll_sigma);
  information += roll_weight * roll * roll.transpose();
  gradient += roll_weight * (-m.x() / m.y() - prior.roll_rad) * roll;
  const double rotation_weight = 1.0 / (rotation_sigma_rad * rotation_sigma_rad);
  information.diagonal().tail<3>().array() += rotation_weight;
  gradient.tail<3>() += rotation_weight * warp.correction;
}

bool RoadNormal::step(RoadWarp& warp) {
  const Eigen::LDLT<RoadMatrix> solver(information);
  const RoadVector step = solver.solve(-gradient);
  covariance = solver.solve(RoadMatrix::Identity());
  relative_change = step.head<3>().norm() / warp.plane.norm();
  warp.plane += step.head<3>();
  warp.drop += step[3];
  warp.correction += step.tail<3>();
  return step.allFinite() && covariance.allFinite() && warp.plane.y() > 0.0;
}

RoadMeasurement read_road(const RoadWarp& warp,
                          const RoadMatrix& covariance,
                          double camera_height_m) {
  RoadMeasurement result;
  const Eigen::Vector3d& m = warp.plane;
  const Eigen::Vector3d gain = m / m.squaredNorm();  // d log |m| / dm, for the sigma of log_scale
  result.log_scale = std::log(camera_height_m * m.norm());
  result.sigma = std::sqrt(gain.dot(covariance.topLeftCorner<3, 3>() * gain));
  result.slope_rad = -m.z() / m.y();
  result.roll_rad = -m.x() / m.y();
  result.drop = warp.drop;
  return result;
}

RoadMeasurement no_road(std::string_view reason, bool is_in_sight) {
  RoadMeasurement result;
  result.is_in_sight = is_in_sight;
  result.reason = reason;
  return result;
}

}  // namespace stemvo
