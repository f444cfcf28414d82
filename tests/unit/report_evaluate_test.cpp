// SPDX-License-Identifier: MIT
#include <nlohmann/json.hpp>

#include "report/evaluate_report.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

Trajectory circle(int num_poses, double step_m) {
  Trajectory poses(1);
  for (int i = 1; i < num_poses; ++i) {
    poses.push_back(poses.back() * Rigid3(so3_exp({0, 0.01, 0}), {0, 0, step_m}));
  }
  return poses;
}

/// Truth of 299 m; an estimate that is 2 % too long, as KITTI and as TUM.
struct Files {
  TempFolder folder;
  std::filesystem::path truth = folder / "truth.txt";
  std::filesystem::path kitti = folder / "estimate.txt";
  std::filesystem::path tum = folder / "estimate_tum.txt";
  std::vector<double> times_s = std::vector<double>(300);

  Files() {
    const Trajectory estimate = circle(300, 1.02);
    for (std::size_t i = 0; i < 300; ++i) {
      times_s[i] = 0.1 * static_cast<double>(i);
    }
    EXPECT_TRUE(write_kitti_trajectory(truth, circle(300, 1.0)));
    EXPECT_TRUE(write_kitti_trajectory(kitti, estimate));
    EXPECT_TRUE(write_tum_trajectory(tum, times_s, estimate));
  }
};

TEST(EvaluateFiles, ScoresKittiAndTumAlikeAndAddsTheNullRow) {
  const Files files;
  const auto report = evaluate_files({files.truth, {files.kitti, files.tum}, Alignment::kNone});
  ASSERT_EQ(report->rows.size(), 2U);
  EXPECT_EQ(report->num_poses, 300U);
  const Metrics& metrics = report->rows[0].metrics;
  EXPECT_NEAR(metrics.t_rel_percent.value(), 2.0, 0.2);
  EXPECT_GT(metrics.average_offset_m, 0.5);
  EXPECT_NEAR(report->rows[1].metrics.average_offset_m, metrics.average_offset_m, 1e-6);
  EXPECT_EQ(report->zero_motion.metrics.average_offset_m, metrics.null_offset_m);
}

TEST(EvaluateFiles, AppliesTheAlignment) {
  const Files files;
  for (const Alignment alignment : {Alignment::kScale, Alignment::kSim3}) {
    const auto report = evaluate_files({files.truth, {files.kitti}, alignment});
    const Metrics& metrics = report->rows[0].metrics;
    EXPECT_EQ(metrics.alignment, alignment);
    EXPECT_LE(metrics.t_rel_percent.value(), 1e-6);
    EXPECT_LE(metrics.average_offset_m, 1e-6);
    EXPECT_GT(metrics.ate_rmse.none_m, 0.5) << "stays that of the file as it is";
  }
  // SE(3) puts the circle's centre right: the offset gets smaller only if the fit is kept.
  const auto none = evaluate_files({files.truth, {files.kitti}, Alignment::kNone});
  const auto se3 = evaluate_files({files.truth, {files.kitti}, Alignment::kSe3});
  ASSERT_TRUE(none && se3);
  EXPECT_NEAR(se3->rows[0].metrics.t_rel_percent.value(),
              none->rows[0].metrics.t_rel_percent.value(), 1e-6);
  EXPECT_LT(se3->rows[0].metrics.average_offset_m, 0.8 * none->rows[0].metrics.average_offset_m);
}

