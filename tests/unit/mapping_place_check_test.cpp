// SPDX-License-Identifier: MIT
#include "geometry/pose_refinement.hpp"
#include "mapping/descriptors.hpp"
#include "mapping/place_check.hpp"
#include "support/kept_places.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

const Rigid3 kOldPose;
/// A car that comes back 0.7 m aside, 2 m further, turned by 3 degrees.
const Rigid3 kNewPose(so3_exp({0.005, 0.05, 0.01}), {0.7, 0.05, 2.0});
constexpr double kOldUnits = 1.3;
constexpr double kNewUnits = 0.8;

DescribedPoints street(unsigned seed = 1) {
  const auto path = DriveTracks::repeat({Eigen::Quaterniond::Identity(), {0, 0, 1}}, 20);
  return DescribedPoints(points_along(path, 1200, seed), seed);
}

/// The street, what was seen of it, and what is seen now.
std::tuple<DescribedPoints, KeptKeyframe, KeptKeyframe> two_views() {
  DescribedPoints points = street();
  KeptKeyframe old = points.see(kOldPose, kOldUnits, 0);
  KeptKeyframe recent = points.see(kNewPose, kNewUnits, 100000);
  return {std::move(points), std::move(old), std::move(recent)};
}

PlaceView view_of(const KeptKeyframe& keyframe) {
  return {keyframe.camera, keyframe.corners, keyframe.descriptors};
}

/// A point of the new keyframe in the old one's unit.
Similarity3 true_similarity() {
  const Rigid3 motion = kOldPose.inverse() * kNewPose;
  return {kOldUnits / kNewUnits, motion.rotation, kOldUnits * motion.translation};
}

double turn_rad(const Similarity3& a, const Similarity3& b) {
  return a.rotation.angularDistance(b.rotation);
}

TEST(PlaceCheck, FindsTheSimilarityOfTwoViews) {
  auto [points, old, recent] = two_views();
  for (std::size_t i = 0; i < recent.descriptors.size(); i += 3) {
    recent.descriptors[i] = points.draw();  // a corner that is new
  }
  const auto loop = check_place(view_of(old), view_of(recent));
  ASSERT_TRUE(loop.has_value());
  const Similarity3 truth = true_similarity();
  EXPECT_LT(turn_rad(loop->from_to, truth), 4.0 * loop->sigma_rad);
  EXPECT_LT((loop->from_to.translation - truth.translation).norm(), 6.0 * loop->sigma_translation);
  EXPECT_LT(std::abs(std::log(loop->from_to.scale / truth.scale)), 4.0 * loop->sigma_log_scale);
  EXPECT_LT(loop->sigma_rad, 0.005);
  EXPECT_LT(loop->sigma_translation, 0.2);
  EXPECT_LT(loop->sigma_log_scale, 0.02);
  EXPECT_GE(loop->corners.size(), 30U);
  for (const auto& [mine, other] : loop->corners) {
    EXPECT_EQ(old.corners[static_cast<std::size_t>(mine)].track_id + 100000,
              recent.corners[static_cast<std::size_t>(other)].track_id);
  }
}

TEST(PlaceCheck, BothMustAgree) {
  auto [points, old, recent] = two_views();
  for (KeptCorner& corner : recent.corners) {
    corner.in_camera *= corner.track_id % 2 == 0 ? 1.0F : 2.0F;  // what it sees is another shape
  }
  EXPECT_FALSE(check_place(view_of(old), view_of(recent)).has_value());
}

TEST(PlaceCheck, APartOfTheImageIsNotEnough) {
  auto [points, old, recent] = two_views();
  for (std::size_t i = 0; i < recent.corners.size(); ++i) {
    const Eigen::Vector2f uv = recent.corners[i].uv;
    if (uv.x() > 600.0F || uv.y() < 90.0F) {
      recent.descriptors[i] = points.draw();
    }
  }
  EXPECT_FALSE(check_place(view_of(old), view_of(recent)).has_value());
}

TEST(PlaceCheck, LandmarksThatAreNewHaveWrongDepths) {
  auto [points, old, recent] = two_views();
  std::mt19937 random(1);
  std::normal_distribution<float> error(1.0F, 0.08F);
  for (KeptCorner& corner : recent.corners) {
    corner.in_camera *= error(random);
  }
  const auto loop = check_place(view_of(old), view_of(recent));
  ASSERT_TRUE(loop.has_value());
  const auto num_seen = static_cast<double>(recent.corners.size());
  EXPECT_GT(static_cast<double>(loop->corners.size()), 0.8 * num_seen);
  EXPECT_LT(turn_rad(loop->from_to, true_similarity()), 0.01);
}

