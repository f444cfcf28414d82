// SPDX-License-Identifier: MIT
#include "mapping/pose_graph.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr double kSigma_rad = 0.001;
constexpr double kSigmaOfWay = 0.01;
constexpr double kSigmaLogScale = 0.003;

/// A camera that drives rounds of a circle; its motions are measured with noise, and every
/// keyframe's unit of length is another one.
struct Circle {
  std::vector<Similarity3> truth;  ///< map_from_keyframe
  KeptMap map;

  Circle(int num_keyframes, int num_per_round, unsigned seed) : random(seed) {
    constexpr double kStep = 1.0;
    const double radius = num_per_round * kStep / (2.0 * M_PI);
    for (int i = 0; i < num_keyframes; ++i) {
      const double angle = 2.0 * M_PI * i / num_per_round;
      const Eigen::Quaterniond turn = so3_exp({0.0, angle, 0.0});
      truth.emplace_back(std::exp(0.1 * std::sin(3.0 * angle)), turn,
                         radius * Eigen::Vector3d(1.0 - std::cos(angle), 0.0, std::sin(angle)));
    }
    truth.front().scale = 1.0;
    map.keyframes.resize(truth.size());
    map.map_from_keyframe = {truth.front()};
    for (int i = 0; i + 1 < num_keyframes; ++i) {
      map.motions.push_back(measure(i, i + 1, 1.0));
      map.map_from_keyframe.push_back(map.map_from_keyframe.back() * map.motions.back().from_to);
    }
  }

  MapEdge measure(int from, int to, double sigmas) {
    const Similarity3& a = truth[static_cast<std::size_t>(from)];
    const Similarity3& b = truth[static_cast<std::size_t>(to)];
    MapEdge edge{from,
                 to,
                 a.inverse() * b,
                 sigmas * kSigma_rad,
                 sigmas * kSigmaOfWay,
                 sigmas * kSigmaLogScale};
    edge.from_to.rotation = edge.from_to.rotation * so3_exp(noise(edge.sigma_rad));
    edge.from_to.translation += noise(edge.sigma_translation);
    edge.from_to.scale *= std::exp(noise(edge.sigma_log_scale).x());
    return edge;
  }
  void add_loop(int from, int to) {
    Loop loop;
    static_cast<MapEdge&>(loop) = measure(from, to, 3.0);
    map.loops.push_back(loop);
  }
  /// The largest distance of a keyframe from where it is, and of its log scale.
  [[nodiscard]] std::pair<double, double> worst() const {
    std::pair<double, double> result;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const Similarity3& at = map.map_from_keyframe[i];
      result.first = std::fmax(result.first, (at.translation - truth[i].translation).norm());
      result.second = std::fmax(result.second, std::abs(std::log(at.scale / truth[i].scale)));
    }
    return result;
  }

 private:
  Eigen::Vector3d noise(double sigma) {
    std::normal_distribution<double> normal(0.0, sigma);
    return {normal(random), normal(random), normal(random)};
  }
  std::mt19937 random;
};

double largest_move(const std::vector<Similarity3>& before, const std::vector<Similarity3>& after) {
  double largest = 0.0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    largest = std::fmax(largest, (after[i].translation - before[i].translation).norm());
  }
  return largest;
}

TEST(PoseGraph, ALoopTakesDriftAway) {
  Circle circle(400, 200, 1);
  const auto [drift, drift_scale] = circle.worst();
  for (int i = 0; i < 200; i += 10) {
    circle.add_loop(i, i + 200);
  }
  ASSERT_TRUE(solve_pose_graph(circle.map));
  const auto [left, left_scale] = circle.worst();
  EXPECT_GE(drift, 2.0);
  EXPECT_LE(left, 0.5 * drift);
  EXPECT_GE(drift_scale, 0.05);
  EXPECT_LE(left_scale, 0.6 * drift_scale);
  const Similarity3& first = circle.map.map_from_keyframe.front();
  EXPECT_EQ(first.translation, circle.truth.front().translation);
  EXPECT_EQ(first.scale, 1.0);
}

