// SPDX-License-Identifier: MIT
// The estimator with its map: places that are seen again, with tracks that are new there.
#include "odometry/window_estimator.hpp"
#include "support/estimator_run.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

const Camera kCamera{500.0, 500.0, 500.0, 400.0, 1000, 800};

/// A track ends where its point leaves the view, and where the frame `cut` begins.
void end_tracks(DriveTracks& drive, int cut) {
  std::map<int, int> num_tracks;  // of each point
  std::map<int, Eigen::Vector2d> before;
  for (int i = 0; i < drive.num_frames(); ++i) {
    auto& seen = drive.observations[static_cast<std::size_t>(i)];
    std::map<int, Eigen::Vector2d> under_new_ids;
    for (const auto& [point, uv] : seen) {
      num_tracks[point] += i == cut || !before.contains(point) ? 1 : 0;
      under_new_ids[point + static_cast<int>(drive.points.size()) * num_tracks[point]] = uv;
    }
    before = std::exchange(seen, std::move(under_new_ids));
  }
}

/// Each point has a texture of its own, which faces the camera.
std::shared_ptr<ImagePyramid> paint(const DriveTracks& drive, int frame) {
  constexpr int kHalf = 20;
  cv::Mat image(drive.camera.height_px, drive.camera.width_px, CV_8UC1, cv::Scalar(127));
  const cv::Rect whole(0, 0, image.cols, image.rows);
  for (const auto& [id, uv] : drive.observations[static_cast<std::size_t>(frame)]) {
    cv::Mat texture(2 * kHalf + 1, 2 * kHalf + 1, CV_8UC1);
    cv::RNG(static_cast<std::uint64_t>(id) % drive.points.size() + 1)
        .fill(texture, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(texture, texture, {5, 5}, 1.5);
    const cv::Rect place(static_cast<int>(std::lround(uv.x())) - kHalf,
                         static_cast<int>(std::lround(uv.y())) - kHalf, texture.cols, texture.rows);
    const cv::Rect inside = place & whole;
    texture(inside - place.tl()).copyTo(image(inside));
  }
  return std::make_shared<ImagePyramid>(ChannelImage{image, {}});
}

/// A drive that was taken through an estimator.
struct Journey {
  Journey(const DriveTracks& tracks, int cut, bool loops, int threads = 1)
      : drive(tracks), estimator(options(loops, threads), drive.camera), run(estimator, drive) {
    run.pyramid = [this](int i) { return paint(drive, i); };
    for (int i = 0; i < drive.num_frames(); ++i) {
      i == cut ? run.add_matches({}, i) : run.add(i);
    }
  }
  static Options options(bool loops, int threads) {
    Options options = config_without_scale();
    options.odometry.loops = loops;
    options.threads = threads;
    return options;
  }
  [[nodiscard]] const FrameResult& result(int i) const {
    return run.results[static_cast<std::size_t>(i)];
  }
  /// Where the map has frame i, in metres of the drive.
  [[nodiscard]] Eigen::Vector3d position_m(int i) const {
    const double unit_m =
        1.0 / length_ratio(estimator.trajectory(), drive.world_from_camera, 0, 20);
    return unit_m * (result(i).map_from_world * result(i).world_from_camera).translation;
  }
  [[nodiscard]] int num_recognized() const {
    return static_cast<int>(std::ranges::count_if(
        run.results, [](const FrameResult& frame) { return frame.recognized_frame >= 0; }));
  }

  DriveTracks drive;
  WindowEstimator estimator;
  EstimatorRun run;
};

/// Sideways past a wall, 0.4 m a frame; then, at once, slowly from the third frame's place on.
DriveTracks jump_back(int cut) {
  SceneRandom random(3);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 500; ++i) {
    const double x = random.uniform(-10.0, 26.0);
    const double y = random.uniform(-7.0, 7.0);
    points.emplace_back(x, y, random.uniform(7.0, 12.0));
  }
  std::vector<Rigid3> path;
  for (int i = 0; i < cut; ++i) {
    path.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.4 * i, 0.02 * i, 0.0));
  }
  for (int i = 0; i < 40; ++i) {
    path.push_back(path[3] * Rigid3(Eigen::Quaterniond::Identity(), {0.03 * i, 0.0, 0.0}));
  }
  DriveTracks drive(path, points, 0.2, 5, kCamera);
  end_tracks(drive, cut);
  return drive;
}

