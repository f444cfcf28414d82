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
Trajectory circle(int num_poses, double yaw_rad) {
  Trajectory poses(1);
  const Rigid3 step(so3_exp({0, yaw_rad, 0}), {0, 0, 1.0});
  for (int i = 1; i < num_poses; ++i) {
    poses.push_back(poses.back() * step);
  }
  return poses;
}

// A segment of nominally L metres ends at the first frame beyond L: L + 1 m with steps of 1 m. 1 %
// too long a step is an error of 0.01 (L + 1) m over L m.
TEST(Evaluate, OnePercentOfScaleIsOnePercentOfTranslation) {
  const Metrics metrics = evaluate({straight(1001, 1.01), straight(1001, 1.0)});
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
  const Metrics metrics = evaluate({circle(151, 0.01 * kDeg), circle(151, 0.0)});
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
  const Metrics metrics = evaluate({estimate, straight(106, 1.0)});
  EXPECT_EQ(metrics.num_segments, 1);
  EXPECT_NEAR(metrics.t_rel_percent.value(), 0.0, 1e-9);
  EXPECT_NEAR(metrics.r_rel_deg_per_100m.value(), 10.0, 1e-9);
}

TEST(Evaluate, PathsUnderHundredMetresTakeShortSegments) {
  const Metrics metrics = evaluate({straight(61, 0.98), straight(61, 1.0)});
  EXPECT_THAT(metrics.segment_lengths_m, ::testing::ElementsAre(10, 20, 30, 40, 50));
  EXPECT_NEAR(metrics.t_rel_percent.value(), 2.0, 0.2);
  EXPECT_EQ(evaluate({straight(101, 1.0), straight(101, 1.0)}).segment_lengths_m.front(), 100.0);
}

TEST(Evaluate, SegmentLengthsAskedForAreTaken) {
  EvaluationOptions options{.segment_lengths_m = {25.0}};
  const Metrics metrics = evaluate({straight(41, 1.0), straight(41, 1.0)}, options);
  EXPECT_THAT(metrics.segment_lengths_m, ::testing::ElementsAre(25));
  EXPECT_EQ(metrics.num_segments, 2);  // 0 -> 26, 10 -> 36
}

TEST(Evaluate, NoSegmentFitsMeansNoNumber) {
  for (const int num_poses : {1, 2, 5}) {
    const Metrics metrics = evaluate({straight(num_poses, 1.0), straight(num_poses, 1.0)});
    EXPECT_FALSE(metrics.t_rel_percent.has_value()) << num_poses;
    EXPECT_FALSE(metrics.r_rel_deg_per_100m.has_value()) << num_poses;
    EXPECT_EQ(metrics.num_segments, 0);
    EXPECT_EQ(metrics.ate_rmse.sim3_m, 0.0);
  }
}

TEST(Evaluate, OffsetTakesXAndZAndLeavesHeightOut) {
  Trajectory truth(2);
  Trajectory estimate(2);
  estimate[1].translation = {3.0, 100.0, -5.0};
  EXPECT_NEAR(evaluate({estimate, truth}).average_offset_m, (3.0 + 5.0) / 2.0, 1e-12);
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
}

Trajectory shared_poses(const std::string& name) {
  const Expected<Trajectory> poses = read_kitti_trajectory(shared_data() / name);
  EXPECT_TRUE(poses) << poses.error().message;
  return poses.value_or(Trajectory(1));
}

// Published: stereo ORB-SLAM2 has 0.70 % and 0.25 deg per 100 m on sequence 00 with the devkit.
TEST(EvaluateOnSharedData, StereoOrbSlam2OnSequence00ScoresAsPublished) {
  STEMVO_NEEDS_SHARED_DATA();
  const Metrics metrics = evaluate(
      {shared_poses("peers/orbslam2_stereo_lc/00.txt"), shared_poses("full_poses/00.txt")});
  EXPECT_NEAR(metrics.t_rel_percent.value(), 0.71, 0.005);
  EXPECT_NEAR(metrics.r_rel_deg_per_100m.value(), 0.255, 0.0005);
  EXPECT_NEAR(metrics.path_length_m, 3724.0, 1.0);
}

