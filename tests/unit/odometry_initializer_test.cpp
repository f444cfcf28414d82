// SPDX-License-Identifier: MIT
#include "odometry/initializer.hpp"
#include "support/estimator_run.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

/// Goes on from frame 0, as the estimator does, until a frame decides.
struct Decided {
  int frame = -1;  ///< -1: none did
  MeasuredMotion motion;
  std::optional<Window> window;
};

View view_of(const Matches& matches, const Rigid3& pose, int frame) {
  return {frame, pose, current_points(matches, std::vector<char>(matches.cur_uv.size(), 1))};
}

Decided initialize(const DriveTracks& drive, const Options& config = {}) {
  Initializer initializer(config);
  initializer.start({0, Rigid3(), {}});
  Decided result;
  for (int i = 1; i < drive.num_frames(); ++i) {
    const Matches matches = drive.matches(i);
    View now = view_of(matches, Rigid3(), i);
    result.motion = initializer.measure(matches, now.points, drive.camera);
    if (result.motion.state == FrameState::kTracking && result.motion.is_decisive) {
      result.frame = i;
      now.world_from_camera = result.motion.cur_from_prev.inverse();
      result.window = initializer.open_window(now, drive.camera, {});
      return result;
    }
  }
  return result;
}

void expect_true_motion(const Decided& decided, const DriveTracks& drive, double max_rad) {
  ASSERT_GT(decided.frame, 0);
  const Rigid3 truth = drive.pose(0).inverse() * drive.pose(decided.frame);
  const Rigid3 estimate = decided.motion.cur_from_prev.inverse();
  EXPECT_LT(estimate.rotation.angularDistance(truth.rotation), max_rad);
  EXPECT_LT((estimate.translation - truth.translation.normalized()).norm(), 5.0 * max_rad);
}

/// A camera in the hand, 30 frames a second, 3 m from what it sees: 0.1 m/s to the right, less
/// than a pixel a frame.
DriveTracks sideways_walk(double noise_px, std::uint64_t seed) {
  const Rigid3 step(so3_exp({0.0, 0.0005, 0.0}), {0.1 / 30.0, 0.0, 0.0});
  return {DriveTracks::repeat(step, 60), points_of_room(1500, 4.0, seed), noise_px, seed};
}

TEST(Initializer, OpensAWindowOfTheReferenceAndNowWhereNeighboursHaveNoParallax) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const DriveTracks walk = sideways_walk(0.2, seed);
    const Decided decided = initialize(walk);
    expect_true_motion(decided, walk, 0.01);
    EXPECT_GT(decided.frame, 1);
    EXPECT_LT(decided.frame, 45);
    ASSERT_TRUE(decided.window.has_value());
    const Window& window = *decided.window;
    ASSERT_EQ(window.keyframes.size(), 2U);
    EXPECT_EQ(window.keyframes.front().frame, 0);
    EXPECT_EQ(window.keyframes.back().frame, decided.frame);
    EXPECT_GT(window.landmarks.size(), 100U);
  }
}

TEST(Initializer, APlanarSceneDecidesByTheHomography) {
  int num_right = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SceneRandom random(seed);
    std::vector<Eigen::Vector3d> wall;
    for (int i = 0; i < 1200; ++i) {
      const double x = random.uniform(-6.0, 6.0);
      wall.emplace_back(x, random.uniform(-2.0, 2.0), 4.0 + 0.2 * x);
    }
    const Rigid3 step(so3_exp({0.0, -0.001, 0.0}), {0.03, 0.002, 0.0});
    const DriveTracks walk(DriveTracks::repeat(step, 60), wall, 0.2, seed);
    const Decided decided = initialize(walk);
    if (decided.frame < 0) {
      continue;  // a plane may be undecided, but not wrong
    }
    EXPECT_EQ(decided.motion.model, TwoViewModel::kHomography) << seed;
    expect_true_motion(decided, walk, 0.02);
    ++num_right;
  }
  EXPECT_GE(num_right, 4);
}

/// Without the bound of its sigma the worst of them is off by 0.20.
TEST(Initializer, NoisyPointsDecideOnceTheyTellTheDirection) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Rigid3 step(so3_exp({0.0, 0.002, 0.0}), {0.1 / 30.0, 0.0, 0.0});
    const DriveTracks walk(DriveTracks::repeat(step, 90), points_of_room(900, 4.0, seed), 0.5,
                           seed);
    expect_true_motion(initialize(walk), walk, 0.036);
  }
}

TEST(Initializer, MatchesThatAgreeOnNothingAreLost) {
  const DriveTracks walk = sideways_walk(0.0, 9);
  Matches matches = walk.matches(1);
  Initializer initializer(Options{});
  initializer.start({0, Rigid3(), {}});
  SceneRandom random(9);
  for (Eigen::Vector2d& uv : matches.cur_uv) {
    uv = random.pixel(walk.camera);
  }
  const Observations now = view_of(matches, Rigid3(), 1).points;
  const MeasuredMotion motion = initializer.measure(matches, now, walk.camera);
  EXPECT_FALSE(motion.state == FrameState::kTracking && motion.is_decisive);
  initializer.start({0, Rigid3(), {}});
  EXPECT_EQ(initializer.measure({}, {}, walk.camera).state, FrameState::kLost);
}

TEST(Initializer, TheMaskIsOfAllMatchesAndKeepsThoseTheReferenceDoesNotSee) {
  const DriveTracks walk = sideways_walk(0.05, 11);
  Initializer initializer(Options{});
  initializer.start({0, Rigid3(), {}});
  static_cast<void>(
      initializer.measure(walk.matches(1), view_of(walk.matches(1), {}, 1).points, walk.camera));
  Matches matches = walk.matches(20);
  matches.track_ids[0] += 100000;  // begun since
  const Eigen::Vector2d away(40.0, 60.0);
  matches.cur_uv[1] += away;
  const std::size_t num_matches = matches.cur_uv.size();
  const MeasuredMotion motion =
      initializer.measure(matches, view_of(matches, Rigid3(), 20).points, walk.camera);
  ASSERT_EQ(motion.inlier_mask.size(), num_matches);
  EXPECT_EQ(motion.state, FrameState::kTracking);
  EXPECT_EQ(motion.inlier_mask[0], 1);
  EXPECT_EQ(motion.inlier_mask[1], 0);
}

}  // namespace
}  // namespace stemvo