TEST(Mapper, ALostCameraGoesOnInTheOldMapWithTheOldScale) {
  constexpr int kCut = 40;
  const Journey found(jump_back(kCut), kCut, true);
  EXPECT_EQ(found.run.state(kCut), FrameState::kLost);
  EXPECT_GE(found.num_recognized(), 1);
  const int num_frames = found.drive.num_frames();
  for (int i = kCut + 10; i < num_frames; ++i) {
    EXPECT_TRUE(is_measured(found.run.state(i))) << i;
    EXPECT_LT((found.position_m(i) - found.drive.pose(i).translation).norm(), 0.15) << i;
  }
  const Journey lost(jump_back(kCut), kCut, false);
  EXPECT_EQ(lost.num_recognized(), 0);
  const int last = num_frames - 1;
  EXPECT_GT((lost.position_m(last) - lost.drive.pose(last).translation).norm(), 1.0);
}

/// Two turns along the walls of a room.
DriveTracks two_turns(int frames_per_turn) {
  std::vector<Rigid3> path;
  for (int i = 0; i < 2 * frames_per_turn; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / frames_per_turn;
    const Eigen::Quaterniond turn = so3_exp({0.0, angle, 0.0});
    path.emplace_back(turn, turn * Eigen::Vector3d(0.0, 0.0, 2.0));
  }
  SceneRandom random(8);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 700; ++i) {
    const double bearing = random.uniform(-std::numbers::pi, std::numbers::pi);
    const double distance = random.uniform(7.0, 12.0);
    const double y = random.uniform(-5.0, 5.0);
    points.emplace_back(distance * std::sin(bearing), y, distance * std::cos(bearing));
  }
  DriveTracks drive(path, points, 0.3, 6, kCamera);
  end_tracks(drive, -1);
  return drive;
}

TEST(Mapper, ARoomIsRecognizedOnTheSecondTurn) {
  constexpr int kTurn = 120;
  const DriveTracks drive = two_turns(kTurn);
  const Journey one(drive, -1, true);
  EXPECT_EQ(one.run.count(FrameState::kLost), 0);
  EXPECT_GE(one.num_recognized(), 2);
  // One may be begun and not taken in yet.
  EXPECT_GE(static_cast<int>(frames_of_loops(one.estimator.kept_map()).size()),
            one.num_recognized());
  bool is_corrected = false;
  for (int i = 0; i < drive.num_frames(); ++i) {
    const FrameResult& frame = one.result(i);
    if (frame.recognized_frame >= 0) {  // a true place
      EXPECT_GT(i, kTurn);
      EXPECT_LT(drive.pose(i).rotation.angularDistance(drive.pose(frame.recognized_frame).rotation),
                0.8);
      is_corrected = true;
    }
    if (!is_corrected) {
      EXPECT_EQ(frame.map_from_world.scale, 1.0);
      EXPECT_EQ(frame.map_from_world.translation.norm(), 0.0);
    }
  }
  for (int i = 2 * kTurn - 10; i < 2 * kTurn; ++i) {
    EXPECT_LT((one.position_m(i) - one.position_m(i - kTurn)).norm(), 0.15) << i;
  }
  // The same on more threads.
  const Journey four(drive, -1, true, 4);
  for (int i = 0; i < drive.num_frames(); ++i) {
    EXPECT_EQ(one.result(i).recognized_frame, four.result(i).recognized_frame);
    EXPECT_EQ(one.result(i).map_from_world.translation, four.result(i).map_from_world.translation);
    EXPECT_EQ(one.result(i).world_from_camera.translation,
              four.result(i).world_from_camera.translation);
  }
}

}  // namespace
}  // namespace stemvo
