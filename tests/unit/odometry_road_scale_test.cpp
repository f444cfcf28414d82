// SPDX-License-Identifier: MIT
#include "odometry/road/belief.hpp"
#include "odometry/road/region.hpp"
#include "odometry/road/scale.hpp"
#include "support/road_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

constexpr double kDriftSigma = 0.019;  // in a second

TEST(RoadRegion, FollowsTheTurn) {
  const RoadOptions options;
  RoadPrior prior;
  // Right turn of radius 20 m, step 1 m.
  const Rigid3 cur_from_prev(so3_exp({0.0, -0.05, 0.0}), {0.025, 0.0, -1.0});
  const RoadRegion region(cur_from_prev, prior, options);
  const double height = options.camera_height_m;
  const auto at = [&](double x, double z) { return region.on_ground({x / z, height / z}); };
  const Eigen::Vector2d ahead = at(20.0 - std::sqrt(400.0 - 100.0), 10.0);
  EXPECT_NEAR(ahead.x(), 0.0, 0.02);
  EXPECT_NEAR(ahead.y(), 20.0 * std::asin(0.5), 0.02);
  EXPECT_GT(at(4.0, 10.0).x(), 1.0);
  EXPECT_FALSE(region.contains(at(0.0, 14.0)));
  EXPECT_FALSE(region.contains(region.on_ground({0.0, -0.1})));
}

/// With what its filter knows then.
struct Estimate : RoadScaleEstimate {
  double metres_per_unit = 1.0;
  double sigma = 0.0;
  bool is_initialized = false;
};

/// A road scale with a filter of its own.
struct Scale {
  explicit Scale(const RoadOptions& options = {}) : road(options) {}

  Estimate update(RoadImage image,
                  const Rigid3& motion,
                  const std::vector<RoadLandmark>& landmarks = {}) {
    if (motion.translation.norm() > 0.0) {
      filter.predict(0.1);
    }
    const RoadScaleEstimate estimate = road.update(std::move(image), motion, filter, landmarks);
    return {estimate, std::exp(filter.log_scale()), road.sigma(filter), filter.is_initialized()};
  }
  RoadScale road;
  ScaleFilter filter{kDriftSigma};
};

/// Drives straight ahead over asphalt, 0.7 m a frame; the map's unit is 1 / kMetresPerUnit long.
class Drive {
 public:
  static constexpr double kStep_m = 0.7;
  static constexpr double kMetresPerUnit = 3.0;

  Estimate next(Scale& scale) {
    static std::map<int, cv::Mat> rendered;  // once for all drives
    cv::Mat& image = rendered[frame_];
    if (image.empty()) {
      image = view(frame_, static_cast<std::uint64_t>(frame_));
    }
    ++frame_;
    return scale.update(make_road_image({image, {}}, scene_.camera), step(), landmarks);
  }
  /// A frame that shows the last place again.
  Estimate stand(Scale& scale) {
    return scale.update(make_road_image({view(frame_ - 1, 5), {}}, scene_.camera), Rigid3{});
  }
  double metres_per_unit = kMetresPerUnit;
  std::vector<RoadLandmark> landmarks;

 private:
  [[nodiscard]] Rigid3 step() const {
    return {Eigen::Quaterniond::Identity(), {0.0, 0.0, -kStep_m / metres_per_unit}};
  }
  [[nodiscard]] cv::Mat view(int frame, std::uint64_t seed) const {
    const Rigid3 camera_from_first(Eigen::Quaterniond::Identity(), {0.0, 0.0, -kStep_m * frame});
    return render_road(scene_, camera_from_first, seed);
  }
  const RoadScene scene_{};
  int frame_ = 0;
};

TEST(RoadScale, FindsTheUnitOfTheMapAndHoldsIt) {
  Drive drive;
  Scale scale;
  EXPECT_EQ(drive.next(scale).reason, "first frame");
  Estimate estimate;
  for (int i = 0; i < 12; ++i) {
    estimate = drive.next(scale);
  }
  EXPECT_TRUE(estimate.is_measured) << estimate.reason;
  EXPECT_NEAR(std::log(estimate.metres_per_unit / Drive::kMetresPerUnit), 0.0, 0.008);

  const Estimate standing = drive.stand(scale);
  EXPECT_EQ(standing.reason, "standing still");
  EXPECT_EQ(standing.metres_per_unit, estimate.metres_per_unit);
  EXPECT_EQ(standing.sigma, estimate.sigma);

  scale.road.rescale(2.0);
  scale.filter.shift(-std::log(2.0));
  drive.metres_per_unit /= 2.0;
  estimate = drive.next(scale);
  EXPECT_TRUE(estimate.is_measured) << estimate.reason;
  EXPECT_NEAR(std::log(estimate.metres_per_unit / (0.5 * Drive::kMetresPerUnit)), 0.0, 0.008);
}

