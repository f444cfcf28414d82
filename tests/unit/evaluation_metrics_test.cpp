// SPDX-License-Identifier: MIT
#include "evaluation/metrics.hpp"
#include "evaluation/trajectory.hpp"
#include "support/shared_data.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// `num_poses` poses along z, `step_m` apart.
Trajectory straight(int num_poses, double step_m) {
  Trajectory poses(static_cast<std::size_t>(num_poses));
  for (int i = 0; i < num_poses; ++i) {
    poses[static_cast<std::size_t>(i)].translation.z() = step_m * i;
  }
  return poses;
}

/// Steps of one metre, each turned by `yaw_rad` more.
Trajectory circle(int num_poses, double yaw_rad, double step_m = 1.0) {
  Trajectory poses(1);
  const Rigid3 step(so3_exp({0, yaw_rad, 0}), {0, 0, step_m});
  for (int i = 1; i < num_poses; ++i) {
    poses.push_back(poses.back() * step);
  }
  return poses;
}

Trajectory moved(const Trajectory& poses, const Rigid3& by) {
  Trajectory result;
  for (const Rigid3& pose : poses) {
    result.push_back(by * pose);
  }
  return result;
}

TEST(Evaluate, TruthAgainstItselfIsZero) {
  const Trajectory truth = circle(500, 0.01);
  const Metrics metrics = evaluate(truth, truth);
  EXPECT_LE(metrics.t_rel_percent.value(), 1e-9);
  EXPECT_LE(metrics.r_rel_deg_per_100m.value(), 1e-9);
  EXPECT_LE(metrics.average_offset_m, 1e-12);
  EXPECT_LE(metrics.ate_rmse.none_m, 1e-12);
  EXPECT_LE(metrics.ate_rmse.sim3_m, 1e-9);
  EXPECT_LE(metrics.rpe_rotation_deg, 1e-9);
}

// A segment of nominally L metres ends at the first frame beyond L: L + 1 m with steps of 1 m. 1 %
// too long a step is an error of 0.01 (L + 1) m over L m.
TEST(Evaluate, OnePercentOfScaleIsOnePercentOfTranslation) {
  const Metrics metrics = evaluate(straight(1001, 1.01), straight(1001, 1.0));
  double sum = 0.0;
  int count = 0;
  for (int length = 100; length <= 800; length += 100) {
    for (int first = 0; first + length + 1 <= 1000; first += 10) {
      sum += 0.01 * (length + 1) / length;
      ++count;
    }
  }
  EXPECT_EQ(metrics.num_segments, count);
  EXPECT_NEAR(metrics.t_rel_percent.value(), 100.0 * sum / count, 1e-9);
  EXPECT_NEAR(metrics.t_rel_percent.value(), 1.0, 0.01);
  EXPECT_LE(metrics.r_rel_deg_per_100m.value(), 1e-9);
  EXPECT_NEAR(metrics.rpe_translation_m, 0.01, 1e-9);
  EXPECT_NEAR(metrics.path_length_m, 1000.0, 1e-9);
  EXPECT_NEAR(metrics.average_offset_m, 5.0, 1e-9);  // mean of 0 .. 10 m
  EXPECT_NEAR(metrics.null_offset_m, 500.0, 1e-9);
  EXPECT_NEAR(metrics.ate_rmse.none_m, 0.01 * std::sqrt(1000.0 * 2001.0 / 6.0), 1e-9);
  EXPECT_LE(metrics.ate_rmse.scale_m, 1e-9);
  EXPECT_LE(metrics.ate_rmse.sim3_m, 1e-9);
  EXPECT_GT(metrics.ate_rmse.se3_m, 1.0);
  EXPECT_LT(metrics.ate_rmse.se3_m, metrics.ate_rmse.none_m);
}

