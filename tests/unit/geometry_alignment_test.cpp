// SPDX-License-Identifier: MIT
#include "geometry/alignment.hpp"
#include "stemvo/rigid3.hpp"
#include "support/matchers.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

using Points = std::vector<Eigen::Vector3d>;

Points random_points(SceneRandom& random, int n) {
  Points points;
  for (int i = 0; i < n; ++i) {
    points.push_back(random.uniform(0.0, 50.0) * random.direction());
  }
  return points;
}

Similarity3 random_similarity(SceneRandom& random, double scale) {
  return {scale, so3_exp(random.uniform(0.0, 3.1) * random.direction()),
          random.uniform(0.0, 100.0) * random.direction()};
}

Points transform(const Similarity3& similarity, const Points& points) {
  Points result;
  for (const Eigen::Vector3d& point : points) {
    result.push_back(similarity * point);
  }
  return result;
}

double squared_error(const Similarity3& similarity, const Points& source, const Points& target) {
  const Points moved = transform(similarity, source);
  double sum = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    sum += (moved[i] - target[i]).squaredNorm();
  }
  return sum;
}

void expect_sound(const Similarity3& s) {
  EXPECT_TRUE(std::isfinite(s.scale));
  EXPECT_GT(s.scale, 0.0);
  EXPECT_TRUE(s.translation.allFinite());
  EXPECT_NEAR(s.rotation.norm(), 1.0, 1e-12);
}

void expect_identity(const Similarity3& s) {
  EXPECT_EQ(s.scale, 1.0);
  EXPECT_EQ(s.rotation.coeffs(), Eigen::Quaterniond::Identity().coeffs());
  EXPECT_EQ(s.translation, Eigen::Vector3d(Eigen::Vector3d::Zero()));
}

TEST(AlignPositions, FindsThePlantedSimilarity) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SceneRandom random(seed);
    const Points source = random_points(random, 3 + static_cast<int>(seed));
    const Similarity3 planted = random_similarity(random, random.uniform(0.1, 10.0));
    const Similarity3 found = align_positions(source, transform(planted, source), Alignment::kSim3);
    EXPECT_NEAR(found.scale, planted.scale, 1e-9);
    EXPECT_THAT(found.rotation.toRotationMatrix(),
                IsNear(planted.rotation.toRotationMatrix(), 1e-9));
    EXPECT_THAT(found.translation, IsNear(planted.translation, 1e-7));
  }
}

TEST(AlignPositions, Se3LeavesTheScale) {
  SceneRandom random(1);
  const Points source = random_points(random, 30);
  const Similarity3 planted = random_similarity(random, 1.0);
  const Similarity3 found = align_positions(source, transform(planted, source), Alignment::kSe3);
  EXPECT_EQ(found.scale, 1.0);
  EXPECT_THAT(found.rotation.toRotationMatrix(), IsNear(planted.rotation.toRotationMatrix(), 1e-9));
  Similarity3 larger = planted;
  larger.scale = 3.0;
  const Similarity3 of_larger = align_positions(source, transform(larger, source), Alignment::kSe3);
  EXPECT_EQ(of_larger.scale, 1.0);
  EXPECT_THAT(of_larger.rotation.toRotationMatrix(),
              IsNear(planted.rotation.toRotationMatrix(), 1e-9));
}

TEST(AlignPositions, NoSmallChangeFitsNoisyPointsBetter) {
  SceneRandom random(2);
  const Points source = random_points(random, 50);
  Points target = transform(random_similarity(random, 2.0), source);
  for (Eigen::Vector3d& point : target) {
    point += 3.0 * random.direction();
  }
  const Similarity3 best = align_positions(source, target, Alignment::kSim3);
  const double least = squared_error(best, source, target);
  for (int axis = 0; axis < 3; ++axis) {
    for (const double step : {-1e-4, 1e-4}) {
      Similarity3 turned = best;
      turned.rotation = so3_exp(step * Eigen::Vector3d::Unit(axis)) * best.rotation;
      Similarity3 moved = best;
      moved.translation(axis) += step;
      EXPECT_GT(squared_error(turned, source, target), least);
      EXPECT_GT(squared_error(moved, source, target), least);
    }
  }
  for (const double factor : {0.9999, 1.0001}) {
    Similarity3 scaled = best;
    scaled.scale *= factor;
    EXPECT_GT(squared_error(scaled, source, target), least);
  }
}

TEST(AlignPositions, APathTheOtherWayKeepsToTheSizeOfTheTrueOne) {
  const Points source = {{0, 0, 0}, {0, 0, -100}, {0, 0, -200}};
  const Points target = {{0, 0, 0}, {0, 0, 1}, {0, 0, 2}};
  EXPECT_NEAR(align_positions(source, target, Alignment::kScale).scale, 0.01, 1e-12);
}