TEST(PoseGraph, OneLoopFarFromTheDriftClosesIt) {
  Circle circle(300, 299, 2);
  circle.add_loop(0, 299);
  const Loop& loop = circle.map.loops.front();
  const auto gap = [&] {
    const auto& at = circle.map.map_from_keyframe;
    return ((at.front() * loop.from_to).translation - at.back().translation).norm();
  };
  const double before = gap();
  ASSERT_TRUE(solve_pose_graph(circle.map));
  EXPECT_GE(before, 20.0 * loop.sigma_translation);
  EXPECT_LE(gap(), 3.0 * loop.sigma_translation);
}

TEST(PoseGraph, AFalseLoopPullsNothing) {
  Circle circle(400, 200, 3);
  for (int i = 0; i < 200; i += 40) {
    circle.add_loop(i, i + 200);
  }
  ASSERT_TRUE(solve_pose_graph(circle.map));
  const KeptMap without = circle.map;
  Loop loop = circle.map.loops.front();
  loop.from = 50;
  loop.to = 350;  // half a round away
  circle.map.loops.push_back(loop);
  ASSERT_TRUE(solve_pose_graph(circle.map));
  EXPECT_LE(largest_move(without.map_from_keyframe, circle.map.map_from_keyframe), 0.3);
}

TEST(PoseGraph, AFalseLoopWithoutATrueOneKeepsThePath) {
  Circle circle(400, 400, 4);
  const std::vector<Similarity3> before = circle.map.map_from_keyframe;
  circle.add_loop(50, 51);
  circle.map.loops.front().to = 250;
  ASSERT_TRUE(solve_pose_graph(circle.map));
  EXPECT_LE(largest_move(before, circle.map.map_from_keyframe), 0.01 * 127.0);  // the diameter
}

TEST(PoseGraph, LengthsMakeTheUnitAMetre) {
  Circle circle(400, 200, 5);
  for (int i = 0; i < 400; i += 20) {
    const double scale = circle.truth[static_cast<std::size_t>(i)].scale;
    circle.map.lengths.push_back({i, std::log(2.0 * scale), 0.01});
  }
  ASSERT_TRUE(solve_pose_graph(circle.map));
  for (std::size_t i = 0; i < circle.truth.size(); ++i) {
    EXPECT_NEAR(std::log(circle.map.map_from_keyframe[i].scale / circle.truth[i].scale),
                std::log(2.0), 0.03)
        << i;
  }
  EXPECT_NEAR(circle.map.map_from_keyframe[100].translation.norm(),
              2.0 * circle.truth[100].translation.norm(), 0.05 * 2.0 * 64.0);
}

/// A filter that is as sure as the scale drifts in a second remembers a second: twenty tenths of
/// one are as good as one length.
TEST(PoseGraph, LengthsThatFollowEachOtherErrAlike) {
  KeptMap map;
  map.keyframes.resize(3);
  map.keyframes[1].time_s = 0.1;
  map.keyframes[2].time_s = 50.0;
  map.lengths = {{0, 0.0, 0.019}, {1, 0.0, 0.019}, {2, 0.0, 0.019}};
  EXPECT_NEAR(independent_sigma(map, 1), 0.019 * std::sqrt(20.0), 1e-9);
  EXPECT_EQ(independent_sigma(map, 0), 0.019);
  EXPECT_EQ(independent_sigma(map, 2), 0.019);
}

TEST(PoseGraph, IsTheSameTwiceAndSoonDone) {
  Circle circle(4500, 900, 6);
  for (int i = 900; i < 4500; i += 20) {
    circle.add_loop(i - 900, i);
  }
  KeptMap again = circle.map;
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_TRUE(solve_pose_graph(circle.map));
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  RecordProperty("seconds", std::to_string(took.count()));
  ASSERT_TRUE(solve_pose_graph(again));
  EXPECT_EQ(largest_move(again.map_from_keyframe, circle.map.map_from_keyframe), 0.0);
  EXPECT_LE(took.count(), 20.0);  // 1 s on a free core
}

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