// Straight ahead in truth, 0.01 deg of yaw per metre in the estimate: 1 deg per 100 m, and again
// the segment is one metre longer than its name.
TEST(Evaluate, ConstantYawErrorIsItsRotationPerHundredMetres) {
  const Metrics metrics = evaluate(circle(151, 0.01 * kDeg), circle(151, 0.0));
  EXPECT_EQ(metrics.num_segments, 5);  // 100 m, starting at 0, 10, .. 40
  EXPECT_NEAR(metrics.r_rel_deg_per_100m.value(), 1.01, 1e-9);
  EXPECT_NEAR(metrics.rpe_rotation_deg, 0.01, 1e-9);
  EXPECT_GT(metrics.t_rel_percent.value(), 0.5);
}

// The devkit's error is estimate^-1 * truth: where the camera got right, looking elsewhere costs
// rotation only. The other order would charge 10 deg of a 100 m arm.
TEST(Evaluate, LookingElsewhereAtTheRightPlaceCostsNoTranslation) {
  Trajectory estimate = straight(106, 1.0);
  for (std::size_t i = 1; i < estimate.size(); ++i) {
    estimate[i].rotation = so3_exp({0.0, 10.0 * kDeg, 0.0});
  }
  const Metrics metrics = evaluate(estimate, straight(106, 1.0));
  EXPECT_EQ(metrics.num_segments, 1);
  EXPECT_NEAR(metrics.t_rel_percent.value(), 0.0, 1e-9);
  EXPECT_NEAR(metrics.r_rel_deg_per_100m.value(), 10.0, 1e-9);
}

TEST(Evaluate, PathsUnderHundredMetresTakeShortSegments) {
  const Metrics metrics = evaluate(straight(61, 0.98), straight(61, 1.0));
  EXPECT_THAT(metrics.segment_lengths_m, ::testing::ElementsAre(10, 20, 30, 40, 50));
  EXPECT_NEAR(metrics.t_rel_percent.value(), 2.0, 0.2);
  EXPECT_EQ(evaluate(straight(101, 1.0), straight(101, 1.0)).segment_lengths_m.front(), 100.0);
}

TEST(Evaluate, SegmentLengthsAskedForAreTaken) {
  EvaluationOptions options{.segment_lengths_m = {25.0}};
  const Metrics metrics = evaluate(straight(41, 1.0), straight(41, 1.0), options);
  EXPECT_THAT(metrics.segment_lengths_m, ::testing::ElementsAre(25));
  EXPECT_EQ(metrics.num_segments, 2);  // 0 -> 26, 10 -> 36
}

TEST(Evaluate, NoSegmentFitsMeansNoNumber) {
  for (const int num_poses : {1, 2, 5}) {
    const Metrics metrics = evaluate(straight(num_poses, 1.0), straight(num_poses, 1.0));
    EXPECT_FALSE(metrics.t_rel_percent.has_value()) << num_poses;
    EXPECT_FALSE(metrics.r_rel_deg_per_100m.has_value()) << num_poses;
    EXPECT_EQ(metrics.num_segments, 0);
    EXPECT_EQ(metrics.ate_rmse.sim3_m, 0.0);
  }
}

TEST(Evaluate, NeverMovingScoresTheNullOffsetAndHundredPercent) {
  const Trajectory truth = straight(1001, 1.0);
  const Metrics metrics = evaluate(Trajectory(truth.size()), truth);
  EXPECT_EQ(metrics.average_offset_m, metrics.null_offset_m);
  EXPECT_NEAR(metrics.t_rel_percent.value(), 100.0, 1.0);
}

TEST(Evaluate, OffsetTakesXAndZAndLeavesHeightOut) {
  Trajectory truth(2);
  Trajectory estimate(2);
  estimate[1].translation = {3.0, 100.0, -5.0};
  EXPECT_NEAR(evaluate(estimate, truth).average_offset_m, (3.0 + 5.0) / 2.0, 1e-12);
}