/// Drives over asphalt with landmarks of a plane that is `ratio` times as far below the camera.
Estimate drive_with_landmarks(double ratio, double noise) {
  Drive drive;
  Scale scale;
  Estimate estimate;
  const double height = ratio * RoadOptions().camera_height_m / Drive::kMetresPerUnit;
  for (int i = 0; i < 20; ++i) {
    for (int k = 0; k < 8; ++k) {
      const double z = height * (5.0 + 0.8 * k);
      drive.landmarks.push_back({{0.02 * k * height, height, z}, noise});
    }
    estimate = drive.next(scale);
    drive.landmarks.clear();
  }
  return estimate;
}

TEST(RoadScale, LandmarksBelowOrAboveThePlaneSayThatItIsNoRoad) {
  EXPECT_TRUE(drive_with_landmarks(1.0, 0.02).is_measured);
  for (const double ratio : {1.6, 0.6}) {
    const Estimate estimate = drive_with_landmarks(ratio, 0.02);
    EXPECT_FALSE(estimate.is_believed) << ratio;
    EXPECT_FALSE(estimate.is_measured) << ratio;
    EXPECT_EQ(estimate.reason, "landmarks are not on it") << ratio;
    EXPECT_EQ(estimate.sigma, ScaleFilter::kUnknownSigma) << ratio;
    // A guess, the best there is.
    EXPECT_NEAR(std::log(estimate.metres_per_unit / Drive::kMetresPerUnit), 0.0, 0.02) << ratio;
  }
  EXPECT_TRUE(drive_with_landmarks(1.6, 0.5).is_measured);  // nobody knows where they are
}

/// Errors of log(metres per unit) after a drive over a crest, y = bend z^2, that ends at its top.
std::array<double, 2> errors_on_a_crest(std::array<Scale, 2> scales) {
  constexpr double kBend_per_m = 8e-4;
  constexpr int kFrames = 15;
  constexpr double kCrestStep_m = 1.1;
  RoadScene scene{.bump = [](double /*x*/, double z) { return -kBend_per_m * z * z; }};
  const auto first_from_camera = [](int frame) {
    const double z = kCrestStep_m * (frame - kFrames);
    return Rigid3(so3_exp({-2.0 * kBend_per_m * z, 0.0, 0.0}), {0.0, kBend_per_m * z * z, z});
  };
  std::array<Estimate, 2> estimates;
  for (int frame = 0; frame <= kFrames; ++frame) {
    const Rigid3 camera_from_first = first_from_camera(frame).inverse();
    const cv::Mat image = render_road(scene, camera_from_first, static_cast<std::uint64_t>(frame));
    for (std::size_t k = 0; k < scales.size(); ++k) {
      estimates[k] = scales[k].update(make_road_image({image, {}}, scene.camera),
                                      camera_from_first * first_from_camera(frame - 1));
    }
  }
  EXPECT_TRUE(estimates[0].is_measured && estimates[1].is_measured) << estimates[0].reason;
  return {std::log(estimates[0].metres_per_unit), std::log(estimates[1].metres_per_unit)};
}

TEST(RoadScale, ACrestIsNoBiasBecauseThePathTellsTheBend) {
  RoadOptions flat;  // a plane, as if roads did not bend
  flat.path_m = 0.0;
  flat.bend_sigma_per_m = 1e-7;
  const auto [bent, of_plane] = errors_on_a_crest({Scale(), Scale(flat)});
  EXPECT_NEAR(bent, 0.0, 0.012);
  EXPECT_GT(std::abs(of_plane), 0.03);
}

/// A frame on which a textured road is measured without error.
RoadEvidence good_frame() {
  RoadEvidence frame{.num_on = 8,
                     .num_above = 1,
                     .is_in_sight = true,
                     .measured_share = 1.0,
                     .innovation = 0.0,
                     .correlation = 0.8};
  return frame;
}

RoadBelief believed() {
  RoadBelief belief;
  for (int i = 0; i < 20; ++i) {
    belief.add(good_frame());
  }
  EXPECT_TRUE(belief.is_believed());
  return belief;
}

/// Frames until the belief changes; 100: it does not.
int frames_until(bool is_believed, RoadBelief belief, const RoadEvidence& frame) {
  int count = 0;
  while (belief.is_believed() != is_believed && count < 100) {
    belief.add(frame);
    ++count;
  }
  return count;
}

