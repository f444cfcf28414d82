// SPDX-License-Identifier: MIT
#include <Eigen/Cholesky>

#include "odometry/motion_model.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

Vector6d draw(SceneRandom& random, const Matrix6d& root) {
  Vector6d normal;
  for (double& value : normal) {
    value = random.normal(1.0);
  }
  return root * normal;
}

// A position by far landmarks is unsure together with the turn: a hold mends both.
TEST(MotionModel, AHoldIsFusedByItsSigmaAndTheCovarianceTellsTheError) {
  Vector6d sigma;
  sigma << 0.05, 0.02, 0.1, 0.001, 0.002, 0.001;
  Matrix6d root = sigma.asDiagonal();
  root(4, 0) = 0.0015;  // the turn about y with the shift along x
  const Matrix6d noise = root * root.transpose();
  SceneRandom random(3);
  const int num_draws = 4000;
  Vector6d squares = Vector6d::Zero();
  double nees = 0.0;
  for (int i = 0; i < num_draws; ++i) {
    const Vector6d off = draw(random, root);
    const Rigid3 measured(so3_exp(off.tail<3>()), off.head<3>());
    const double hold_sigma = 0.01;
    const Eigen::Vector3d at = hold_sigma * draw(random, Matrix6d::Identity()).head<3>();
    MotionModel model;
    const MotionModel::Fused fused =
        model.fuse(measured, noise, /*weight=*/0.0, 0.1, MotionModel::Hold{at, hold_sigma});
    Vector6d error;
    error << fused.prev_from_cur.translation, so3_log(fused.prev_from_cur.rotation);
    const Matrix6d covariance = fused.gain * noise * fused.gain.transpose() + fused.rest;
    squares += error.cwiseAbs2() / num_draws;
    nees += error.dot(covariance.llt().solve(error)) / num_draws;
  }
  EXPECT_NEAR(nees, 6.0, 0.2);
  EXPECT_LT(std::sqrt(squares.head<3>().maxCoeff()), 0.0102);
  EXPECT_LT(std::sqrt(squares[4]), 0.0022);  // 0.0025 without
}

}  // namespace
}  // namespace stemvo
