// SPDX-License-Identifier: MIT
#include "odometry/self_calibration.hpp"
#include "support/synthetic_drive_tracks.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr int kLength = SelfCalibration::kNumKeyframes;
constexpr int kNumRuns = 12;

/// The k-th run: of equal steps but for how they turn (prev_from_cur).
template <typename Turn>
void observe_run(int k,
                 const Turn& turn,
                 const Eigen::Vector3d& step,
                 const std::vector<Eigen::Vector3d>& points,
                 const Camera& true_camera,
                 SelfCalibration& calibration,
                 const Eigen::Vector2d& radial = Eigen::Vector2d::Zero()) {
  std::vector<Rigid3> path(1);
  for (int i = 1; i < kLength; ++i) {
    path.push_back(path.back() * Rigid3(so3_exp(turn(i)), step));
  }
  const DriveTracks drive(path, points, 0.1, static_cast<std::uint64_t>(k), true_camera);
  RadialLens next = calibration.lens();
  for (int i = 0; i < kLength; ++i) {
    const RadialLens lens = std::exchange(next, calibration.lens());  // as it was a keyframe before
    Keyframe keyframe{kLength * k + i, drive.pose(i), {}};
    for (const auto& [id, uv] : drive.observations[static_cast<std::size_t>(i)]) {
      const Eigen::Vector2d frame_uv = radial_lens(true_camera, radial).distort(uv);
      keyframe.points.push_back({id, lens.undistort(frame_uv)});
    }
    const Camera before = calibration.camera();
    calibration.observe(keyframe, lens.k, {});
    constexpr double kMaxStep_px = 0.25 + 1e-9;  // the window can follow
    EXPECT_LE(std::abs(calibration.camera().cx_px - before.cx_px), kMaxStep_px);
    EXPECT_LE(std::abs(calibration.camera().cy_px - before.cy_px), kMaxStep_px);
    EXPECT_LE(std::abs(calibration.camera().fx_px - before.fx_px), kMaxStep_px * 1.05);
  }
}

/// Runs of a drive with turns, seen by the true camera.
void drive_runs(const Camera& true_camera,
                SelfCalibration& calibration,
                const Eigen::Vector2d& radial = Eigen::Vector2d::Zero()) {
  for (int k = 0; k < kNumRuns; ++k) {
    const auto turn = [k](int i) {
      return Eigen::Vector3d(0.004 * (i % 3 - 1), k % 2 == 0 ? 0.05 : -0.04, 0.0);
    };
    observe_run(k, turn, {0.0, 0.0, 0.9}, DriveTracks(2, 0.0, static_cast<std::uint64_t>(k)).points,
                true_camera, calibration, radial);
  }
}

/// Runs through a room, the camera in the hand: it turns and rolls much, which tells the focal
/// length.
void walk_runs(const Camera& true_camera, SelfCalibration& calibration) {
  for (int k = 0; k < kNumRuns; ++k) {
    const auto turn = [k](int i) {
      return Eigen::Vector3d(0.06 * std::sin(i), k % 2 == 0 ? 0.08 : -0.08, 0.1 * std::cos(i));
    };
    observe_run(k, turn, {0.05, 0.02, 0.05},
                points_of_room(4000, 4.0, static_cast<std::uint64_t>(k)), true_camera, calibration);
  }
}

class SelfCalibrationTest : public ::testing::Test {
 protected:
  const Camera truth_ = kitti_camera();
  Camera given_ = truth_;
};

