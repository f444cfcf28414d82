// SPDX-License-Identifier: MIT
#include "config/config.hpp"
#include "odometry/metric_scale.hpp"
#include "odometry/pair_estimator.hpp"
#include "odometry/road/image.hpp"
#include "odometry/way.hpp"
#include "odometry/window_estimator.hpp"
#include "support/estimator_run.hpp"
#include "support/road_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Straight ahead along a road whose images are rendered, past points on both sides whose tracks
/// are exact.
struct RoadDrive {
  static constexpr double kStep_m = 0.8;

  const RoadScene scene{};
  DriveTracks tracks;

  explicit RoadDrive(int num_frames) : tracks(make_tracks(num_frames)) {}

  /// Rendered once for all drives: they differ in their length alone.
  [[nodiscard]] std::shared_ptr<const RoadImage> road_image(int frame, bool has_road) const {
    static std::map<std::pair<int, bool>, std::shared_ptr<const RoadImage>> rendered;
    std::shared_ptr<const RoadImage>& image = rendered[{frame, has_road}];
    if (image == nullptr) {
      RoadScene shown = scene;
      shown.noise_gray = 1.0;
      shown.has_road = has_road;
      const cv::Mat pixels =
          render_road(shown, tracks.pose(frame).inverse(), static_cast<std::uint64_t>(frame));
      image = std::make_shared<RoadImage>(make_road_image({pixels, {}}, scene.camera));
    }
    return image;
  }

 private:
  static DriveTracks make_tracks(int num_frames) {
    SceneRandom random(11);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 800; ++i) {
      const double z = random.uniform(6.0, 60.0);
      const double y = random.uniform(-4.0, 0.5);
      points.emplace_back(random.uniform(-12.0, 12.0), y, z);
    }
    const Rigid3 step(Eigen::Quaterniond::Identity(), {0.0, 0.0, kStep_m});
    return {DriveTracks::repeat(step, num_frames), points, 0.0, 11, RoadScene().camera};
  }
};

Options metric_config(OdometryMode mode = OdometryMode::kMap) {
  Options config;
  config.odometry.mode = mode;
  config.scale.source = ScaleSource::kCameraHeight;
  return config;
}

constexpr double kStep_m = RoadDrive::kStep_m;

std::unique_ptr<Estimator> make_estimator(const Options& config, const Camera& camera) {
  if (config.odometry.mode == OdometryMode::kTwoFrame) {
    return std::make_unique<PairEstimator>(config, camera);
  }
  return std::make_unique<WindowEstimator>(config, camera);
}

double step_m(const EstimatorRun& run, int i) {
  const auto last = static_cast<std::size_t>(i);
  return (run.results[last].world_from_camera.translation -
          run.results[last - 1].world_from_camera.translation)
      .norm();
}

class MetricScaleOf : public ::testing::TestWithParam<OdometryMode> {};

