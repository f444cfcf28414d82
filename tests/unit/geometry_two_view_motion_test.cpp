// SPDX-License-Identifier: MIT
#include <limits>

#include <gtest/gtest.h>

#include "stemvo/geometry/decomposition.hpp"
#include "stemvo/geometry/two_view_motion.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_scene.hpp"

namespace stemvo {
namespace {

using testing::IsNearMotion;
using testing::kitti_camera;
using testing::make_scene;
using testing::Scene;
using testing::SceneOptions;

std::optional<TwoViewMotion> essential_motion(const Scene& scene) {
  return motion_from_essential(essential_from_motion(scene.cur_from_prev), scene.prev_uv,
                               scene.cur_uv, scene.camera);
}

TEST(MotionFromEssential, ExactMatchesGiveTheTrueMotion) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = make_scene({.seed = seed});
    const auto motion = essential_motion(scene);
    ASSERT_TRUE(motion.has_value());
    EXPECT_THAT(motion->cur_from_prev, IsNearMotion(scene.cur_from_prev, 1e-9));
    EXPECT_EQ(motion->num_good, 200);
    EXPECT_EQ(motion->model, TwoViewModel::kEssential);
    EXPECT_TRUE(is_decisive(*motion, 200)) << "seed " << seed;
  }
}

TEST(MotionFromHomography, ExactMatchesGiveTheTrueMotionUpToTheTwofoldAmbiguity) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = make_scene({.planar = true, .seed = seed});
    const auto motion = motion_from_homography(testing::true_homography(scene), scene.prev_uv,
                                               scene.cur_uv, scene.camera);
    ASSERT_TRUE(motion.has_value());
    EXPECT_EQ(motion->num_good, 200);
    const auto test = test_points(scene.cur_from_prev, scene.prev_uv, scene.cur_uv, scene.camera);
    EXPECT_EQ(test.num_good, 200);
  }
}

}  // namespace
}  // namespace stemvo
