// SPDX-License-Identifier: MIT
#include "evaluation/pose_file.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

TEST(PoseFile, FormatsAreToldByTheirRows) {
  const TempFolder folder;
  const auto kitti = read_pose_file(folder.file("a", "1 0 0 5 0 1 0 6 0 0 1 7\n"));
  EXPECT_THAT(kitti->timestamps_s, IsEmpty());
  const auto tum = read_pose_file(folder.file("b", "# t x y z\n3.5 5 6 7 0 0 0 1\n"));
  EXPECT_THAT(tum->timestamps_s, ElementsAre(3.5));
  EXPECT_FALSE(tum->is_of_body);
  const auto euroc = read_pose_file(folder.file("c", "#t [ns],x\n3500000000,5,6,7, 0,1,0,0, 9\n"));
  EXPECT_THAT(euroc->timestamps_s, ElementsAre(3.5));
  EXPECT_TRUE(euroc->is_of_body);
  EXPECT_EQ(euroc->poses[0].rotation.x(), 1.0) << "w comes first";
  for (const auto& file : {*kitti, *tum, *euroc}) {
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
  EXPECT_THAT(error_of("1 2 3\n"), HasSubstr("poses:1: expected 12 numbers, found 3"));
  EXPECT_THAT(error_of("#t,x\n"), HasSubstr("poses: expected at least one pose"));
  EXPECT_THAT(error_of(""), HasSubstr("poses: expected at least one pose"));
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