TEST(AlignPositions, AMirrorImageIsNotMirroredBack) {
  SceneRandom random(3);
  const Points source = random_points(random, 30);
  Points mirrored = source;
  for (Eigen::Vector3d& point : mirrored) {
    point.x() = -point.x();
  }
  for (const Alignment alignment : {Alignment::kSe3, Alignment::kSim3}) {
    expect_sound(align_positions(source, mirrored, alignment));
  }
  // A flat trajectory can be its own mirror image by turning over.
  Points flat = source;
  Points flat_mirrored = mirrored;
  for (std::size_t i = 0; i < flat.size(); ++i) {
    flat[i].y() = 0.0;
    flat_mirrored[i].y() = 0.0;
  }
  const Similarity3 turned_over = align_positions(flat, flat_mirrored, Alignment::kSim3);
  expect_sound(turned_over);
  EXPECT_NEAR(squared_error(turned_over, flat, flat_mirrored), 0.0, 1e-18);
}

TEST(AlignPositions, AStraightLineTakesTheSmallestTurn) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SceneRandom random(seed);
    const Eigen::Vector3d from = random.direction();
    const Eigen::Vector3d to = random.direction();
    Points source;
    Points target;
    for (int i = 0; i < 20; ++i) {
      source.emplace_back(i * from);
      target.emplace_back(i * to);
    }
    const Similarity3 found = align_positions(source, target, Alignment::kSim3);
    EXPECT_NEAR(squared_error(found, source, target), 0.0, 1e-18);
    const double turn_rad = Rigid3(found.rotation, found.translation).angle_rad();
    EXPECT_NEAR(turn_rad, direction_error_rad(from, to), 1e-7);
    // Two points are a line, driving the other way is one as well.
    expect_sound(align_positions(source, Points(source.rbegin(), source.rend()), Alignment::kSim3));
    expect_sound(align_positions(Points(source.begin(), source.begin() + 2),
                                 Points(target.begin(), target.begin() + 2), Alignment::kSim3));
  }
}

TEST(AlignPositions, EqualPointsOnlyMove) {
  const Eigen::Vector3d from(0.1, 0.2, 0.3);
  const Eigen::Vector3d to(5.0, -7.1, 100.3);
  for (const std::size_t n : {1U, 2U, 17U}) {
    for (const Alignment alignment : {Alignment::kSe3, Alignment::kSim3}) {
      const Similarity3 found = align_positions(Points(n, from), Points(n, to), alignment);
      EXPECT_EQ(found.scale, 1.0);
      EXPECT_EQ(found.rotation.coeffs(), Eigen::Quaterniond::Identity().coeffs());
      EXPECT_THAT(found.translation, IsNear(to - from, 1e-12));
    }
  }
  SceneRandom random(5);
  const Points spread = random_points(random, 17);
  expect_sound(align_positions(spread, Points(17, to), Alignment::kSim3));
  expect_sound(align_positions(Points(17, from), spread, Alignment::kSim3));
}

TEST(AlignPositions, ScaleIsAboutTheOrigin) {
  const Points source = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 0.0, 2.0}};
  const Points target = {{0.0, 0.0, 0.0}, {3.0, 1.0, 0.0}, {0.0, 5.0, 4.0}};
  const Similarity3 found = align_positions(source, target, Alignment::kScale);
  EXPECT_DOUBLE_EQ(found.scale, (3.0 + 8.0) / (1.0 + 4.0));
  EXPECT_EQ(found.rotation.coeffs(), Eigen::Quaterniond::Identity().coeffs());
  EXPECT_EQ(found.translation, Eigen::Vector3d(Eigen::Vector3d::Zero()));
  expect_identity(align_positions(Points(3, Eigen::Vector3d::Zero()), target, Alignment::kScale));
}

TEST(AlignPositions, IdentityWhereTheFitIsUndefined) {
  const Eigen::Vector3d broken(1.0, std::numeric_limits<double>::quiet_NaN(), 0.0);
  const Points good = {{0.0, 0.0, 0.0}, {3.0, 1.0, 0.0}, {0.0, 5.0, 4.0}};
  const Points bad = {{0.0, 0.0, 0.0}, broken, {0.0, 5.0, 4.0}};
  for (const Alignment alignment :
       {Alignment::kNone, Alignment::kScale, Alignment::kSe3, Alignment::kSim3}) {
    expect_identity(align_positions({}, {}, alignment));
    expect_identity(align_positions(good, bad, alignment));
    expect_identity(align_positions(bad, good, alignment));
  }
  expect_identity(align_positions(good, good, Alignment::kNone));
  EXPECT_THROW(static_cast<void>(align_positions(good, {}, Alignment::kSim3)), std::logic_error);
}

}  // namespace
}  // namespace stemvo