TEST(Evaluate, WhereTheFilesBeginDoesNotMatter) {
  const Trajectory truth = circle(300, 0.01, 1.003);  // no segment ends exactly on a frame
  const Trajectory estimate = circle(300, 0.0101, 1.02);
  const Metrics a = evaluate(estimate, truth);
  const Metrics b = evaluate(moved(estimate, Rigid3(so3_exp({0.3, 1.0, -0.2}), {5, 6, 7})),
                             moved(truth, Rigid3(so3_exp({-1.0, 0.1, 0.4}), {-70, 8, 9})));
  EXPECT_NEAR(a.t_rel_percent.value(), b.t_rel_percent.value(), 1e-9);
  EXPECT_NEAR(a.average_offset_m, b.average_offset_m, 1e-9);
  EXPECT_NEAR(a.ate_rmse.none_m, b.ate_rmse.none_m, 1e-9);
  EXPECT_NEAR(a.ate_rmse.sim3_m, b.ate_rmse.sim3_m, 1e-9);
}

TEST(Evaluate, RefusesUnequalAndEmptyTrajectories) {
  EXPECT_THROW((void)evaluate(Trajectory(2), Trajectory(3)), std::logic_error);
  EXPECT_THROW((void)evaluate({}, {}), std::logic_error);
}

TEST(AlignTrajectory, UndoesAPlantedSimilarity) {
  const Trajectory truth = circle(200, 0.02);
  Trajectory estimate;
  const Eigen::Quaterniond turn = so3_exp({0.2, -0.5, 0.1});
  for (const Rigid3& pose : truth) {
    estimate.emplace_back(turn * pose.rotation, turn * (0.25 * pose.translation));
  }
  // Both are moved to the identity first, so only the scale is left to find.
  const std::vector<std::size_t> frames = {30, 60, 61, 150};  // that have a true pose
  const Trajectory known = take_poses(truth, frames);
  const Rigid3 first_from_world = truth[30].inverse();
  for (const Alignment alignment : {Alignment::kScale, Alignment::kSim3}) {
    const Trajectory aligned = align_trajectory(estimate, frames, known, alignment);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const Rigid3 expected = first_from_world * truth[i];
      EXPECT_LE((aligned[i].matrix() - expected.matrix()).cwiseAbs().maxCoeff(), 1e-9);
    }
  }
  const Trajectory unscaled = align_trajectory(truth, frames, known, Alignment::kNone);
  EXPECT_EQ(unscaled[30].matrix(), Rigid3().matrix());
  EXPECT_THROW((void)align_trajectory(estimate, {}, {}, Alignment::kSim3), std::logic_error);
}

Trajectory read(const std::string& name) {
  const Expected<Trajectory> poses = read_kitti_trajectory(shared_data() / name);
  EXPECT_TRUE(poses) << poses.error().message;
  return poses.value_or(Trajectory(1));
}

// Published: stereo ORB-SLAM2 has 0.70 % and 0.25 deg per 100 m on sequence 00 with the devkit.
TEST(EvaluateOnSharedData, StereoOrbSlam2OnSequence00ScoresAsPublished) {
  STEMVO_NEEDS_SHARED_DATA();
  const Metrics metrics =
      evaluate(read("peers/orbslam2_stereo_lc/00.txt"), read("full_poses/00.txt"));
  EXPECT_NEAR(metrics.t_rel_percent.value(), 0.71, 0.005);
  EXPECT_NEAR(metrics.r_rel_deg_per_100m.value(), 0.255, 0.0005);
  EXPECT_NEAR(metrics.path_length_m, 3724.0, 1.0);
}

TEST(EvaluateOnSharedData, NeverMovingScoresAsMeasuredBefore) {
  STEMVO_NEEDS_SHARED_DATA();
  const std::pair<const char*, double> expected[] = {{"00", 345.5}, {"02", 796.7}, {"05", 240.8},
                                                     {"06", 153.8}, {"08", 367.6}, {"09", 409.7}};
  for (const auto& [sequence, offset_m] : expected) {
    const Trajectory truth = read("full_poses/" + std::string(sequence) + ".txt");
    EXPECT_NEAR(evaluate(truth, truth).null_offset_m, offset_m, 0.1) << sequence;
  }
}

}  // namespace
}  // namespace stemvo