TEST(RoadBelief, AGoodRoadIsBelievedWithinAFewFramesNotAtOnce) {
  EXPECT_FALSE(RoadBelief().is_believed());
  const int count = frames_until(true, {}, good_frame());
  EXPECT_GT(count, 2);
  EXPECT_LT(count, 8);
  RoadEvidence plain = good_frame();  // asphalt without a corner
  plain.num_on = 0;
  plain.num_above = 0;
  EXPECT_LT(frames_until(true, {}, plain), 15);
}

TEST(RoadBelief, AFrameIsWorthTheWayToItWhateverTheRate) {
  RoadEvidence slow = good_frame();
  slow.travelled = 0.02;  // a hand in a room; a third of a height is a frame of a car
  EXPECT_GT(frames_until(true, {}, slow), 10 * frames_until(true, {}, good_frame()));
  RoadEvidence below = slow;
  below.num_on = 5;
  below.num_below = 8;
  EXPECT_GT(frames_until(false, believed(), below), 40);
}

TEST(RoadBelief, EachContradictionKeepsARoadFromBeingBelieved) {
  RoadEvidence below = good_frame();
  below.num_on = 5;
  below.num_below = 8;
  RoadEvidence above = good_frame();
  above.num_on = 10;
  above.num_above = 20;
  RoadEvidence jumps = good_frame();
  jumps.num_on = 2;
  jumps.innovation = 5.0;
  RoadEvidence tilts = good_frame();
  tilts.num_on = 2;
  tilts.num_above = 0;
  tilts.profile_chi2 = 30.0;
  RoadEvidence rolls = tilts;
  rolls.profile_chi2 = 0.0;
  rolls.roll_chi2 = 30.0;
  for (const RoadEvidence& frame : {below, above, jumps, tilts, rolls}) {
    EXPECT_EQ(frames_until(true, {}, frame), 100);
    EXPECT_LT(frames_until(false, believed(), frame), 40);
  }
}

TEST(RoadBelief, UnmeasuredFramesProveNothingAndTakeNothingAway) {
  RoadEvidence nothing;
  nothing.is_in_sight = true;
  EXPECT_EQ(frames_until(true, {}, nothing), 100);
  EXPECT_EQ(frames_until(false, believed(), nothing), 100);
}

TEST(RoadBelief, ARoadMeasuredOnEveryThirdFrameWithoutLandmarksIsNone) {
  RoadBelief belief;
  for (int i = 0; i < 300; ++i) {
    RoadEvidence frame;
    frame.is_in_sight = true;
    if (i % 3 == 0) {
      frame.measured_share = 0.5;
      frame.innovation = 1.0;
      frame.correlation = 0.6;
    }
    belief.add(frame);
    ASSERT_FALSE(belief.is_believed()) << i;
  }
}

TEST(RoadBelief, AnotherMapMustBeProvenOnceMoreButSooner) {
  RoadBelief belief = believed();
  belief.restart();
  EXPECT_FALSE(belief.is_believed());
  EXPECT_LT(frames_until(true, belief, good_frame()), frames_until(true, {}, good_frame()));
}

TEST(RoadBelief, WhatWasWrongForLongHasToBeRightForLong) {
  RoadEvidence wrong = good_frame();
  wrong.num_below = 40;
  RoadBelief belief;
  for (int i = 0; i < 1000; ++i) {
    belief.add(wrong);
  }
  const int count = frames_until(true, belief, good_frame());
  EXPECT_GT(count, 2 * frames_until(true, {}, good_frame()));
  EXPECT_LT(count, 30);
}

/// The sigma's mean factor in the second half of a drive; neighbouring errors correlate by
/// `correlation`.
double factor_of(double spread, double correlation) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, spread * std::sqrt(1.0 - correlation * correlation));
  RoadBelief belief;
  double sum = 0.0;
  double error = 0.0;
  const int num_frames = 2000;
  for (int i = 0; i < num_frames; ++i) {
    RoadEvidence frame = good_frame();
    error = correlation * error + noise(random);
    frame.innovation = error;
    belief.add(frame);
    sum += 2 * i < num_frames ? 0.0 : belief.sigma_factor();
  }
  return 2.0 * sum / num_frames;
}

TEST(RoadBelief, TheSigmaFollowsTheSpreadOfTheMeasurements) {
  EXPECT_NEAR(factor_of(0.5, 0.6), 1.0, 0.25);
  EXPECT_NEAR(factor_of(1.0, 0.6), 2.0, 0.5);
  EXPECT_EQ(factor_of(0.01, 0.6), 0.5);
}

TEST(RoadBelief, TheSigmaIsSmallerWhereErrorsDoNotLast) {
  EXPECT_NEAR(factor_of(1.0, 0.0), 1.0, 0.2);
  EXPECT_GT(factor_of(1.0, 0.85), 2.2);
}

}  // namespace
}  // namespace stemvo
