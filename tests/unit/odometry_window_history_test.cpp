// SPDX-License-Identifier: MIT
#include "odometry/window_estimator.hpp"
#include "odometry/window_history.hpp"
#include "support/estimator_run.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// 1 m apart; all see a landmark 4 m from the first.
Window four_keyframes(WindowHistory& history, const cv::Mat& image) {
  Window window;
  for (int i = 0; i < 4; ++i) {
    Keyframe keyframe{i, Rigid3(Eigen::Quaterniond::Identity(), {1.0 * i, 0.0, 0.0}), {}};
    keyframe.points.push_back({7, {100.0, 100.0}});
    window.keyframes.push_back(keyframe);
    window.landmarks[7] = {0.0, 0.0, 4.0};
    history.observe(window, image);
  }
  history.end_frame(window);
  return window;
}

TEST(WindowHistory, ALandmarkThatTheWindowDropsIsRemoved) {
  WindowHistory history;
  const cv::Mat image(200, 200, CV_8UC1, cv::Scalar(7));
  Window window = four_keyframes(history, image);
  const LandmarkChanges before = history.changes_since(0, window);
  ASSERT_EQ(before.landmarks.size(), 1U);
  window.landmarks.clear();
  history.observe(window, image);
  history.end_frame(window);
  const LandmarkChanges after = history.changes_since(before.version, window);
  EXPECT_TRUE(after.landmarks.empty());
  EXPECT_EQ(after.removed, std::vector<int>{before.landmarks.front().id});
}

TEST(WindowHistory, ALandmarkIsKeptInTheUnitsThatItsLastKeyframeCameIn) {
  WindowHistory history;
  Window window = four_keyframes(history, cv::Mat(200, 200, CV_8UC1, cv::Scalar(7)));
  rescale(window, 2.0, Eigen::Vector3d::Zero());
  history.rescale(2.0);
  window.keyframes[0].points.clear();
  window.keyframes[2].points.clear();
  window.keyframes[3].points.clear();
  const Keyframe coming{4, Rigid3(Eigen::Quaterniond::Identity(), {4.0, 0.0, 0.0}), {}};
  history.leave(window, 1, coming);
  const LandmarkChanges kept = history.changes_since(0, window);
  ASSERT_EQ(kept.landmarks.size(), 1U);
  EXPECT_NEAR(kept.landmarks.front().in_camera.z(), 4.0, 1e-6);
  EXPECT_NEAR(kept.landmarks.front().in_camera.x(), -1.0, 1e-6);
}

TEST(WindowHistory, LandmarksThatHaveLeftAreWhereTheyWere) {
  const DriveTracks drive(40, 0.1, 24);
  WindowEstimator estimator(config_without_scale(), drive.camera);
  EstimatorRun run(estimator, drive);
  for (int i = 0; i < drive.num_frames(); ++i) {
    run.image = cv::Mat(drive.camera.height_px, drive.camera.width_px, CV_8UC3,
                        cv::Scalar(i, 2 * i, 3 * i));
    run.add(i);
  }
  const std::vector<Rigid3>& poses = estimator.trajectory();
  const double unit_m = 1.0 / length_ratio(poses, drive.world_from_camera, 0, 39);
  std::vector<double> errors;
  for (const KeptLandmark& landmark : estimator.landmarks_since(0).landmarks) {
    ASSERT_GE(landmark.frame, 0);
    ASSERT_LT(landmark.frame, drive.num_frames());
    errors.push_back(placing_error(landmark, poses, unit_m, drive));
    EXPECT_GE(landmark.rgb[0], landmark.frame);  // of the last keyframe that saw it
    EXPECT_LT(landmark.rgb[0], landmark.frame + 30);
    EXPECT_EQ(landmark.rgb[2], 3 * landmark.rgb[0]);
  }
  ASSERT_GT(errors.size(), 300U);
  std::ranges::sort(errors);
  EXPECT_LT(errors[errors.size() / 2], 0.01);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.05);
}

}  // namespace
}  // namespace stemvo