constexpr char kIdentityRow[] = "1 0 0 0 0 1 0 0 0 0 1 0\n";

TEST(KittiTrajectory, HasTwelveNumbersSingleSpacesAndNineDigits) {
  const TempFolder folder;
  ASSERT_TRUE(write_kitti_trajectory(
      folder / "poses.txt", Trajectory{Rigid3(so3_exp({0, 0, 0}), {-0.0, 1.0 / 3.0, -2.0})}));
  const std::string text = read_all(folder / "poses.txt");
  EXPECT_THAT(text, HasSubstr(" 3.33333333"));
  EXPECT_EQ(text.find("-0.0"), std::string::npos) << text;
  EXPECT_EQ(text.find("  "), std::string::npos) << text;
  EXPECT_EQ(text.find(" \n"), std::string::npos) << text;
  EXPECT_EQ(std::count(text.begin(), text.end(), ' '), 11) << text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
}

TEST(KittiTrajectory, ReadsWindowsLineEndsTabsAndEmptyLinesAtTheEnd) {
  const TempFolder folder;
  const auto file =
      folder.file("a.txt", "1 0 0 0 0 1 0 0 0 0 1 0\r\n+1\t0 0 5 0 1 0 0 0 0 1 7\r\n\n \n");
  const Expected<Trajectory> found = read_kitti_trajectory(file);
  ASSERT_EQ(found->size(), 2U);
  EXPECT_EQ((*found)[1].translation, Eigen::Vector3d(5, 0, 7));
}