/// So few corners of each look as they did that none tells anything alone.
TEST(PlaceCheck, ThoseAroundAPlaceTellTogetherWhereTheCameraIs) {
  DescribedPoints points = street();
  const KeptKeyframe recent = points.see(kNewPose, kNewUnits, 0);
  std::vector<KeptKeyframe> places;
  std::vector<PlaceAround> around;
  for (const int k : {0, 1, 2}) {
    const Rigid3 pose = kOldPose * Rigid3(so3_exp({0.0, 0.02 * k, 0.0}), {0.1 * k, 0.0, 1.0 * k});
    KeptKeyframe& place = places.emplace_back(points.see(pose, kOldUnits, 0));
    int num_alike = 0;
    for (std::size_t i = 0; i < place.corners.size(); ++i) {
      const bool is_alike = place.corners[i].track_id % 3 == k && num_alike < 14;
      num_alike += is_alike ? 1 : 0;
      place.descriptors[i] = is_alike ? place.descriptors[i] : points.draw();
    }
  }
  for (const KeptKeyframe& place : places) {
    EXPECT_FALSE(check_place(view_of(place), view_of(recent)).has_value());
    Similarity3 from_it(places[0].world_from_camera.inverse() * place.world_from_camera);
    around.push_back({from_it, view_of(place)});
  }
  const auto expect = [&](std::size_t num, const PlaceView& seen) {
    return expect_by_places(kitti_camera(), std::span(around).first(num), seen);
  };
  const auto expected = expect(3, view_of(recent));
  ASSERT_TRUE(expected.has_value());
  const Similarity3 found = expected->recent_from_old.inverse();
  EXPECT_LT(turn_rad(found, true_similarity()), 0.01);
  EXPECT_LT((found.translation - true_similarity().translation).norm(), 0.3);
  EXPECT_NEAR(found.scale, true_similarity().scale, 0.1);
  EXPECT_FALSE(expect(1, view_of(recent)).has_value());
  DescribedPoints other = street(2);
  const KeptKeyframe elsewhere = other.see(kNewPose, kNewUnits, 0);
  EXPECT_FALSE(expect(3, view_of(elsewhere)).has_value());
}

/// A third of the image, and few of its corners, but where they were expected.
TEST(PlaceCheck, WhatIsExpectedNeedsFewerCorners) {
  auto [points, old, recent] = two_views();
  int num_left = 0;
  for (std::size_t i = 0; i < recent.corners.size(); ++i) {
    const bool stays = recent.corners[i].uv.x() < 500.0F && num_left < 26;
    num_left += stays ? 1 : 0;
    recent.descriptors[i] = stays ? points.changed(recent.descriptors[i], 0.15) : points.draw();
  }
  const Similarity3 truth = true_similarity();
  Similarity3 expected = truth;
  expected.rotation = truth.rotation * so3_exp({0.0, 0.02, 0.01});
  expected.scale *= 1.1;
  EXPECT_FALSE(check_place(view_of(old), view_of(recent)).has_value());
  const auto loop = check_place(view_of(old), view_of(recent), Expectation{expected.inverse()});
  ASSERT_TRUE(loop.has_value());
  EXPECT_LT(turn_rad(loop->from_to, truth), 0.005);
  EXPECT_LT(std::abs(std::log(loop->from_to.scale / truth.scale)), 0.05);
  const Expectation by_sighting{expected.inverse(), Expectation::kByPoses_rad, false};
  EXPECT_FALSE(check_place(view_of(old), view_of(recent), by_sighting).has_value());
  DescribedPoints other = street(2);
  const KeptKeyframe elsewhere = other.see(kNewPose, kNewUnits, 100000);
  EXPECT_FALSE(
      check_place(view_of(old), view_of(elsewhere), Expectation{expected.inverse()}).has_value());
}

