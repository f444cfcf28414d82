// SPDX-License-Identifier: MIT
#include "geometry/decomposition.hpp"
#include "geometry/two_view_motion.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

using Points = std::vector<Eigen::Vector2d>;

std::optional<TwoViewMotion> motion_from_essential(const Eigen::Matrix3d& essential,
                                                   const PixelPairs& pairs,
                                                   const Camera& camera) {
  return best_motion(TwoViewModel::kEssential, decompose_essential(essential), pairs, camera);
}

std::optional<TwoViewMotion> motion_from_homography(const Eigen::Matrix3d& homography,
                                                    const Scene& scene) {
  return best_motion(TwoViewModel::kHomography, decompose_homography(homography, scene.camera),
                     {scene.prev_uv, scene.cur_uv}, scene.camera);
}

std::optional<TwoViewMotion> essential_motion(const Scene& scene) {
  return motion_from_essential(essential_from_motion(scene.cur_from_prev),
                               {scene.prev_uv, scene.cur_uv}, scene.camera);
}

std::optional<TwoViewMotion> homography_motion(const Scene& scene) {
  return motion_from_homography(true_homography(scene), scene);
}

int count(const std::vector<char>& mask) {
  return static_cast<int>(std::count(mask.begin(), mask.end(), 1));
}

TEST(MotionFromEssential, ExactMatchesGiveTheTrueMotion) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = make_scene({.seed = seed});
    const double scale = seed % 2 == 0 ? -4.0 : 0.3;  // of a matrix that has none
    const auto motion = motion_from_essential(scale * essential_from_motion(scene.cur_from_prev),
                                              {scene.prev_uv, scene.cur_uv}, scene.camera);
    ASSERT_TRUE(motion.has_value());
    EXPECT_THAT(motion->cur_from_prev, IsNearMotion(scene.cur_from_prev, 1e-9));
    EXPECT_EQ(motion->test.num_good, 200);
    EXPECT_EQ(motion->model, TwoViewModel::kEssential);
    EXPECT_TRUE(is_decisive(*motion, 200)) << "seed " << seed;
  }
}

TEST(MotionFromEssential, NoiseAndOutliersDoNotChangeTheChoice) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = make_scene({.noise_px = 0.5, .outlier_ratio = 0.2, .seed = seed});
    const auto motion = essential_motion(scene);
    ASSERT_TRUE(motion.has_value());
    EXPECT_THAT(motion->cur_from_prev, IsNearMotion(scene.cur_from_prev, 1e-9));
    const int num_inliers = 200 - count(scene.is_outlier);
    EXPECT_GE(motion->test.num_good, num_inliers - 5);
    EXPECT_LE(motion->test.num_good, num_inliers + 10);
  }
}

TEST(MotionFrom, RunnerUpIsTheSecondBestInWhateverOrderTheyCome) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Scene scene = make_scene({.noise_px = 0.5, .planar = true, .seed = seed});
    std::vector<int> counts;
    for (const Rigid3& hypothesis : decompose_homography(true_homography(scene), scene.camera)) {
      counts.push_back(
          test_points(hypothesis, {scene.prev_uv, scene.cur_uv}, scene.camera).num_good);
    }
    std::sort(counts.rbegin(), counts.rend());
    const auto motion = homography_motion(scene);
    ASSERT_TRUE(motion.has_value());
    EXPECT_EQ(motion->test.num_good, counts[0]);
    EXPECT_DOUBLE_EQ(motion->runner_up_ratio, static_cast<double>(counts[1]) / counts[0]);
  }
}

TEST(MotionFromHomography, AllPointsPassAndTheTrueMotionIsOneOfTheBest) {
  int num_true = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = make_scene({.planar = true, .seed = seed});
    const auto motion = homography_motion(scene);
    ASSERT_TRUE(motion.has_value());
    EXPECT_EQ(motion->model, TwoViewModel::kHomography);
    EXPECT_EQ(motion->test.num_good, 200);
    EXPECT_EQ(count(motion->test.good_mask), 200);
    const bool is_true =
        ::testing::Matches(IsNearMotion(scene.cur_from_prev, 1e-8))(motion->cur_from_prev);
    num_true += is_true ? 1 : 0;
    // A plane allows two motions in front of which all points lie: then the choice is a guess,
    // and must be called one.
    if (!is_true) {
      EXPECT_EQ(motion->runner_up_ratio, 1.0) << "seed " << seed;
      EXPECT_FALSE(is_decisive(*motion, 200));
    }
  }
  EXPECT_GE(num_true, 25);
}

TEST(MotionFromHomography, ADecisiveChoiceIsTheTrueMotion) {
  int num_decisive = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const Scene scene = make_scene({.noise_px = 0.3, .planar = true, .seed = seed});
    const auto motion = homography_motion(scene);
    ASSERT_TRUE(motion.has_value());
    if (is_decisive(*motion, 200)) {
      ++num_decisive;
      EXPECT_THAT(motion->cur_from_prev, IsNearMotion(scene.cur_from_prev, 1e-8)) << seed;
    }
  }
  // Most tilted planes leave two motions open.
  EXPECT_GE(num_decisive, 10);
}

TEST(MotionFrom, DegenerateModelsGiveNothing) {
  const Scene scene = make_scene({.seed = 3});
  const Eigen::Matrix3d k = scene.camera.matrix();
  const Eigen::Matrix3d rotation_only = k * scene.cur_from_prev.rotation_matrix() * k.inverse();
  const auto from_h = [&](const Eigen::Matrix3d& h) { return motion_from_homography(h, scene); };
  EXPECT_FALSE(from_h(rotation_only).has_value());
  EXPECT_FALSE(from_h(Eigen::Matrix3d::Zero()).has_value());
  const Eigen::Matrix3d e = essential_from_motion(scene.cur_from_prev);
  EXPECT_FALSE(motion_from_essential(e, {{}, {}}, scene.camera).has_value());
}

TEST(MotionFrom, EqualPointsAreNeverDecisive) {
  const Scene scene = make_scene({.seed = 3});
  const Points same(200, Eigen::Vector2d(300.0, 100.0));
  const auto motion =
      motion_from_essential(essential_from_motion(scene.cur_from_prev), {same, same}, scene.camera);
  if (motion.has_value()) {
    EXPECT_THAT(motion->cur_from_prev, IsFiniteMotion());
    EXPECT_FALSE(is_decisive(*motion, 200));
  }
}

TEST(IsDecisive, EveryCriterionCounts) {
  TwoViewMotion good;
  good.model = TwoViewModel::kEssential;
  good.test.num_good = 95;
  good.test.parallax_deg = 1.5;
  good.runner_up_ratio = 0.3;
  EXPECT_TRUE(is_decisive(good, 100));
  EXPECT_FALSE(is_decisive(good, 106)) << "below the share";
  EXPECT_FALSE(is_decisive(good, 100, {.min_good = 96}));
  EXPECT_FALSE(is_decisive(good, 100, {.min_parallax_deg = 1.6}));
  EXPECT_FALSE(is_decisive(TwoViewMotion(), 0)) << "no model";
  good.runner_up_ratio = 0.72;
  EXPECT_FALSE(is_decisive(good, 100)) << "0.7 for E";
  good.model = TwoViewModel::kHomography;
  EXPECT_TRUE(is_decisive(good, 100)) << "0.75 for H";
  good.runner_up_ratio = 0.76;
  EXPECT_FALSE(is_decisive(good, 100));
  good.runner_up_ratio = 0.3;
  good.test.parallax_deg = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(is_decisive(good, 100)) << "NaN";
}

}  // namespace
}  // namespace stemvo
