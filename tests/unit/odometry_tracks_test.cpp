// SPDX-License-Identifier: MIT
#include "odometry/tracks.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

Matches make_matches() {
  Matches matches;
  matches.track_ids = {7, 2, 9, 4};
  for (const int id : matches.track_ids) {
    matches.prev_uv.emplace_back(id, 0.0);
    matches.cur_uv.emplace_back(id, 1.0);
  }
  return matches;
}

TEST(Observations, AreOrderedAndWithoutWhatIsNotKept) {
  const Observations points = current_points(make_matches(), {1, 1, 0, 1});
  ASSERT_EQ(points.size(), 3U);
  EXPECT_EQ(points[0].track_id, 2);
  EXPECT_EQ(points[1].track_id, 4);
  EXPECT_EQ(points[2].track_id, 7);
  EXPECT_EQ(points[2].uv, Eigen::Vector2d(7.0, 1.0));
  EXPECT_EQ(previous_points(make_matches(), {1, 1, 0, 1})[2].uv, Eigen::Vector2d(7.0, 0.0));
}

TEST(Observations, BegunOnesAreAddedWhereTheyStartAndOthersStayWhereTheyAre) {
  Observations points{{2, {-1.0, -1.0}}, {5, {-2.0, -2.0}}};
  add_begun_points(make_matches(), {1, 1, 1, 0}, points);
  ASSERT_EQ(points.size(), 4U);
  EXPECT_EQ(find_point(points, 2)->uv, Eigen::Vector2d(-1.0, -1.0));
  EXPECT_EQ(find_point(points, 7)->uv, Eigen::Vector2d(7.0, 0.0));
  EXPECT_EQ(find_point(points, 9)->uv, Eigen::Vector2d(9.0, 0.0));
  EXPECT_EQ(find_point(points, 4), nullptr);
  EXPECT_EQ(find_point(points, 100), nullptr);
  for (std::size_t i = 1; i < points.size(); ++i) {
    EXPECT_LT(points[i - 1].track_id, points[i].track_id);
  }
}

TEST(Observations, PairsAreOfTracksThatBothFramesSee) {
  const Observations prev{{1, {1.0, 1.0}}, {4, {4.0, 4.0}}, {6, {6.0, 6.0}}};
  const Observations cur{{0, {0.0, 9.0}}, {4, {5.0, 4.0}}, {6, {7.0, 6.0}}, {8, {8.0, 9.0}}};
  const PointPairs pairs = common_points(prev, cur);
  ASSERT_EQ(pairs.size(), 2);
  EXPECT_EQ(pairs.track_ids[0], 4);
  EXPECT_EQ(pairs.prev_uv[1], Eigen::Vector2d(6.0, 6.0));
  EXPECT_EQ(pairs.cur_uv[1], Eigen::Vector2d(7.0, 6.0));
  EXPECT_EQ(common_points(prev, {}).size(), 0);
  EXPECT_EQ(common_points({}, cur).size(), 0);
}

TEST(Parallax, IsWhatARotationLeavesOfTheFlow) {
  SceneOptions options{.cur_from_prev =
                           Rigid3(so3_exp({0.01, 0.03, 0.0}), Eigen::Vector3d::Zero())};
  const Scene turned = make_scene(options);
  EXPECT_GT(median_flow_px({turned.prev_uv, turned.cur_uv}), 15.0);
  EXPECT_LT(median_parallax_px(turned.cur_from_prev.rotation, {turned.prev_uv, turned.cur_uv},
                               turned.camera),
            1e-9);
  options.cur_from_prev = Rigid3(so3_exp({0.01, 0.03, 0.0}), {0.1, 0.0, 0.0});
  const Scene moved = make_scene(options);
  EXPECT_GT(
      median_parallax_px(moved.cur_from_prev.rotation, {moved.prev_uv, moved.cur_uv}, moved.camera),
      2.0);
  EXPECT_LT(median_epipolar_px(moved.cur_from_prev, {moved.prev_uv, moved.cur_uv}, moved.camera),
            1e-9);
}

TEST(IsStationary, ByTheMedianFlowOfTwentyTracks) {
  Observations before;
  Observations now;
  for (int i = 0; i < 21; ++i) {
    const Eigen::Vector2d uv(10.0 * i, 50.0);
    before.push_back({i, uv});
    now.push_back({i, uv + Eigen::Vector2d(i < 10 ? 30.0 : 0.1, 0.0)});  // others pass by
  }
  EXPECT_TRUE(is_stationary(before, now, 0.15, 20));
  EXPECT_FALSE(is_stationary(before, now, 0.05, 20));
  now[10].uv.x() += 30.0;
  EXPECT_FALSE(is_stationary(before, now, 0.15, 20));
  now[10].uv.x() -= 30.0;
  now.resize(19);
  EXPECT_FALSE(is_stationary(before, now, 0.15, 20));
}

TEST(Parallax, EpipolarInliersAreThoseWithinTheBound) {
  SceneOptions options{.cur_from_prev = Rigid3(Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0})};
  Scene scene = make_scene(options);
  for (std::size_t i = 0; i < scene.cur_uv.size(); ++i) {
    scene.cur_uv[i].y() += i % 2 == 0 ? 0.5 : 3.0;  // across the epipolar lines
  }
  const std::vector<char> mask =
      epipolar_inliers(scene.cur_from_prev, {scene.prev_uv, scene.cur_uv}, scene.camera, 1.0);
  for (std::size_t i = 0; i < mask.size(); ++i) {
    EXPECT_EQ(mask[i] != 0, i % 2 == 0) << i;
  }
}

}  // namespace
}  // namespace stemvo