TEST(KittiTrajectory, ABrokenLineIsNamedWithFileAndLine) {
  const TempFolder folder;
  for (const auto& [line, complaint] :
       {std::pair("1 0 0 0 0 1 0 0 0 0 1", "expected 12 numbers, found 11"),
        {"1 1 0 0 0 0 1 0 0 0 0 1 0", "expected 12 numbers, found 13"},
        {"", "expected 12 numbers, found 0"},
        {"1 0 0 zero 0 1 0 0 0 0 1 0", "expected a finite number, found 'zero'"},
        {"2 0 0 0 0 1 0 0 0 0 1 0", "R^T R off the identity by 3"},
        {"0 0 0 0 0 0 0 0 0 0 0 0", "expected a rotation"},
        {"1 0 0 0 0 1 0 0 0 0 -1 0", "found a reflection"}}) {
    const auto file =
        folder.file("broken.txt", std::string(kIdentityRow) + line + "\n" + kIdentityRow);
    const std::string message = message_of(read_kitti_trajectory(file));
    EXPECT_THAT(message, AllOf(HasSubstr(file.string() + ":2: "), HasSubstr(complaint)));
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

TEST(PoseFile, ErrorsNameFileAndLine) {
  const TempFolder folder;
  const auto error_of = [&](const std::string& text) {
    return message_of(read_pose_file(folder.file("poses", text)));
  };
  EXPECT_THAT(error_of("# [ns]\n1,2,3,4,1,0,0,0\n1,2,3\n"),
              HasSubstr("poses:3: expected time, x, y, z, qw, qx, qy, qz, .., found 3 numbers"));
  EXPECT_THAT(error_of("1,2,3,4,2,0,0,0\n"), HasSubstr("poses:1: expected a quaternion"));
  EXPECT_THAT(error_of("1,2,x,4,1,0,0,0\n"), HasSubstr("poses:1: expected"));
  EXPECT_THAT(error_of("# x\n1 2 3\n"), HasSubstr("poses:2: expected 8 numbers, found 3"));
  EXPECT_THAT(error_of("# t\n\n1.5 1 2 3 0 0 1\n"), HasSubstr("poses:3: expected 8 numbers"));
  EXPECT_THAT(error_of("1 1 2 3 0 0 0 1\n1 1 2 3 0 0 1 1\n"),
              HasSubstr("poses:2: expected a quaternion of length 1"));
  EXPECT_THAT(error_of("1 2 3\n"), HasSubstr("poses:1: expected 12 numbers, found 3"));
  EXPECT_THAT(error_of("#t,x\n"), HasSubstr("poses: expected at least one pose"));
  EXPECT_THAT(error_of(""), HasSubstr("poses: expected at least one pose"));
}

TEST(PoseFile, NumbersBetweenCommasAndNamesInComments) {
  const TempFolder folder;
  const auto read = [&](const std::string& text) { return read_pose_file(folder.file("p", text)); };
  EXPECT_THAT(read("1700000000500000000,5,6,7,0,0,0,1\n").error().message,
              AllOf(HasSubstr("TUM's rows"), HasSubstr("EuRoC's")));
  EXPECT_THAT(message_of(read("#t [s], q_RS_w, q_RS_x\n1.25,5,6,7,1,0,0,0\n")),
              HasSubstr("qw before qx in a comment"));
  for (const char* names : {"orientation.w orientation.x orientation.y orientation.z", "w x y z",
                            "QW QX QY QZ", "q0 q1 q2 q3"}) {
    EXPECT_THAT(message_of(read(fmt::format("# t x y z {}\n1.5 5 6 7 1 0 0 0\n", names))),
                HasSubstr("qw before qx in a comment"));
  }
  EXPECT_TRUE(read("# w.r.t. the first camera: t x y z qx qy qz qw\n1.5 5 6 7 0 0 0 1\n"));
  for (const char* row : {"#t [ns]\n1700000000500000000,5,6,7,1,0,0,0\n",
                          "#t, q_RS_w [], q_RS_x []\n1700000000500000000,5,6,7,1,0,0,0\n",
                          "#t, q_RS_w [], q_RS_x []\n1700000000500000000,5,6,7,1,0,0,0,9\n"}) {
    EXPECT_TRUE(read(row)->is_of_body);
  }
  EXPECT_THAT(message_of(read("0,5,6,7,1,0,0,0\n50000000,5,6,7,1,0,0,0\n")),
              AllOf(HasSubstr("TUM's rows"), HasSubstr("EuRoC's"), HasSubstr("steps of 5e+07")));
  EXPECT_THAT(message_of(read("1.25,5,6,7,1,0,0,0,9\n1.75,5,6,7,1,0,0,0,9\n")),
              AllOf(HasSubstr("taken for EuRoC's rows"), HasSubstr("found steps of 0.5")));
}

TEST(PoseFile, PosesAreInTheOrderOfTheirTimes) {
  const TempFolder folder;
  const auto file =
      read_pose_file(folder.file("t", "2 2 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n3 3 0 0 0 0 0 1\n"));
  ASSERT_TRUE(file);
  EXPECT_THAT(file->timestamps_s, ElementsAre(1, 2, 3));
  EXPECT_EQ(file->poses[0].translation.x(), 1.0);
  EXPECT_EQ(file->poses[1].translation.x(), 2.0);
}

TEST(PairByTime, EachIsTheOthersNearest) {
  const std::vector<double> frames = {0.0, 1.0, 1.004, 2.0, 9.0};
  const std::vector<double> poses = {-5.0, 0.009, 1.003, 1.5, 2.011};
  const TimePairs pairs = pair_by_time(frames, poses, 0.01);
  EXPECT_THAT(pairs.first, ElementsAre(0, 2)) << "1.0 has lost its pose to 1.004";
  EXPECT_THAT(pairs.second, ElementsAre(1, 2));
  EXPECT_THAT(pair_by_time(frames, poses, 0.02).first, ElementsAre(0, 2, 3));
  EXPECT_THAT(pair_by_time(frames, {}, 1.0).first, IsEmpty());
  EXPECT_THAT(pair_by_time({}, poses, 1.0).first, IsEmpty());
}

}  // namespace
}  // namespace stemvo
