// SPDX-License-Identifier: MIT
#include "mapping/place_recognizer.hpp"
#include "support/kept_places.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr int kLength = 60;
/// The second round has other units.
constexpr double kUnits = 1.4;

/// A street, driven twice, half a metre aside; between the rounds the camera sees nothing of it.
/// Every keyframe is looked up; tracks are new every 6 keyframes.
struct TwoRounds {
  explicit TwoRounds(unsigned seed)
      : path(DriveTracks::repeat({Eigen::Quaterniond::Identity(), {0, 0, 2}}, kLength)),
        points(points_along(path, 2000, seed), seed),
        elsewhere(points_along(path, 2000, seed + 100), seed + 100) {}

  /// `num_known`: so many corners look as they did.
  std::optional<Loop> add(DescribedPoints& seen,
                          const Rigid3& pose,
                          double units,
                          std::size_t num_known = 10000) {
    const int number = static_cast<int>(map.keyframes.size());
    KeptKeyframe keyframe = seen.see(pose, units, 10000 * (number / 6));
    for (std::size_t i = num_known; i < keyframe.corners.size(); ++i) {
      keyframe.descriptors[i] = seen.draw();
    }
    for (Descriptor& descriptor : keyframe.descriptors) {
      descriptor = seen.changed(descriptor, bits_changed);
    }
    // What changed is known only to who describes it by the first map's axes.
    const std::vector<Descriptor> right = keyframe.descriptors;
    keyframe.world_from_camera =
        Rigid3(so3_exp({0.0, 0.0, axes_rolled_rad}), Eigen::Vector3d::Zero()) *
        keyframe.world_from_camera;
    const double roll = image_roll_rad(keyframe.world_from_camera.rotation);
    const DescribeAs describe_as = [&](const OtherLook& look) {
      const bool is_right = bits_changed == 0.0 ||
                            std::abs(roll + look.roll_rad - image_roll_rad(pose.rotation)) < 0.06;
      return is_right ? right : std::vector(right.size(), seen.draw());
    };
    keyframe.descriptors = describe_as({1.0, 0.0});
    keyframe.frame = 5 * number;
    map.map_from_keyframe.emplace_back(keyframe.world_from_camera);
    map.keyframes.push_back(keyframe);
    if (!recognizer.asks(keyframe)) {
      return std::nullopt;
    }
    ++num_lookups;
    components.resize(map.keyframes.size(), component);
    const auto loop = recognizer.recognize({map, components, number, keyframe}, describe_as);
    if (!recognizer.shows_kept_place()) {
      recognizer.add(number, keyframe);
      ++num_places;
    }
    return loop;
  }
  [[nodiscard]] Rigid3 aside(int i) const {
    return path[static_cast<std::size_t>(i)] * Rigid3(so3_exp({0.0, 0.02, 0.0}), {0.5, 0.0, 0.3});
  }
  void first_round() {
    for (int i = 0; i < kLength; ++i) {
      EXPECT_FALSE(add(points, path[static_cast<std::size_t>(i)], 1.0).has_value()) << i;
    }
    for (int i = 0; i < 30; ++i) {
      EXPECT_FALSE(add(elsewhere, path[static_cast<std::size_t>(i)], 1.0).has_value()) << i;
    }
  }

  std::vector<Rigid3> path;
  std::vector<int> components;   ///< of each keyframe
  int component = 0;             ///< of those to come
  double axes_rolled_rad = 0.0;  ///< of their map
  double bits_changed = 0.0;     ///< share of what they are described by
  DescribedPoints points;
  DescribedPoints elsewhere;
  KeptMap map;
  PlaceRecognizer recognizer;
  int num_lookups = 0;
  int num_places = 0;
};

TEST(PlaceRecognizer, AStreetThatIsDrivenAgainIsRecognized) {
  TwoRounds drive(3);
  drive.first_round();
  const int num_before = drive.num_lookups;
  const int places_before = drive.num_places;
  int num_loops = 0;
  for (int i = 0; i < kLength; ++i) {
    const auto loop = drive.add(drive.points, drive.aside(i), kUnits);
    if (loop.has_value()) {
      ++num_loops;
      const Rigid3& old = drive.path[static_cast<std::size_t>(loop->from)];
      const Rigid3 truth = old.inverse() * drive.aside(i);
      EXPECT_LT((loop->from_to.translation - truth.translation).norm(), 0.15);
      EXPECT_LT(loop->from_to.rotation.angularDistance(truth.rotation), 0.005);
      EXPECT_NEAR(loop->from_to.scale, 1.0 / kUnits, 0.02);
      EXPECT_EQ(loop->to, kLength + 30 + i);
    }
  }
  EXPECT_GE(num_loops, (drive.num_lookups - num_before) * 8 / 10);
  EXPECT_GT(num_loops, 8);
  // A recognized place is kept once.
  EXPECT_LE(drive.num_places - places_before, 2);
}

