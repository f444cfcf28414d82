// SPDX-License-Identifier: MIT
#include "evaluation/trajectory.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr char kIdentityRow[] = "1 0 0 0 0 1 0 0 0 0 1 0\n";

/// A bent path whose poses have nothing round in them.
Trajectory bent_path(int num_poses) {
  Trajectory poses;
  for (int i = 0; i < num_poses; ++i) {
    poses.emplace_back(so3_exp({0.01 * i, -0.03 * i, 0.002 * i}),
                       Eigen::Vector3d(0.1 * i * i, -0.05 * i, 1234.5 + 1.1 * i));
  }
  return poses;
}

void expect_near(const Trajectory& found, const Trajectory& expected, double tolerance) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_LE((found[i].matrix() - expected[i].matrix()).cwiseAbs().maxCoeff(), tolerance) << i;
  }
}

TEST(KittiTrajectory, ComesBackAsItWasWritten) {
  const TempFolder folder;
  const Trajectory poses = bent_path(50);
  ASSERT_TRUE(write_kitti_trajectory(folder / "poses.txt", poses));
  const Expected<Trajectory> found = read_kitti_trajectory(folder / "poses.txt");
  expect_near(*found, poses, 1e-8);
}

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

TEST(KittiTrajectory, MakesRoundedRotationsExact) {
  const TempFolder folder;
  const auto file = folder.file("a.txt", "0.9999 0 0.0141 0 0 1 0 0 -0.0141 0 0.9999 0\n");
  const Expected<Trajectory> found = read_kitti_trajectory(file);
  const Eigen::Matrix3d rotation = found->front().rotation_matrix();
  EXPECT_TRUE((rotation.transpose() * rotation).isIdentity(1e-14));
}