TEST_F(SelfCalibrationTest, FindsAPrincipalPointThatIsWrong) {
  given_.cx_px += 3.0;
  given_.cy_px -= 2.0;
  SelfCalibration calibration(given_, CameraRefinement::kPrincipalPoint);
  drive_runs(truth_, calibration);
  EXPECT_NEAR(calibration.camera().cx_px, truth_.cx_px, 0.5);
  EXPECT_NEAR(calibration.camera().cy_px, truth_.cy_px, 0.5);
  EXPECT_EQ(calibration.camera().fx_px, given_.fx_px);
  const CameraSigma sigma = *calibration.camera_sigma();
  EXPECT_LE(sigma.cy_px, 0.5);
  EXPECT_LT(sigma.cx_px, 0.9 * sigma.cy_px) << "the drive turns more than it pitches";
  EXPECT_LT(sigma.fx_px, 0.5 * 3.0 * 0.003 * given_.fx_px) << "estimated, though not applied";
}

TEST_F(SelfCalibrationTest, FindsAFocalLengthThatIsWrongWithinItsSigma) {
  for (const double share : {0.97, 1.03}) {
    given_ = truth_;
    given_.fx_px *= share;
    given_.fy_px *= share;
    SelfCalibration calibration(given_, CameraRefinement::kAll);
    walk_runs(truth_, calibration);
    const double sigma_px = calibration.camera_sigma()->fx_px;
    EXPECT_LT(sigma_px, 0.01 * truth_.fx_px);
    EXPECT_LT(std::abs(calibration.camera().fx_px - truth_.fx_px), 2.0 * sigma_px);
    EXPECT_NEAR(calibration.camera().fy_px / truth_.fy_px,
                calibration.camera().fx_px / truth_.fx_px, 1e-12);
  }
}

/// Errors of a real track are alike, so sigmas are far from what independent ones, as here, make:
/// they are doubled, and robust weights and the error before the solve do the rest.
TEST_F(SelfCalibrationTest, IndependentErrorsAreFarWithinTheSigma) {
  constexpr int kNumDrives = 12;
  double sum_sq = 0.0;
  for (int k = 0; k < kNumDrives; ++k) {
    SelfCalibration calibration(truth_, CameraRefinement::kPrincipalPoint);
    const auto turn = [](int i) { return Eigen::Vector3d(0.004 * (i % 3 - 1), 0.05, 0.0); };
    observe_run(k, turn, {0.0, 0.0, 0.9}, DriveTracks(2, 0.0, static_cast<std::uint64_t>(k)).points,
                truth_, calibration);
    const CameraEstimate estimate = *calibration.estimate();
    sum_sq += estimate.change.cwiseQuotient(estimate.sigma).head<2>().squaredNorm();
  }
  const double off_in_sigmas = std::sqrt(sum_sq / (2 * kNumDrives));
  std::cout << off_in_sigmas << " sigmas\n";
  EXPECT_GT(off_in_sigmas, 0.1);
  EXPECT_LT(off_in_sigmas, 0.25);
}

/// Which a drive does not tell: the sigma says so.
TEST_F(SelfCalibrationTest, AFocalLengthThatIsNotToldStaysWithinItsSigma) {
  given_.fx_px *= 1.03;
  given_.fy_px *= 1.03;
  SelfCalibration calibration(given_, CameraRefinement::kAll);
  drive_runs(truth_, calibration);
  EXPECT_EQ(calibration.camera().fx_px, given_.fx_px);
  EXPECT_LT(given_.fx_px - truth_.fx_px, 2.0 * calibration.camera_sigma()->fx_px);
}

TEST_F(SelfCalibrationTest, ARightCameraIsKept) {
  SelfCalibration calibration(truth_, CameraRefinement::kAll);
  drive_runs(truth_, calibration);
  EXPECT_EQ(calibration.estimate()->num_bundles, kNumRuns);
  EXPECT_EQ(calibration.camera().cx_px, truth_.cx_px);
  EXPECT_EQ(calibration.camera().cy_px, truth_.cy_px);
  EXPECT_EQ(calibration.camera().fx_px, truth_.fx_px);
  EXPECT_TRUE(calibration.radial().isZero());
}