TEST_P(MetricScaleOf, WithoutARoadTheLastScaleIsKeptAndItsDoubtGrows) {
  const RoadDrive drive(26);
  const auto estimator = make_estimator(metric_config(GetParam()), drive.scene.camera);
  EstimatorRun run(*estimator, drive.tracks);
  const int num_seen = 18;
  const int num_proven = 16;
  bool is_proven = false;
  run.road = [&](int i) { return drive.road_image(i, i < num_seen); };
  run.add_all();
  const double unknown = run.results[0].scale_sigma.value();
  EXPECT_EQ(run.results[0].scale_state, ScaleState::kNone);
  EXPECT_EQ(run.results[0].road_reason, "first frame");
  double last_sigma = unknown;
  for (int i = 1; i < 26; ++i) {
    const FrameResult& result = run.results[static_cast<std::size_t>(i)];
    if (step_m(run, i) == 0.0) {  // waits for parallax
      EXPECT_LT(i, 5);
      EXPECT_EQ(result.state, FrameState::kInitializing) << i;
      EXPECT_EQ(result.scale_state, ScaleState::kNone) << i;
      EXPECT_EQ(result.road_reason, "no map") << i;
    } else if (i < num_proven) {
      is_proven = is_proven || result.scale_state == ScaleState::kMeasured;
      EXPECT_EQ(result.scale_sigma == ScaleFilter::kUnknownSigma, !is_proven) << i;
      EXPECT_EQ(result.scale_state, is_proven ? ScaleState::kMeasured : ScaleState::kNone) << i;
    } else if (i < num_seen) {
      EXPECT_EQ(result.scale_state, ScaleState::kMeasured) << i << ": " << result.road_reason;
      EXPECT_EQ(result.road_reason, "");
    } else {
      EXPECT_EQ(result.scale_state, ScaleState::kHeld) << i;
      EXPECT_NE(result.road_reason, "");
      EXPECT_GT(result.scale_sigma.value(), last_sigma) << i;
      EXPECT_NEAR(step_m(run, i), kStep_m, 0.03 * kStep_m) << i;
    }
    last_sigma = result.scale_sigma.value();
  }
  EXPECT_LT(last_sigma, (GetParam() == OdometryMode::kMap ? 0.1 : 0.3) * unknown);
}

TEST_P(MetricScaleOf, ARoadThatIsNotAskedIsDisabled) {
  const RoadDrive drive(4);
  Options config = metric_config(GetParam());
  config.scale.source = ScaleSource::kConstantSpeed;
  const auto estimator = make_estimator(config, drive.scene.camera);
  EstimatorRun run(*estimator, drive.tracks);
  run.road = [&](int i) { return drive.road_image(i, true); };
  run.add_all();
  for (const FrameResult& result : run.results) {
    EXPECT_EQ(result.scale_state, ScaleState::kDisabled);
    EXPECT_FALSE(result.scale_sigma.has_value());
  }
}

TEST_P(MetricScaleOf, AnImageThatIsMissingHoldsTheScale) {
  const RoadDrive drive(20);
  const auto estimator = make_estimator(metric_config(GetParam()), drive.scene.camera);
  EstimatorRun run(*estimator, drive.tracks);
  run.road = [&](int i) { return drive.road_image(i, true); };
  run.add_range(0, 18);
  const FrameResult missing = run.add_missing();
  EXPECT_EQ(missing.state, FrameState::kNoImage);
  EXPECT_EQ(missing.scale_state, ScaleState::kHeld);
  EXPECT_EQ(missing.road_reason, "no image");
  EXPECT_GT(missing.scale_sigma, run.results[17].scale_sigma);
  EXPECT_NEAR(step_m(run, 18), kStep_m, 0.03 * kStep_m);  // the motion goes on
  const FrameResult after = run.add(19);
  EXPECT_EQ(after.scale_state, ScaleState::kMeasured) << after.road_reason;
  EXPECT_NEAR(
      after.world_from_camera.translation.z() - run.results[17].world_from_camera.translation.z(),
      2.0 * kStep_m, 0.05 * kStep_m);
}

/// A drive whose speed is given, beside a road whose height is said to be `said` times the true
/// one. Landmarks lie `ratio` times as far below the camera as the road does.
struct BesideARoad {
  double said = 1.0;
  double ratio = 1.0;
  int num_frames = 30;
  int num_speeds = 30;   ///< then they end
  int late = 0;          ///< frames
  int unknown_at = -1;   ///< the map is not known on this frame
  int wrong_from = 999;  ///< from here on the landmarks lie 1.6 times as far below

  double metres_per_m = 1.0;
  FrameResult last;
  int num_said = 0;  ///< frames that say the contradiction
  int num_new = 0;

