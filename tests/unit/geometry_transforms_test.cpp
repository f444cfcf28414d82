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

double squared_error(const Similarity3& similarity, const Points& source, const Points& target) {
  double sum = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    sum += (similarity * source[i] - target[i]).squaredNorm();
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

TEST(AlignPositions, APathTheOtherWayKeepsToTheSizeOfTheTrueOne) {
  const Points source = {{0, 0, 0}, {0, 0, -100}, {0, 0, -200}};
  const Points target = {{0, 0, 0}, {0, 0, 1}, {0, 0, 2}};
  EXPECT_NEAR(align_positions(source, target, Alignment::kScale).scale, 0.01, 1e-12);
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
}

TEST(Rigid3, LongChainStaysOrthonormal) {
  const Rigid3 step = SceneRandom(4).motion(0.3);
  Rigid3 pose;
  for (int i = 0; i < 100000; ++i) {
    pose = pose * step;
  }
  EXPECT_NEAR(pose.rotation.norm(), 1.0, 1e-14);
  const Eigen::Matrix3d r = pose.rotation_matrix();
  EXPECT_THAT(r * r.transpose(), IsNear(Eigen::Matrix3d::Identity(), 1e-13));
}

TEST(Rigid3, FromMatrixTakesTheNearestRotation) {
  const Rigid3 motion = SceneRandom(5).motion(3.0);
  // A pose file with 7 digits.
  const Matrix34d rounded = (motion.matrix() * 1e6).array().round() * 1e-6;
  const Rigid3 read = Rigid3::from_matrix(rounded);
  EXPECT_THAT(read, IsNearMotion(motion, 2e-6));
  EXPECT_NEAR(read.rotation.norm(), 1.0, 1e-15);
  // A symmetric stretch has the identity as its nearest rotation, whatever its size.
  Eigen::Matrix3d stretch;
  stretch << 2.0, 0.3, 0.1, 0.3, 1.0, 0.0, 0.1, 0.0, 3.0;
  EXPECT_THAT(Rigid3::from_matrix(stretch, Eigen::Vector3d::Zero()), IsNearMotion(Rigid3(), 1e-14));
}

TEST(Rigid3, AngleIsExactForSmallRotations) {
  for (const double angle : {0.0, 1e-12, 1e-9, 1e-4, 1.0, 3.0}) {
    const Eigen::Vector3d axis = Eigen::Vector3d(1.0, -2.0, 0.5).normalized();
    EXPECT_NEAR(Rigid3(so3_exp(angle * axis), Eigen::Vector3d::Zero()).angle_rad(), angle,
                1e-15 + 1e-14 * angle);
  }
  EXPECT_NEAR(Rigid3(so3_exp({4.0, 0.0, 0.0}), Eigen::Vector3d::Zero()).angle_rad(),
              2.0 * std::numbers::pi - 4.0, 1e-14);
}

TEST(So3, ExpIsRodrigues) {
  const Eigen::Vector3d w(0.3, -0.5, 1.1);
  const Eigen::Matrix3d expected = Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix();
  EXPECT_THAT(so3_exp(w).toRotationMatrix(), IsNear(expected, 1e-14));
  // A turn about y (down) by a right angle takes forward to right.
  const Eigen::Vector3d turned =
      so3_exp({0.0, 0.5 * std::numbers::pi, 0.0}) * Eigen::Vector3d::UnitZ();
  EXPECT_THAT(turned, IsNear(Eigen::Vector3d(1.0, 0.0, 0.0), 1e-15));
}

TEST(So3, LogIsTheInverseOfExp) {
  const Eigen::Vector3d axis = Eigen::Vector3d(2.0, -1.0, 0.5).normalized();
  for (const double angle : {0.0, 1e-300, 1e-15, 1e-11, 1e-9, 9.9e-5, 1.1e-4, 0.1, 2.0, 3.1415}) {
    const Eigen::Vector3d w = angle * axis;
    EXPECT_THAT(so3_log(so3_exp(w)), IsNear(w, 1e-15 + 1e-11 * angle)) << angle;
  }
  // Beyond pi the shorter way round.
  const Eigen::Vector3d shorter = -(2.0 * std::numbers::pi - 4.0) * axis;
  EXPECT_THAT(so3_log(so3_exp(4.0 * axis)), IsNear(shorter, 1e-14));
  const Eigen::Vector3d half_turn = std::numbers::pi * axis;
  EXPECT_NEAR(so3_log(so3_exp(half_turn)).norm(), std::numbers::pi, 1e-14);
}

}  // namespace
}  // namespace stemvo
