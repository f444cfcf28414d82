// SPDX-License-Identifier: MIT
#include "mapping/pose_graph.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr int kSteps = 400;

/// A street of 500 units that turns right around four corners and comes back, as odometry has it,
/// with sigmas of a drive's motions.
KeptMap street_that_comes_back() {
  constexpr double kStep = 500.0 / kSteps;
  KeptMap map;
  map.keyframes.resize(kSteps + 1);
  map.map_from_keyframe.emplace_back();
  for (int i = 0; i < kSteps; ++i) {
    const double turn_rad = i % 100 == 99 ? M_PI / 2.0 : 0.0;
    const Similarity3 motion(1.0, so3_exp({0.0, turn_rad, 0.0}), {0.0, 0.0, kStep});
    map.motions.push_back({i, i + 1, motion, 5e-4, 0.02, 6e-3});
    map.map_from_keyframe.push_back(map.map_from_keyframe.back() * motion);
  }
  return map;
}

MapEdge loop_at_end(const Similarity3& from_to) { return {0, kSteps, from_to, 1e-3, 0.02, 5e-3}; }

/// The end as the graph has it, turned, scaled and shifted by what odometry drifted.
MapEdge loop_after_drift(double turn_rad, double scale, const Eigen::Vector3d& shift) {
  Similarity3 end = street_that_comes_back().map_from_keyframe.back();
  end.rotation = end.rotation * so3_exp({0.0, turn_rad, 0.0});
  end.scale *= scale;
  end.translation += shift;
  return loop_at_end(end);
}

TEST(DriftBound, LetsPassWhatOdometryDrifts) {
  const KeptMap map = street_that_comes_back();
  EXPECT_TRUE(is_within_drift(map, loop_after_drift(0.0, 1.0, {0.0, 0.0, 0.0})));
  EXPECT_TRUE(is_within_drift(map, loop_after_drift(0.03, 1.0, {15.0, 2.0, -10.0})))
      << "several per cent of the path";
  EXPECT_TRUE(is_within_drift(map, loop_after_drift(0.0, 1.4, {0.0, 0.0, 20.0})));
  EXPECT_TRUE(is_within_drift(map, loop_after_drift(0.0, 0.7, {0.0, 0.0, 20.0})));
}

TEST(DriftBound, RefusesStreetsThatLookAlike) {
  const KeptMap map = street_that_comes_back();
  EXPECT_FALSE(is_within_drift(map, loop_after_drift(0.0, 1.0, {0.0, 0.0, 250.0})));
  EXPECT_FALSE(is_within_drift(map, loop_after_drift(0.0, 1.0, {-150.0, 0.0, 0.0})));
  EXPECT_FALSE(is_within_drift(map, loop_after_drift(0.3, 1.0, {0.0, 0.0, 0.0})));
  EXPECT_FALSE(is_within_drift(map, loop_after_drift(0.0, 3.0, {0.0, 0.0, 0.0})));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(is_within_drift(map, loop_after_drift(0.0, 1.0, {0.0, nan, 0.0})));
}

TEST(DriftBound, KnowsMoreWhereMetresWereMeasured) {
  KeptMap map = street_that_comes_back();
  const MapEdge loop = loop_after_drift(0.0, 1.4, {0.0, 0.0, 0.0});
  EXPECT_TRUE(is_within_drift(map, loop));
  map.lengths = {{0, 0.0, 0.01}, {kSteps, 0.0, 0.02}};
  EXPECT_FALSE(is_within_drift(map, loop));
  EXPECT_TRUE(is_within_drift(map, loop_after_drift(0.03, 1.05, {0.0, 0.0, 15.0})));
}

TEST(DriftBound, TellsNothingAfterALoss) {
  const MapEdge loop = loop_after_drift(2.0, 5.0, {0.0, 0.0, 1000.0});
  KeptMap map = street_that_comes_back();
  EXPECT_FALSE(is_within_drift(map, loop));
  KeptMap without_scale = map;
  without_scale.motions[200].sigma_log_scale = 1.0;
  EXPECT_TRUE(is_within_drift(without_scale, loop));
  KeptMap guessed = map;
  guessed.motions[kSteps - 1].sigma_rad = 1.0;
  guessed.lengths = {{0, 0.0, 0.01}, {kSteps, 0.0, 0.02}};
  EXPECT_TRUE(is_within_drift(guessed, loop)) << "metres do not tell where it is";
  map.motions.erase(map.motions.begin() + 200);
  EXPECT_TRUE(is_within_drift(map, loop));
}

}  // namespace
}  // namespace stemvo