/// Errors over their own standard deviations: rotation, translation, log scale.
TEST(SimilarityRefinement, CovarianceIsThatOfTheErrors) {
  constexpr double kNoise_px = 0.8;
  constexpr int kRuns = 60;
  const Similarity3 truth = true_similarity();
  Eigen::Matrix<double, 7, 1> mean_square = Eigen::Matrix<double, 7, 1>::Zero();
  for (int run = 0; run < kRuns; ++run) {
    std::mt19937 random(static_cast<unsigned>(run));
    std::normal_distribution<double> noise(0.0, kNoise_px);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    CrossObservations seen{kitti_camera(), kitti_camera(), {}, {}};
    for (int i = 0; i < 80; ++i) {
      const double depth = 15.0 + 10.0 * uniform(random);
      const double x = 0.6 * depth * uniform(random);
      const double y = 0.2 * depth * uniform(random);
      const Eigen::Vector3d in_b(x, y, depth);
      const Eigen::Vector3d in_a = truth * in_b;
      const double u = noise(random);
      const double v = noise(random);
      const Eigen::Vector2d off(u, v);
      if (i % 2 == 0) {
        seen.of_b.push_back({in_b, seen.a.project(in_a) + off});
      } else {
        seen.of_a.push_back({in_a, seen.b.project(in_b) + off});
      }
    }
    Similarity3 start = truth;
    start.scale *= 1.1;
    start.rotation = so3_exp({0.02, -0.02, 0.01}) * start.rotation;
    start.translation += Eigen::Vector3d(0.3, -0.2, 0.5);
    const auto found = refine_similarity(start, seen, {.loss_scale_px = 100.0});
    Eigen::Matrix<double, 7, 1> error;
    error << so3_log(truth.rotation * found.a_from_b.rotation.conjugate()),
        truth.translation - found.a_from_b.translation,
        std::log(truth.scale / found.a_from_b.scale);
    mean_square += error.cwiseAbs2().cwiseQuotient(found.covariance.diagonal()) /
                   (kRuns * kNoise_px * kNoise_px);
  }
  for (int i = 0; i < 7; ++i) {
    EXPECT_NEAR(mean_square[i], 1.0, 0.6) << i;
  }
}

cv::Mat texture() {
  cv::Mat blobs(200, 320, CV_8U);
  cv::RNG(7).fill(blobs, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(blobs, blobs, {}, 2.0);
  return blobs;
}

Descriptor described(const ChannelImage& image,
                     const Eigen::Vector2f& uv,
                     double roll_rad = 0.0,
                     double scale = 1.0) {
  std::vector<KeptCorner> corners(1);
  corners[0].uv = uv;
  return describe(image, corners, roll_rad, scale).at(0);
}

TEST(Descriptors, TurnWithTheImage) {
  const cv::Mat upright = texture();
  // The camera is turned clockwise, so what it shows turns the other way.
  const double turn_rad = 0.3;
  const Eigen::Vector2f centre(160.0F, 100.0F);
  const Eigen::Rotation2Df turn(static_cast<float>(-turn_rad));
  cv::Mat turned;
  cv::warpAffine(upright, turned, cv::getRotationMatrix2D({160.0F, 100.0F}, 17.1887, 1.0),
                 upright.size());
  const Eigen::Vector2f uv(150.0F, 80.0F);
  const Eigen::Vector2f turned_uv = centre + turn * (uv - centre);
  const double roll = image_roll_rad(so3_exp({0.0, 0.0, turn_rad}));
  const Descriptor one = described({upright, {}}, uv);
  EXPECT_LE(differing_bits(one, described({turned, {}}, turned_uv, roll)), 30);
  EXPECT_GT(differing_bits(one, described({turned, {}}, turned_uv)), 40);
}

TEST(Descriptors, ShowFromFartherOffWhatIsSmaller) {
  const cv::Mat near = texture();
  cv::Mat far;
  const double scale = kOtherScales[0];
  cv::resize(near, far, {}, scale, scale, cv::INTER_AREA);
  const Eigen::Vector2f uv(150.0F, 80.0F);
  const Eigen::Vector2f far_uv = (scale * (uv.array().cast<double>() + 0.5) - 0.5).cast<float>();
  const Descriptor as_far = described({far, {}}, far_uv);
  EXPECT_GT(differing_bits(as_far, described({near, {}}, uv)), 50);
  EXPECT_LE(differing_bits(as_far, described({near, {}}, uv, 0.0, scale)), 10);
}

TEST(Descriptors, PixelsAreTheInputs) {
  ChannelImage half{texture(), {}};
  half.map.scale = {2.0, 2.0};
  half.map.offset_px = {0.5, 0.5};
  const ChannelImage whole{texture(), {}};
  EXPECT_EQ(described(half, {200.5F, 160.5F}), described(whole, {100.0F, 80.0F}));
}

TEST(Descriptors, MatchesAreEachOthersAndClear) {
  DescribedPoints points({});
  std::vector<Descriptor> first;
  std::vector<Descriptor> second;
  for (int i = 0; i < 50; ++i) {
    first.push_back(points.draw());
    second.insert(second.begin(), points.changed(first.back(), 0.1));
  }
  first[3] = kNoDescriptor;
  second[49 - 4] = kNoDescriptor;
  second.push_back(second[49 - 5]);  // two like it: neither is clear
  const auto pairs = match_descriptors(first, second);
  EXPECT_EQ(pairs.size(), 47U);
  for (const auto& [i, j] : pairs) {
    EXPECT_EQ(j, 49 - i);
  }
}

}  // namespace
}  // namespace stemvo
