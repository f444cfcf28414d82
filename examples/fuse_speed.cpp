// SPDX-License-Identifier: MIT
// A filter: joins each motion with a wheel's speed by their covariances, and carries the pose along
// with its own. Reads lines of time (s), speed (m/s) and image; prints time, position and sigmas.
//   fuse_speed 1241 376 718.86 718.86 607.19 185.22 <drive.txt
#include <cstdlib>
#include <iostream>
#include <string>

#include <Eigen/LU>
#include <opencv2/imgcodecs.hpp>
#include <stemvo/odometry.hpp>

namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// The true pose is pose * error; the error, x y z before the rotation, has this covariance.
struct Estimate {
  stemvo::Rigid3 pose;
  Matrix6d covariance = Matrix6d::Zero();
};

/// A motion of which a wheel says how far it went: forward, and aside only as far as the car turns
/// and the camera is askew in it.
Estimate with_wheel(const Estimate& motion, double length_m) {
  const Eigen::Vector3d sigma = (length_m * Eigen::Array3d(0.1, 0.1, 0.01)).abs() + 1e-3;
  const Eigen::Vector3d differing = Eigen::Vector3d(0.0, 0.0, length_m) - motion.pose.translation;
  Eigen::Matrix<double, 3, 6> step_by_error = Eigen::Matrix<double, 3, 6>::Zero();
  step_by_error.leftCols<3>() = motion.pose.rotation_matrix();
  const Eigen::Matrix<double, 6, 3> shared = motion.covariance * step_by_error.transpose();
  Eigen::Matrix3d spread = step_by_error * shared;
  spread.diagonal() += sigma.cwiseAbs2();
  const Eigen::Matrix<double, 6, 3> gain = shared * spread.inverse();
  const Eigen::Matrix<double, 6, 1> error = gain * differing;
  return {motion.pose * stemvo::Rigid3(stemvo::so3_exp(error.tail<3>()), error.head<3>()),
          motion.covariance - gain * shared.transpose()};
}

Estimate operator*(const Estimate& world_from_prev, const Estimate& prev_from_cur) {
  const auto [rotation, translation] = prev_from_cur.pose.inverse();
  Matrix6d carried = Matrix6d::Zero();  // an error there, as this pose has it
  carried.topLeftCorner<3, 3>() = carried.bottomRightCorner<3, 3>() = rotation.toRotationMatrix();
  carried.topRightCorner<3, 3>() = stemvo::skew(translation) * rotation.toRotationMatrix();
  return {world_from_prev.pose * prev_from_cur.pose,
          carried * world_from_prev.covariance * carried.transpose() + prev_from_cur.covariance};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 7) return std::cerr << "usage: fuse_speed WIDTH HEIGHT FX FY CX CY <LINES\n", 2;
  const stemvo::Camera camera{std::atof(argv[3]), std::atof(argv[4]), std::atof(argv[5]),
                              std::atof(argv[6]), std::atoi(argv[1]), std::atoi(argv[2])};
  auto odometry = stemvo::Odometry::create(camera, stemvo::Options::driving(1.65)).value();
  Estimate fused;
  stemvo::Rigid3 world_from_last;  // by the odometry alone
  double last_time_s = 0.0;
  std::string image;
  for (double time_s, speed; std::cin >> time_s >> speed >> image; last_time_s = time_s) {
    const auto frame = odometry.process(cv::imread(image), stemvo::PixelOrder::kBgr, time_s);
    if (!frame) return std::cerr << frame.error().message << "\n", 1;
    if (frame->state != stemvo::FrameState::kFirst) {
      const Estimate motion{world_from_last.inverse() * frame->world_from_camera,
                            frame->motion_covariance};
      fused = fused * with_wheel(motion, speed * (time_s - last_time_s));
    }
    world_from_last = frame->world_from_camera;
    const Eigen::Matrix3d world_from_camera = fused.pose.rotation_matrix();
    const Eigen::Matrix3d covariance =
        world_from_camera * fused.covariance.topLeftCorner<3, 3>() * world_from_camera.transpose();
    std::cout << time_s << " " << fused.pose.translation.transpose() << " "
              << covariance.diagonal().cwiseSqrt().transpose() << "\n";
  }
}