TEST(KittiTrajectory, ABrokenLineIsNamedWithFileAndLine) {
  const TempFolder folder;
  for (const auto& [line, complaint] :
       {std::pair("1 0 0 0 0 1 0 0 0 0 1", "expected 12 numbers, found 11"),
        {"1 1 0 0 0 0 1 0 0 0 0 1 0", "expected 12 numbers, found 13"},
        {"", "expected 12 numbers, found 0"},
        {"1 0 0 zero 0 1 0 0 0 0 1 0", "expected a finite number, found 'zero'"},
        {"1 0 0 1,5 0 1 0 0 0 0 1 0", "found '1,5'"},
        {"1 0 0 nan 0 1 0 0 0 0 1 0", "expected a finite number, found 'nan'"},
        {"1 0 0 0 0 1 0 -inf 0 0 1 0", "expected a finite number, found '-inf'"},
        {"1 0 0 1e999 0 1 0 0 0 0 1 0", "found '1e999'"},
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

TEST(KittiTrajectory, NamesAFileThatIsMissingEmptyOrAFolder) {
  const TempFolder folder;
  const auto message = [](const std::filesystem::path& file) {
    return message_of(read_kitti_trajectory(file));
  };
  EXPECT_THAT(message(folder / "none.txt"), HasSubstr("none.txt: cannot read: No such file"));
  EXPECT_THAT(message(folder.path()), HasSubstr("found a folder"));
  EXPECT_THAT(message(folder.file("empty.txt", "")), HasSubstr("empty.txt: expected at least one"));
  EXPECT_THAT(message(folder.file("blank.txt", "\n \n")), HasSubstr("expected at least one pose"));
}

TEST(KittiTrajectory, SaysThatItCannotBeWritten) {
  EXPECT_THAT(message_of(write_kitti_trajectory("/nonexistent/poses.txt", bent_path(1))),
              HasSubstr("/nonexistent/poses.txt: cannot write: "));
}

TEST(TumTrajectory, ComesBackAsItWasWritten) {
  const TempFolder folder;
  const Trajectory poses = bent_path(20);
  std::vector<double> times_s;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    times_s.push_back(0.1036224 * static_cast<double>(i));
  }
  ASSERT_TRUE(write_tum_trajectory(folder / "tum.txt", times_s, poses));
  const Expected<PoseFile> found = read_pose_file(folder / "tum.txt");
  expect_near(found->poses, poses, 1e-8);
  EXPECT_THAT(found->timestamps_s, ::testing::Pointwise(::testing::DoubleNear(1e-9), times_s));
}

TEST(RelativeToFirst, StartsAtTheIdentityAndKeepsTheMotions) {
  const Trajectory poses = bent_path(5);
  const Trajectory moved = relative_to_first(poses);
  EXPECT_EQ(moved.front().matrix(), Rigid3().matrix());
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Rigid3 before = poses[i - 1].inverse() * poses[i];
    const Rigid3 after = moved[i - 1].inverse() * moved[i];
    EXPECT_LE((before.matrix() - after.matrix()).cwiseAbs().maxCoeff(), 1e-9);
  }
  EXPECT_TRUE(relative_to_first({}).empty());
}

TEST(RescaleSteps, KeepsDirectionsAndRotationsAndTakesTheTrueLengths) {
  Trajectory estimate(4);
  estimate[1] = Rigid3(so3_exp({0, 0.1, 0}), {0, 0, 10});    // ahead, far too long
  estimate[2] = Rigid3(so3_exp({0, 0.2, 0}), {0, 0, 10});    // stands still
  estimate[3] = Rigid3(so3_exp({0, 0.3, 0}), {0.3, 0, 10});  // to the right, too short
  Trajectory truth(4);
  truth[1].translation = {0, 0, 1};
  truth[2].translation = {0, 0, 2};
  truth[3].translation = {0, 3, 6};  // 5 m
  const Trajectory rescaled = rescale_steps(estimate, truth);
  ASSERT_EQ(rescaled.size(), 4U);
  EXPECT_LE((rescaled[1].translation - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
  EXPECT_LE((rescaled[2].translation - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
  EXPECT_LE((rescaled[3].translation - Eigen::Vector3d(5, 0, 1)).norm(), 1e-12);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(rescaled[i].rotation.coeffs(), estimate[i].rotation.coeffs());
  }
  EXPECT_THROW((void)rescale_steps(estimate, Trajectory(3)), std::logic_error);
}

TEST(PoseFile, FormatsAreToldByTheirRows) {
  const TempFolder folder;
  const auto kitti = read_pose_file(folder.file("a", "1 0 0 5 0 1 0 6 0 0 1 7\n"));
  EXPECT_THAT(kitti->timestamps_s, IsEmpty());
  const auto tum = read_pose_file(folder.file("b", "# t x y z\n\n3.5 5 6 7 0 0 0 1 # here\n"));
  EXPECT_THAT(tum->timestamps_s, ElementsAre(3.5));
  EXPECT_FALSE(tum->is_of_body);
  const auto euroc = read_pose_file(folder.file("c", "#t [ns],x\n3500000000,5,6,7, 0,1,0,0, 9\n"));
  EXPECT_THAT(euroc->timestamps_s, ElementsAre(3.5));
  EXPECT_TRUE(euroc->is_of_body);
  EXPECT_EQ(euroc->poses[0].rotation.x(), 1.0) << "w comes first";
  const auto commas = read_pose_file(folder.file("d", "3.5,5,6,7,0,0,0,1 # a, b\n"));
  EXPECT_EQ(commas->poses[0].rotation.w(), 1.0);
  for (const auto& file : {*kitti, *tum, *euroc, *commas}) {
    EXPECT_EQ(file.poses.at(0).translation, Eigen::Vector3d(5, 6, 7));
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
  const auto kitti = read("1,0,0,5,0,1,0,6,0,0,1,7\n");
  EXPECT_THAT(kitti->timestamps_s, IsEmpty());
  EXPECT_EQ(kitti->poses[0].translation, Eigen::Vector3d(5, 6, 7));
  const auto tum = read("# t,x\n1700000000.5,5,6,7,0,0,0,1\n");
  EXPECT_THAT(tum->timestamps_s, ElementsAre(1700000000.5));
  EXPECT_FALSE(tum->is_of_body);
  EXPECT_EQ(tum->poses[0].rotation.w(), 1.0) << "w comes last";
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
  EXPECT_TRUE(read("#t [ns]\n1700000000500000000,5,6,7,1,0,0,0\n")->is_of_body);
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