/// Its descriptors as it is say nothing.
TEST(PlaceRecognizer, APlaceIsRecognizedAtAnotherScaleAndRoll) {
  for (const OtherLook& right : kOtherLooks) {
    TwoRounds drive(3);
    drive.first_round();
    KeptKeyframe frame = drive.points.see(drive.aside(20), 1.0, 0);
    const std::vector<Descriptor> seen =
        std::exchange(frame.descriptors, std::vector(frame.corners.size(), drive.points.draw()));
    const auto locate = [&](const DescribeAs& describe_as) {
      return drive.recognizer.locate(drive.map, frame.camera, frame.corners, frame.descriptors,
                                     describe_as);
    };
    EXPECT_FALSE(locate({}).has_value());
    EXPECT_TRUE(locate([&](const OtherLook& look) {
                  const bool is_right =
                      look.scale == right.scale && look.roll_rad == right.roll_rad;
                  return is_right ? seen : frame.descriptors;
                }).has_value());
  }
}

/// Too few corners for anybody who does not know where to look.
TEST(PlaceRecognizer, APlaceIsExpectedWhereTheCameraCameBack) {
  TwoRounds drive(3);
  drive.first_round();
  int num_loops = 0;
  for (int i = 0; i < kLength; ++i) {
    const auto loop = drive.add(drive.points, drive.aside(i), 1.0, 26);
    if (loop.has_value()) {
      ++num_loops;
      const Rigid3& old = drive.path[static_cast<std::size_t>(loop->from)];
      EXPECT_LT((loop->from_to.translation - (old.inverse() * drive.aside(i)).translation).norm(),
                0.3);
    }
  }
  EXPECT_GT(num_loops, 5);
}

/// Corners look so different that they are known only where they are looked for: the one view that
/// shows the place tells where, unless the camera is lost behind it.
TEST(PlaceRecognizer, ASightingTellsWhereTheNextOnesLie) {
  struct Case {
    bool has_clear_view;
    int component_behind;
    bool is_joined;
  };
  for (const Case& one : {Case{false, 1, false}, Case{true, 1, true}, Case{true, 2, false}}) {
    TwoRounds drive(3);
    drive.first_round();
    drive.axes_rolled_rad = 0.3;  // no look that votes is turned like that
    int num_joined = 0;
    for (int i = 20; i < 30; ++i) {
      drive.component = i == 20 ? 1 : one.component_behind;
      drive.bits_changed = one.has_clear_view && i == 20 ? 0.0 : 0.22;
      const auto loop = drive.add(drive.points, drive.aside(i), kUnits);
      if (loop.has_value()) {
        ++num_joined;
        EXPECT_NEAR(loop->from_to.scale, 1.0 / kUnits, 0.02);
      }
    }
    EXPECT_EQ(num_joined > 0, one.is_joined);
  }
}

TEST(PlaceRecognizer, ThreeKeyframesJoinTwoMaps) {
  TwoRounds drive(3);
  drive.first_round();
  drive.component = 1;
  EXPECT_FALSE(drive.add(drive.points, drive.aside(20), kUnits).has_value());
  EXPECT_FALSE(drive.add(drive.points, drive.aside(21), kUnits).has_value());
  EXPECT_TRUE(drive.add(drive.points, drive.aside(22), kUnits).has_value());
}

TEST(PlaceRecognizer, OneSightingIsNotBelieved) {
  TwoRounds drive(4);
  KeptKeyframe alone = drive.points.see(drive.path[10], 1.0, 0);
  drive.map.keyframes.push_back(alone);
  drive.map.map_from_keyframe.emplace_back();
  drive.recognizer.add(0, alone);
  for (int i = 0; i < 30; ++i) {
    (void)drive.add(drive.elsewhere, drive.path[static_cast<std::size_t>(i)], 1.0);
  }
  EXPECT_FALSE(drive.add(drive.points, drive.aside(10), 1.0).has_value());
}

TEST(PlaceRecognizer, ALostFrameIsLocatedInTheOldMap) {
  TwoRounds drive(5);
  drive.first_round();
  int num_located = 0;
  for (int i = 5; i < 40; i += 5) {
    KeptKeyframe frame = drive.points.see(drive.aside(i), 1.0, 0);
    for (KeptCorner& corner : frame.corners) {
      corner.in_camera.setConstant(NAN);
    }
    const auto found =
        drive.recognizer.locate(drive.map, frame.camera, frame.corners, frame.descriptors);
    if (found.has_value()) {
      ++num_located;
      const Rigid3 pose =
          drive.path[static_cast<std::size_t>(found->keyframe)] * found->keyframe_from_camera;
      EXPECT_LT((pose.translation - drive.aside(i).translation).norm(), 0.1);
      EXPECT_GE(found->landmarks.size(), 30U);
    }
  }
  EXPECT_EQ(num_located, 7);
  DescribedPoints nowhere(points_along(drive.path, 2000, 77), 77);
  const KeptKeyframe frame = nowhere.see(drive.path[20], 1.0, 0);
  EXPECT_FALSE(drive.recognizer.locate(drive.map, frame.camera, frame.corners, frame.descriptors)
                   .has_value());
}

}  // namespace
}  // namespace stemvo