  BesideARoad& run() {
    const RoadDrive drive(num_frames);
    Options config = metric_config();
    const double height_m = config.scale.camera_height_m;
    config.scale.camera_height_m = said * height_m;
    MetricScale scale(config);
    WayInput input{ScaleSource::kCameraHeight};
    scale.restart(drive.road_image(0, true).get(), 0.0);
    for (int i = 1; i < num_frames; ++i) {
      const int given = i - late;
      EXPECT_TRUE(given < 1 || given >= num_speeds ||
                  input.add_speed(0.1 * (given - 0.5), 10.0 * kStep_m, 0.4));
      scale.add(input.take(0.1 * i));
      const double below = (i < wrong_from ? ratio : 1.6) * height_m * metres_per_m;
      std::vector<RoadLandmark> landmarks;
      for (int k = 0; k < 8; ++k) {
        landmarks.push_back({{0.02 * k * below, below, (5.0 + 0.8 * k) * below}, 0.02});
      }
      const Rigid3 motion(Eigen::Quaterniond::Identity(), {0.0, 0.0, -kStep_m * metres_per_m});
      if (i == unknown_at) {
        scale.set_unknown("no map");
      } else {
        metres_per_m *=
            scale.measure(drive.road_image(i, true).get(), motion, 0.1 * i, 0.01, landmarks);
      }
      last = {};
      scale.report(last);
      num_said += last.road_reason == kRoadContradicted ? 1 : 0;
      num_new += last.is_scale_new ? 1 : 0;
    }
    return *this;
  }
};

TEST(MetricScale, ARoadThatIsNotProvenDoesNotBendWhatSpeedsMeasure) {
  EXPECT_NEAR((BesideARoad{.said = 1.08, .ratio = 1.6}.run().metres_per_m), 1.0, 0.01);
  BesideARoad joined{.said = 1.03};
  EXPECT_GT(joined.run().metres_per_m, 1.01) << "one that is believed is joined with them";
  EXPECT_EQ(joined.num_said, 0);
  EXPECT_GT(joined.last.scale_sigma.value_or(0.0), 0.016) << "one of them is off";
}

TEST(MetricScale, ASpeedWinsOverARoadThatContradictsItAndItIsSaid) {
  for (const double said : {0.8, 1.25}) {
    for (const int late : {0, 20}) {
      BesideARoad apart{.said = said, .num_frames = late + 35, .num_speeds = 99, .late = late};
      apart.run();
      EXPECT_EQ(apart.last.road_reason, kRoadContradicted) << said << ", " << late;
      EXPECT_GE(apart.num_said, 10) << said << ", " << late;
      EXPECT_LE(apart.num_new, 1) << said << ", " << late;
      EXPECT_NEAR(apart.metres_per_m, 1.0, 0.03) << said << ", " << late;
      EXPECT_NEAR(apart.last.scale_sigma.value_or(0.0), std::abs(std::log(said)), 0.06) << said;
    }
  }
}

TEST(MetricScale, WhatHasEndedContradictsARoadNoLonger) {
  BesideARoad ended{.said = 1.25, .num_frames = 45, .num_speeds = 18};
  ended.run();
  EXPECT_EQ(ended.last.road_reason, "");
  EXPECT_NEAR(ended.metres_per_m, 1.25, 0.03);
  EXPECT_EQ(ended.num_new, 1);
  EXPECT_NEAR(ended.last.scale_sigma.value_or(0.0), std::log(1.25), 0.06)
      << "one of them was wrong";

  BesideARoad unknown{.said = 1.25, .num_frames = 45, .num_speeds = 18, .unknown_at = 20};
  unknown.run();
  EXPECT_EQ(unknown.last.road_reason, "");
  EXPECT_NEAR(unknown.metres_per_m, 1.25, 0.03);

  BesideARoad none{.said = 1.25, .num_frames = 45, .num_speeds = 99, .wrong_from = 20};
  none.run();
  EXPECT_THAT(std::string(none.last.road_reason), HasSubstr("landmarks"));
  EXPECT_LT(none.last.scale_sigma.value_or(1.0), 0.2) << "what was no road is forgotten";
  EXPECT_NEAR(none.metres_per_m, 1.0, 0.03);
}

