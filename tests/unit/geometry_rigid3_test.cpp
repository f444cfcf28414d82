// SPDX-License-Identifier: MIT
#include "stemvo/rigid3.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

TEST(Rigid3, LongChainStaysOrthonormal) {
  const Rigid3 step = SceneRandom(4).motion(0.3);
  Rigid3 pose;
  for (int i = 0; i < 100000; ++i) {
    pose = pose * step;
  }
  EXPECT_NEAR(pose.rotation.norm(), 1.0, 1e-14);
  const Eigen::Matrix3d r = pose.rotation_matrix();
  EXPECT_THAT(r * r.transpose(), IsNear(Eigen::Matrix3d::Identity(), 1e-13));
}

TEST(Rigid3, FromMatrixTakesTheNearestRotation) {
  const Rigid3 motion = SceneRandom(5).motion(3.0);
  // A pose file with 7 digits.
  const Matrix34d rounded = (motion.matrix() * 1e6).array().round() * 1e-6;
  const Rigid3 read = Rigid3::from_matrix(rounded);
  EXPECT_THAT(read, IsNearMotion(motion, 2e-6));
  EXPECT_NEAR(read.rotation.norm(), 1.0, 1e-15);
  // A symmetric stretch has the identity as its nearest rotation, whatever its size.
  Eigen::Matrix3d stretch;
  stretch << 2.0, 0.3, 0.1, 0.3, 1.0, 0.0, 0.1, 0.0, 3.0;
  EXPECT_THAT(Rigid3::from_matrix(stretch, Eigen::Vector3d::Zero()), IsNearMotion(Rigid3(), 1e-14));
}

TEST(Rigid3, FromMatrixNeverReflects) {
  const Eigen::Matrix3d mirror = Eigen::Vector3d(1.0, 1.0, -1.0).asDiagonal();
  const Rigid3 motion = Rigid3::from_matrix(mirror, Eigen::Vector3d::Zero());
  EXPECT_NEAR(motion.rotation_matrix().determinant(), 1.0, 1e-14);
}

TEST(Rigid3, AngleIsExactForSmallRotations) {
  for (const double angle : {0.0, 1e-12, 1e-9, 1e-4, 1.0, 3.0}) {
    const Eigen::Vector3d axis = Eigen::Vector3d(1.0, -2.0, 0.5).normalized();
    EXPECT_NEAR(Rigid3(so3_exp(angle * axis), Eigen::Vector3d::Zero()).angle_rad(), angle,
                1e-15 + 1e-14 * angle);
  }
  EXPECT_NEAR(Rigid3(so3_exp({4.0, 0.0, 0.0}), Eigen::Vector3d::Zero()).angle_rad(),
              2.0 * std::numbers::pi - 4.0, 1e-14);
}

TEST(So3, ExpIsRodrigues) {
  const Eigen::Vector3d w(0.3, -0.5, 1.1);
  const Eigen::Matrix3d expected = Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix();
  EXPECT_THAT(so3_exp(w).toRotationMatrix(), IsNear(expected, 1e-14));
  // A turn about y (down) by a right angle takes forward to right.
  const Eigen::Vector3d turned =
      so3_exp({0.0, 0.5 * std::numbers::pi, 0.0}) * Eigen::Vector3d::UnitZ();
  EXPECT_THAT(turned, IsNear(Eigen::Vector3d(1.0, 0.0, 0.0), 1e-15));
}

TEST(So3, LogIsTheInverseOfExp) {
  const Eigen::Vector3d axis = Eigen::Vector3d(2.0, -1.0, 0.5).normalized();
  for (const double angle : {0.0, 1e-300, 1e-15, 1e-11, 1e-9, 9.9e-5, 1.1e-4, 0.1, 2.0, 3.1415}) {
    const Eigen::Vector3d w = angle * axis;
    EXPECT_THAT(so3_log(so3_exp(w)), IsNear(w, 1e-15 + 1e-11 * angle)) << angle;
  }
  // Beyond pi the shorter way round.
  const Eigen::Vector3d shorter = -(2.0 * std::numbers::pi - 4.0) * axis;
  EXPECT_THAT(so3_log(so3_exp(4.0 * axis)), IsNear(shorter, 1e-14));
  const Eigen::Vector3d half_turn = std::numbers::pi * axis;
  EXPECT_NEAR(so3_log(so3_exp(half_turn)).norm(), std::numbers::pi, 1e-14);
}

}  // namespace
}  // namespace stemvo