/// What KITTI's rectified images still have: 6 px at the sides.
TEST_F(SelfCalibrationTest, FindsALensThatNobodyKnewOf) {
  const Eigen::Vector2d radial(0.0165, -0.004);
  SelfCalibration calibration(truth_, CameraRefinement::kPrincipalPoint);
  drive_runs(truth_, calibration, radial);
  const RadialLens lens = radial_lens(truth_, radial);
  for (const double u_px : {0.0, 200.0, 1000.0, 1240.0}) {
    const Eigen::Vector2d uv(u_px, 250.0);
    EXPECT_LT((calibration.lens().undistort(lens.distort(uv)) - uv).norm(), 0.5) << u_px;
  }
  SelfCalibration again(truth_, CameraRefinement::kPrincipalPoint);
  KeptKeyframe of_map;
  of_map.camera = calibration.camera();
  of_map.camera.fx_px *= 1.002;  // an adjusted map's
  of_map.radial = calibration.radial();
  again.begin_with(of_map);
  EXPECT_EQ(again.radial(), calibration.radial());
  drive_runs(truth_, again, radial);
  const Eigen::Vector2d side(0.0, 250.0);
  EXPECT_LT((again.lens().undistort(lens.distort(side)) - side).norm(), 0.5);
  given_.cx_px += 20.0;
  SelfCalibration other(given_, CameraRefinement::kPrincipalPoint);
  other.begin_with(of_map);
  EXPECT_TRUE(other.radial().isZero()) << "another camera";
}

/// However sure its runs are: as much is missed where all turns are to one side.
TEST_F(SelfCalibrationTest, ACameraThatIsHalfAPixelOffIsKept) {
  given_.cx_px += 0.5;
  SelfCalibration calibration(given_, CameraRefinement::kPrincipalPoint);
  drive_runs(truth_, calibration);
  const CameraEstimate estimate = *calibration.estimate();
  EXPECT_GT(std::abs(estimate.change[0]), 2.0 * estimate.sigma[0]);  // told for certain
  EXPECT_EQ(calibration.camera().cx_px, given_.cx_px);
}

TEST_F(SelfCalibrationTest, ARunThatWasBegunAnewOrRescaledIsMeasuredWhole) {
  const DriveTracks drive(kLength, 0.1, 5);
  const auto keyframe_of = [&](int i, double unit) {
    Keyframe keyframe{i, drive.pose(i), {}};
    keyframe.world_from_camera.translation *= unit;
    for (const auto& [id, uv] : drive.observations[static_cast<std::size_t>(i)]) {
      keyframe.points.push_back({id, uv});
    }
    return keyframe;
  };
  const Camera camera = drive.camera;
  SelfCalibration plain(camera, CameraRefinement::kAll);
  SelfCalibration rescaled(camera, CameraRefinement::kAll);
  SelfCalibration restarted(camera, CameraRefinement::kAll);
  for (int i = 0; i < kLength; ++i) {
    plain.observe(keyframe_of(i, 1.0), {0.0, 0.0}, {});
    if (i == 8) {
      rescaled.rescale(3.0, Eigen::Vector3d::Zero());
      restarted.restart();
    }
    rescaled.observe(keyframe_of(i, i < 8 ? 1.0 : 3.0), {0.0, 0.0}, {});
    restarted.observe(keyframe_of(i, 1.0), {0.0, 0.0}, {});
    EXPECT_EQ(plain.estimate()->num_bundles, i + 1 < kLength ? 0 : 1);
  }
  EXPECT_EQ(restarted.estimate()->num_bundles, 0);
  ASSERT_EQ(rescaled.estimate()->num_bundles, 1);
  EXPECT_LT((rescaled.estimate()->change - plain.estimate()->change).norm(), 0.01);
}

TEST_F(SelfCalibrationTest, OffMeansOff) {
  given_.cx_px += 3.0;
  SelfCalibration calibration(given_, CameraRefinement::kOff);
  drive_runs(truth_, calibration);
  EXPECT_EQ(calibration.camera().cx_px, given_.cx_px);
  EXPECT_FALSE(calibration.camera_sigma().has_value());
}

}  // namespace
}  // namespace stemvo