INSTANTIATE_TEST_SUITE_P(Modes,
                         MetricScaleOf,
                         ::testing::Values(OdometryMode::kMap, OdometryMode::kTwoFrame),
                         [](const auto& mode) {
                           return mode.param == OdometryMode::kMap ? "map" : "two_frame";
                         });

// A road that comes late multiplies the window once it is believed, and says so; landmarks stay in
// the units of the poses that place them.
TEST(MetricScale, LandmarksAreInTheUnitsOfTheirPoseWhenTheFirstRoadComes) {
  const int num_frames = 56;
  const int first_road = 32;
  RoadDrive drive(num_frames);
  drive.tracks.renew_tracks(12, 0);  // so that a keyframe leaves
  drive.tracks.renew_tracks(16, 1);
  WindowEstimator estimator(metric_config(), drive.scene.camera);
  EstimatorRun run(estimator, drive.tracks);
  run.road = [&](int i) { return drive.road_image(i, i >= first_road); };
  run.add_range(0, first_road);
  EXPECT_EQ(run.results.back().scale_state, ScaleState::kNone);
  EXPECT_NEAR(step_m(run, first_road - 1), 1.0, 0.05);  // the assumed step
  run.add_range(first_road, num_frames);
  EXPECT_EQ(run.results.back().scale_state, ScaleState::kMeasured);
  EXPECT_NEAR(step_m(run, num_frames - 1), kStep_m, 0.02 * kStep_m);
  const auto is_new = std::ranges::find_if(run.results.begin() + first_road, run.results.end(),
                                           &FrameResult::is_scale_new);
  const auto first_metric = static_cast<int>(is_new - run.results.begin());
  EXPECT_LE(first_metric, first_road + 16);
  EXPECT_NEAR(step_m(run, first_metric - 1), 1.0, 0.05) << "not before";
  int num_before = 0;
  int num_after = 0;
  for (const KeptLandmark& landmark : estimator.landmarks_since(0).landmarks) {
    const bool is_metric = landmark.frame >= first_metric;
    const double unit_m = is_metric ? 1.0 : kStep_m;
    const double depth_m = true_place(landmark, drive.tracks).z();
    EXPECT_NEAR(unit_m * landmark.in_camera.z(), depth_m, 0.05 * depth_m) << landmark.frame;
    ++(is_metric ? num_after : num_before);
  }
  EXPECT_GT(num_before, 20);
  EXPECT_GT(num_after, 80);
}

TEST(RoadLandmarks, AreThoseOfThreeKeyframesWithTheSigmaOfTheirParallax) {
  const Camera camera{700.0, 700.0, 600.0, 180.0, 1200, 360};
  Window window;
  window.landmarks = {{1, {0.0, 1.5, 14.0}}, {2, {0.0, 1.5, 14.0}}, {3, {0.0, 1.5, 2.0}}};
  for (int i = 0; i < 3; ++i) {
    Keyframe keyframe{i, Rigid3(Eigen::Quaterniond::Identity(), {0.0, 0.0, 1.0 * i}), {}};
    keyframe.points = {{.track_id = 1}};
    if (i > 0) {
      keyframe.points.push_back({.track_id = 2});  // seen by two only
    }
    keyframe.points.push_back({.track_id = 3});
    window.keyframes.push_back(keyframe);
  }
  const Rigid3 here(Eigen::Quaterniond::Identity(), {0.0, 0.0, 4.0});  // past the third
  const std::vector<RoadLandmark> found = road_landmarks(
      window, here, {{.track_id = 1}, {.track_id = 2}, {.track_id = 3}, {.track_id = 4}}, camera);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_TRUE(found[0].in_camera.isApprox(Eigen::Vector3d(0.0, 1.5, 10.0)));
  const double parallax_rad = std::atan2(1.5, 10.0) - std::atan2(1.5, 14.0);
  EXPECT_NEAR(found[0].sigma, 0.7 / 700.0 / std::sin(parallax_rad), 1e-6);
}

}  // namespace
}  // namespace stemvo
