// SPDX-License-Identifier: MIT
#include "odometry/pair_estimator.hpp"
#include "support/estimator_run.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

struct Driven {
  DriveTracks drive;
  PairEstimator estimator{config_without_scale(OdometryMode::kTwoFrame), drive.camera};
  EstimatorRun run{estimator, drive};

  explicit Driven(DriveTracks tracks = DriveTracks(20, 0.1, 41)) : drive(std::move(tracks)) {}

  [[nodiscard]] Rigid3 last_motion() const {
    const std::vector<Rigid3>& poses = estimator.trajectory();
    return poses[poses.size() - 2].inverse() * poses.back();
  }
};

TEST(PairEstimator, EveryMeasuredStepIsOneUnitAndPosesStayAsTheyCame) {
  Driven d;
  d.run.add_all();
  EXPECT_EQ(d.run.state(0), FrameState::kFirst);
  EXPECT_EQ(d.run.state(1), FrameState::kInitializing);
  EXPECT_EQ(d.run.count(FrameState::kTracking), 18);
  EXPECT_LT(fitted_error_share(d.estimator.trajectory(), d.drive.world_from_camera), 0.01);
  EXPECT_LT(rotation_error_rad(d.estimator.trajectory(), d.drive.world_from_camera), 0.01);
  EXPECT_NEAR(d.last_motion().translation.norm(), 1.0, 1e-9);
  const std::vector<Rigid3>& poses = d.estimator.trajectory();
  ASSERT_EQ(poses.size(), d.drive.world_from_camera.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(poses[i].translation, d.run.results[i].world_from_camera.translation);
  }
  EXPECT_TRUE(d.estimator.landmarks_since(0).landmarks.empty());
}

TEST(PairEstimator, MissingImagesBeforeTheFirstOneAreNoStart) {
  Driven d;
  EXPECT_EQ(d.run.add_missing().state, FrameState::kNoImage);
  EXPECT_EQ(d.run.add(0).state, FrameState::kFirst);
  EXPECT_EQ(d.run.add(1).state, FrameState::kInitializing);
  EXPECT_EQ(d.run.add(2).state, FrameState::kTracking);
}

TEST(PairEstimator, StationaryAndTurningHoldThePosition) {
  std::vector<Rigid3> path = DriveTracks::repeat(Rigid3({1.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 1.0}), 8);
  const Rigid3 turn(so3_exp({0.0, 0.04, 0.0}), Eigen::Vector3d::Zero());
  path = DriveTracks::go_on(DriveTracks::go_on(path, Rigid3(), 4), turn, 4);
  Driven d(DriveTracks(path, points_along(path, 1500, 42), 0.02, 42));
  d.run.add_all();
  for (int i = 8; i < d.drive.num_frames(); ++i) {
    EXPECT_EQ(d.run.state(i), i < 12 ? FrameState::kStationary : FrameState::kRotating) << i;
    EXPECT_EQ((d.estimator.trajectory()[static_cast<std::size_t>(i)].translation -
               d.estimator.trajectory()[7].translation)
                  .norm(),
              0.0);
  }
  EXPECT_NEAR(d.estimator.trajectory().back().angle_rad(), 0.16, 1e-3);
}

}  // namespace
}  // namespace stemvo