TEST(EvaluateFiles, NamesTheFileThatDoesNotFit) {
  const Files files;
  const auto message = [&](const std::filesystem::path& estimate) {
    return message_of(evaluate_files({files.truth, {files.kitti, estimate}, Alignment::kNone}));
  };
  const auto one = files.folder.file("one.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  EXPECT_THAT(message(one), HasSubstr("one.txt: expected 300 poses as in "));
  EXPECT_THAT(message(one), HasSubstr("found 1 (poses are compared line by line"));
  const auto tum = files.folder.file("tum.txt", "# TUM\n0.5 0 0 0 0 0 0 1\n");
  EXPECT_THAT(message(tum), HasSubstr("unless both files have times"));
}

TEST(EvaluateFiles, FramesTakePartOfTheGroundTruth) {
  const Files files;
  const Trajectory estimate = circle(300, 1.02);
  const auto part = files.folder / "part.txt";  // what a run of frames 100:250 wrote
  ASSERT_TRUE(write_kitti_trajectory(part, {estimate.begin() + 100, estimate.begin() + 250}));
  EvaluationRequest request{files.truth, {files.kitti, part}};
  request.frames = {100, 250};
  const auto report = evaluate_files(request);
  EXPECT_EQ(report->num_poses, 150U);
  for (const EvaluationRow& row : report->rows) {
    EXPECT_EQ(row.num_pairs, 150U);
    EXPECT_NEAR(row.metrics.path_length_m, 149.0, 1e-3);
    EXPECT_NEAR(row.metrics.average_offset_m, report->rows[0].metrics.average_offset_m, 1e-6);
  }
  request.frames = {100, 240};
  EXPECT_THAT(evaluate_files(request).error().message, HasSubstr("part.txt: expected 140 poses"));
  request.frames = {100, 301};
  EXPECT_THAT(evaluate_files(request).error().message, HasSubstr("expected frames inside 0:300"));
}

TEST(EvaluateFiles, FilesWithTimesAreMatchedByTime) {
  const Files files;
  const Trajectory truth = circle(300, 1.0);
  // Every second pose of the estimate, 4 ms late; the last one far behind the ground truth.
  std::vector<double> times_s;
  Trajectory estimate;
  for (std::size_t i = 1; i < 300; i += 2) {
    times_s.push_back(files.times_s[i] + 0.004);
    estimate.push_back(truth[i]);
  }
  times_s.push_back(99.0);
  estimate.emplace_back();
  ASSERT_TRUE(write_tum_trajectory(files.folder / "truth_tum.txt", files.times_s, truth));
  ASSERT_TRUE(write_tum_trajectory(files.tum, times_s, estimate));
  EvaluationRequest request{files.folder / "truth_tum.txt", {files.tum}};
  const auto report = evaluate_files(request);
  EXPECT_EQ(report->rows[0].num_pairs, 150U);
  EXPECT_EQ(report->rows[0].num_poses, 151U);
  EXPECT_LT(report->rows[0].metrics.ate_rmse.none_m, 1e-6);
  EXPECT_THAT(format_evaluation_table(*report),
              HasSubstr("estimate_tum.txt: 1 of 151 poses have no true pose of their time\n"));
  EXPECT_THAT(format_evaluation_table(*report),
              HasSubstr("a pose for 150 of 300 true ones: steps are those between them\n"));
  request.tolerance_s = 0.003;
  const auto none = evaluate_files(request);
  EXPECT_THAT(none.error().message, HasSubstr("at least 2 poses within 0.003 s"));
  EXPECT_THAT(none.error().message, HasSubstr("0.000 to 29.900 s, the others of 0.104 to 99.000"));
}

TEST(EvaluateFiles, PosesOfAnotherConventionAreNamed) {
  const Files files;
  const auto doubt_of = [&](const auto& convert) {
    Trajectory poses = circle(300, 0.5);  // in units
    std::ranges::transform(poses, poses.begin(), convert);
    EXPECT_TRUE(write_kitti_trajectory(files.kitti, poses));
    return evaluate_files({files.truth, {files.kitti}})->rows[0].doubt.value_or("none");
  };
  const auto of_axes = [](const Eigen::Matrix3d& axes_from_camera) {
    const Rigid3 turn = Rigid3::from_matrix(axes_from_camera, {0, 0, 0});
    return [turn](const Rigid3& pose) { return Rigid3(turn * pose * turn.inverse()); };
  };
  const Eigen::Matrix3d robot{{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}};
  const Eigen::Matrix3d opengl{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  EXPECT_EQ(doubt_of([](const Rigid3& pose) { return pose; }), "none");
  EXPECT_EQ(doubt_of([](const Rigid3&) { return Rigid3(); }), "none");
  EXPECT_THAT(doubt_of([](const Rigid3& pose) { return pose.inverse(); }),
              HasSubstr("camera_from_world"));
  EXPECT_THAT(doubt_of(of_axes(robot)), HasSubstr("x forward, y left, z up"));
  EXPECT_THAT(doubt_of(of_axes(opengl)), HasSubstr("x right, y up, z backward"));
  EXPECT_THAT(doubt_of([](const Rigid3& pose) {
                const auto& q = pose.rotation;  // as a file's x y z w are where w is written first
                return Rigid3(Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()), pose.translation);
              }),
              HasSubstr("w first"));
  EXPECT_THAT(format_evaluation_table(*evaluate_files({files.truth, {files.kitti}})),
              HasSubstr("warning: "));
}

TEST(EvaluateFiles, TheTruthOfEurocIsTheBodys) {
  const TempFolder folder;
  const Rigid3 body_from_camera(so3_exp({0, 0, M_PI / 2}), {0.1, 0.2, 0.3});
  Trajectory camera;
  std::vector<double> times_s;
  std::string csv = "#timestamp [ns], p_RS_R_x [m], ...\n";
  for (int i = 0; i < 50; ++i) {
    const Rigid3 body(so3_exp({0.02 * i, 0, 0}), {0.1 * i, 0, 0});
    camera.push_back(body * body_from_camera);
    times_s.push_back(1403715273.0 + 0.05 * i);
    const Eigen::Quaterniond& q = body.rotation;
    csv += fmt::format("{},{},0,0,{},{},{},{},0.5,0,0,1,1,1,2,2,2\n",
                       1403715273000000000 + 50000000LL * i, 0.1 * i, q.w(), q.x(), q.y(), q.z());
  }
  const auto estimate = folder / "estimate.txt";
  ASSERT_TRUE(write_tum_trajectory(estimate, times_s, camera));
  std::filesystem::create_directories(folder / "mav0/state_groundtruth_estimate0");
  std::filesystem::create_directories(folder / "mav0/cam0");
  const auto truth = folder.file("mav0/state_groundtruth_estimate0/data.csv", csv);
  const std::string keys =
      "resolution: [64, 48]\nintrinsics: [50, 50, 31, 23]\ndistortion_model: none\n";
  const auto no_body = evaluate_files({truth, {estimate}});
  EXPECT_THAT(no_body.error().message, HasSubstr("data.csv: expected a camera file with T_BS"));
  (void)folder.file("mav0/cam0/sensor.yaml",
                    keys + "T_BS: {data: [0,-1,0,0.1, 1,0,0,0.2, 0,0,1,0.3]}\n");
  const auto report = evaluate_files({truth, {estimate}});
  EXPECT_EQ(report->rows[0].num_pairs, 50U);
  EXPECT_LT(report->rows[0].metrics.ate_rmse.none_m, 1e-6);
  EXPECT_LT(report->rows[0].metrics.rpe_rotation_deg, 1e-4);
  EXPECT_FALSE(evaluate_files({.ground_truth = truth,
                               .estimates = {estimate},
                               .camera_file = folder.file("c.yaml", keys)}));
}

TEST(EvaluateFiles, TableAndJsonSayTheSame) {
  const Files files;
  const auto report = evaluate_files({files.truth, {files.kitti}, Alignment::kScale});
  ASSERT_TRUE(report);
  const std::string table = format_evaluation_table(*report);
  EXPECT_THAT(table, ::testing::ContainsRegex("alignment +scale"));
  EXPECT_THAT(table, ::testing::ContainsRegex("estimate.txt +0\\.00 "));
  EXPECT_THAT(table, HasSubstr("(zero motion)"));
  EXPECT_THAT(table, HasSubstr("segments of 100..800 m"));

  const auto json = evaluation_document(*report);
  EXPECT_EQ(json["alignment"], "scale");
  EXPECT_EQ(json["poses"], 300);
  ASSERT_EQ(json["estimates"].size(), 1U);
  EXPECT_EQ(json["estimates"][0]["file"], files.kitti.string());
  EXPECT_EQ(json["estimates"][0]["t_rel_percent"].get<double>(),
            report->rows[0].metrics.t_rel_percent.value());
  EXPECT_EQ(json["zero_motion"]["average_offset_m"].get<double>(),
            report->zero_motion.metrics.null_offset_m);
}

}  // namespace
}  // namespace stemvo
