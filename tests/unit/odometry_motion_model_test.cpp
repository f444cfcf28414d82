// SPDX-License-Identifier: MIT
#include "odometry/motion_model.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr double kDt_s = 1.0 / 30.0;

Matrix6d noise_of(double units, double rad) {
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(units), Eigen::Vector3d::Constant(rad);
  return sigma.cwiseAbs2().asDiagonal();
}

/// A camera's motion that is seen with noise, frame by frame.
struct Followed {
  MotionModel model;
  Rigid3 truth;
  Rigid3 pose;
  SceneRandom random{7};

  void step(const Rigid3& motion, double sigma, double weight) {
    truth = truth * motion;
    const Eigen::Vector2d xy = random.noise(sigma);
    const Rigid3 seen = truth * Rigid3(Eigen::Quaterniond::Identity(), {xy.x(), xy.y(), 0.0});
    const auto fused = model.fuse(pose.inverse() * seen, noise_of(sigma, 1e-4), weight, kDt_s);
    model.measured(fused.prev_from_cur, kDt_s, true);
    pose = pose * fused.prev_from_cur;
  }
  [[nodiscard]] double error() const { return (pose.translation - truth.translation).norm(); }
};

TEST(MotionModel, AtWeightZeroTheMeasurementIsTaken) {
  MotionModel model;
  const Rigid3 motion(so3_exp({0.0, 0.01, 0.02}), {0.1, 0.0, 0.5});
  const auto fused = model.fuse(motion, noise_of(0.1, 0.1), 0.0, kDt_s);
  EXPECT_LT((fused.prev_from_cur.translation - motion.translation).norm(), 1e-12);
  EXPECT_LT(fused.prev_from_cur.rotation.angularDistance(motion.rotation), 1e-12);
  EXPECT_TRUE(fused.gain.isIdentity(1e-12));
  model.measured(fused.prev_from_cur, kDt_s, true);
  EXPECT_LT((model.predict(kDt_s).translation - motion.translation).norm(), 1e-9);
}

TEST(MotionModel, ACameraThatStandsHasLessNoiseThanItsMeasurements) {
  Followed still;
  double sum = 0.0;
  for (int i = 0; i < 600; ++i) {
    still.step({}, 0.01, 1.0);
    sum += i >= 60 ? still.error() : 0.0;
  }
  EXPECT_LT(sum / 540, 0.007);  // 0.0125 as measured
  EXPECT_LT(still.error(), 0.02);
}

TEST(MotionModel, APushIsFollowed) {
  Followed camera;
  for (int i = 0; i < 120; ++i) {
    camera.step({}, 0.001, 1.0);
  }
  for (int i = 0; i < 30; ++i) {
    camera.step({Eigen::Quaterniond::Identity(), {0.02, 0.0, 0.0}}, 0.001, 1.0);
    EXPECT_LT(camera.error(), 0.012) << i;
  }
  EXPECT_LT(camera.error(), 0.004);
}

TEST(MotionModel, KeepsToTheUnitOfTheMap) {
  MotionModel one;
  MotionModel other;
  Vector6d units = Vector6d::Ones();
  SceneRandom random(3);
  for (int i = 0; i < 60; ++i) {
    if (i == 30) {
      units.head<3>().setConstant(4.0);
      other.rescale(4.0);
    }
    const Eigen::Vector2d xy = random.noise(0.01);
    Rigid3 motion(so3_exp({0.0, 0.001 * xy.y(), 0.0}), {xy.x(), 0.0, 0.02});
    Matrix6d noise = noise_of(0.01, 1e-3);
    const auto found = one.fuse(motion, noise, 0.7, kDt_s);
    motion.translation *= units.x();
    noise = units.asDiagonal() * noise * units.asDiagonal();
    const auto scaled = other.fuse(motion, noise, 0.7, kDt_s);
    EXPECT_LT(
        (scaled.prev_from_cur.translation - units.x() * found.prev_from_cur.translation).norm(),
        1e-9);
    EXPECT_LT(scaled.prev_from_cur.rotation.angularDistance(found.prev_from_cur.rotation), 1e-9);
    one.measured(found.prev_from_cur, kDt_s, true);
    other.measured(scaled.prev_from_cur, kDt_s, true);
  }
}

}  // namespace
}  // namespace stemvo
