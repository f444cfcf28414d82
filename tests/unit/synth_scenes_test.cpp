// SPDX-License-Identifier: MIT
#include "geometry/median.hpp"
#include "support/rendered_frames.hpp"
#include "support/test.hpp"
#include "synth/drive.hpp"
#include "synth/renderer.hpp"

namespace stemvo::synth {
namespace {

/// Round a block of 90 m with corners of 15 m, one and a half times, and straight on; the second
/// round is 0.8 m further right and 0.6 m higher.
Trajectory round_a_block() {
  constexpr double kStraight_m = 90.0;
  constexpr double kRadius_m = 15.0;
  const double side_m = kStraight_m + 0.5 * kPi * kRadius_m;
  Trajectory poses;
  Vec3 at = Vec3::Zero();
  const double fork_m = 5.0 * side_m + kStraight_m;
  for (double way_m = 0.0; way_m < fork_m + 100.0; way_m += 1.0) {
    const double turning_m = std::min(way_m, fork_m);
    const double in_side_m = std::fmod(turning_m, side_m);
    const double turned = std::max(0.0, in_side_m - kStraight_m) / kRadius_m;
    const double heading_rad = 0.5 * kPi * std::floor(turning_m / side_m) + turned;
    const Eigen::Matrix3d body = rotation(heading_rad, 0.0, 0.0);
    const double again = std::clamp(way_m / side_m - 4.0, 0.0, 1.0);
    poses.push_back(Rigid3::from_matrix(body, at + body * Vec3(0.8 * again, -0.6 * again, 0.0)));
    at += body.col(2);
  }
  return poses;
}

/// Faces within 30 m of `here` in the scene of one frame.
std::set<std::array<long, 10>> faces_near(const Drive& drive, std::size_t frame, const Vec3& here) {
  Scene scene{here, -Vec3::UnitY(), 0.5};
  add_street(drive.road, drive.arcs_m[frame], 1, scene);
  std::set<std::array<long, 10>> faces;
  for (const Face& face : scene.faces) {
    std::array<long, 10> key{};
    bool is_near = true;
    for (std::size_t i = 0; i < 3; ++i) {
      is_near = is_near && face.points[i].norm() < 30.0F;
      for (int k = 0; k < 3; ++k) {
        key[3 * i + static_cast<std::size_t>(k)] = std::lround(1e3F * face.points[i][k]);
      }
    }
    key[9] = face.style.seed;
    if (is_near) {
      faces.insert(key);
    }
  }
  return faces;
}

/// Corners of faces in the way of a car, up to 8 m ahead.
std::ptrdiff_t num_in_the_way(const Drive& drive, std::size_t frame) {
  const Rigid3& camera = drive.world_from_camera[frame];
  Scene scene{camera.translation, -Vec3::UnitY(), 0.5};
  add_street(drive.road, drive.arcs_m[frame], 1, scene);
  return std::ranges::count_if(scene.faces, [&](const Face& face) {
    const Vec3 at = camera.rotation.conjugate() * face.points[0].cast<double>();
    return std::abs(at.x()) < 1.2 && std::abs(at.y()) < 1.0 && at.z() > 0.0 && at.z() < 8.0;
  });
}

TEST(Visit, DriveThatComesBackSeesTheSameStreet) {
  const Trajectory given = round_a_block();
  const Drive drive = make_drive_along(given);
  int compared = 0;
  for (std::size_t i = 496; i < 655; i += 12) {  // until it goes another way
    std::size_t first = 0;
    for (std::size_t j = 0; j < 350; ++j) {
      const Vec3 here = drive.world_from_camera[i].translation;
      const auto distance_m = [&](std::size_t k) {
        return (drive.world_from_camera[k].translation - here).norm();
      };
      first = distance_m(j) < distance_m(first) ? j : first;
    }
    const Rigid3 between = drive.world_from_camera[first].inverse() * drive.world_from_camera[i];
    ASSERT_LT(between.translation.norm(), 2.0) << i;
    const Vec3 here = drive.world_from_camera[i].translation;
    const auto before = faces_near(drive, first, here);
    const auto now = faces_near(drive, i, here);
    std::vector<std::array<long, 10>> both;
    std::ranges::set_intersection(before, now, std::back_inserter(both));
    ASSERT_GT(before.size(), 500U);
    EXPECT_GT(both.size(), 95 * std::max(before.size(), now.size()) / 100) << "frame " << i;
    EXPECT_NEAR(-between.translation.y(), 0.0, 0.1) << "at the height of the first visit";
    ++compared;
  }
  EXPECT_GE(compared, 10);
  for (const std::size_t i : {640U, 650U, 660U, 670U, 680U, 690U, 700U}) {
    EXPECT_EQ(num_in_the_way(drive, i), 0) << "frame " << i;
    EXPECT_EQ(num_in_the_way(drive, i - 455), 0) << "frame " << i - 455;
  }
  for (std::size_t i = 0; i < given.size(); ++i) {
    const Rigid3 moved = given[i].inverse() * drive.world_from_camera[i];
    EXPECT_LT(std::hypot(moved.translation.x(), moved.translation.z()), 1e-9) << i;
    EXPECT_LT(std::abs(moved.translation.y()), 0.7) << i;
  }
}

TEST(Visit, SameCourtyardOnAnotherWay) {
  const Walk first = make_walk(600, 4, {.walk_rate_hz = 30.0});
  const Walk again = make_walk(600, 4, {.visit = 1});
  EXPECT_EQ(first.courtyard.x_m, again.courtyard.x_m);
  EXPECT_EQ(first.courtyard.wall_m, again.courtyard.wall_m);
  double most_m = 0.0;
  for (std::size_t i = 0; i < 600; ++i) {
    most_m = std::max(
        most_m,
        (first.world_from_camera[i].translation - again.world_from_camera[i].translation).norm());
  }
  EXPECT_GT(most_m, 1.0);
}

/// Texture: the image without its shades over 8 px and more.
cv::Mat texture_of(const RenderedFrame& frame) {
  cv::Mat gray;
  cv::Mat shades;
  gray_of(frame).convertTo(gray, CV_32F);
  cv::GaussianBlur(gray, shades, {}, 8.0);
  return gray - shades;
}

/// Correlation of a frame's texture with that of a frame of another visit, which is warped on to it
/// by depth and poses.
double correlation(const Renderer& first, const Renderer& again, std::size_t i, const Camera& at) {
  const RenderedFrame a = first.render(i);
  const RenderedFrame b = again.render(i);
  const Rigid3 b_from_a = again.world_from_camera()[i].inverse() * first.world_from_camera()[i];
  const cv::Mat map = predict(a, b, b_from_a, at);
  cv::Mat there;
  cv::remap(texture_of(b), there, map, {}, cv::INTER_LINEAR);
  std::vector<cv::Mat> xy;
  cv::split(map, xy);
  cv::Mat here = texture_of(a);
  here.setTo(0.0F, xy[0] < -50.0F);
  there.setTo(0.0F, xy[0] < -50.0F);
  return here.dot(there) / std::sqrt(here.dot(here) * there.dot(there));
}

TEST(Visit, ShowsTheSameThingsInOtherLight) {
  const Camera camera = kitti_camera(0.5);
  const Drive first_drive = make_own_drive(40, 3);
  Drive again_drive = first_drive;
  drive_again(3, 1, again_drive);
  const Renderer first(first_drive, camera, 3);
  const Renderer again(again_drive, camera, 3, {.visit = 1});
  const Renderer elsewhere(first_drive, camera, 4);
  for (const std::size_t i : {5U, 25U}) {
    EXPECT_GT(correlation(first, again, i, camera), 0.8);
    EXPECT_LT(correlation(first, elsewhere, i, camera), 0.65) << "kerbs and the horizon remain";
    const double before = cv::mean(gray_of(first.render(i)))[0];
    const double now = cv::mean(gray_of(again.render(i)))[0];
    EXPECT_GT(std::abs(now / before - 1.0), 0.03) << "no other light";
  }
}

const Camera kCamera = kitti_camera(0.25);

Renderer with_traffic(const Drive& drive, std::uint64_t seed) {
  return {drive, kCamera, seed, {.traffic = true}};
}

/// First and last frame of the first stand of at least 3 s; 0, 0: none.
std::pair<std::size_t, std::size_t> first_stand(const Drive& drive) {
  std::size_t begin = 0;
  for (std::size_t i = 1; i < drive.arcs_m.size(); ++i) {
    if (drive.arcs_m[i] - drive.arcs_m[begin] > 1e-6) {
      if (i - begin > 30) {
        return {begin, i - 1};
      }
      begin = i;
    }
  }
  return {0, 0};
}

/// Differences in gray levels between a frame and the next one, which is warped on to it as if
/// nothing moved: where the mask says that nothing does, and where it says that something does.
struct Differences {
  std::vector<double> still;
  std::vector<double> moving;

  Differences(const Renderer& renderer, std::size_t i) {
    const RenderedFrame a = renderer.render(i);
    const RenderedFrame b = renderer.render(i + 1);
    const auto& poses = renderer.world_from_camera();
    const cv::Mat map = predict(a, b, poses[i + 1].inverse() * poses[i], kCamera);
    cv::Mat warped;
    cv::Mat mask;
    cv::remap(gray_of(b), warped, map, {}, cv::INTER_CUBIC);
    cv::remap(b.moving, mask, map, {}, cv::INTER_NEAREST);
    cv::Mat near_moving;  // outlines are a mixture of both
    cv::dilate(a.moving | mask, near_moving, cv::Mat::ones(5, 5, CV_8U));
    cv::Mat inside_moving;
    cv::erode(a.moving, inside_moving, cv::Mat::ones(3, 3, CV_8U));
    const cv::Mat gray = gray_of(a);
    for (int y = 0; y < gray.rows; ++y) {
      for (int x = 0; x < gray.cols; ++x) {
        const double difference = std::abs(gray.at<uchar>(y, x) - warped.at<uchar>(y, x));
        const bool is_seen = map.at<cv::Vec2f>(y, x)[0] > -50.0F;
        if (is_seen && near_moving.at<uchar>(y, x) == 0) {
          still.push_back(difference);
        } else if (inside_moving.at<uchar>(y, x) != 0) {
          moving.push_back(difference);
        }
      }
    }
  }
};

/// Standing, what the mask leaves out changes by noise alone.
TEST(TrafficMask, IsWhereTheImageChangesWhileTheCameraStands) {
  int stands = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Drive drive = make_own_drive(260, seed, true);
    const auto [begin, end] = first_stand(drive);
    if (end == 0) {
      continue;
    }
    ++stands;
    const Renderer renderer = with_traffic(drive, seed);
    const auto& poses = renderer.world_from_camera();
    EXPECT_LT((poses[end].translation - poses[begin].translation).norm(), 1e-3);
    for (const std::size_t i : {begin + 8, begin + 20}) {
      Differences differences(renderer, i);
      ASSERT_GT(differences.moving.size(), 100U) << "nothing crosses, seed " << seed;
      std::ranges::sort(differences.still);
      // A few pixels see a little of something far away.
      EXPECT_LT(differences.still[differences.still.size() * 99 / 100], 9.0) << "seed " << seed;
      EXPECT_LT(median(differences.still), 3.0);
      EXPECT_GT(median(differences.moving), 2.0 * median(differences.still)) << "seed " << seed;
    }
  }
  EXPECT_GE(stands, 2);
}

TEST(TrafficTest, FillsAThirdOfTheImageFromTheFirstFrameOn) {
  int lorries = 0;
  double most = 0.0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const Renderer renderer = with_traffic(make_own_drive(30, seed, true), seed);
    const double share = cv::countNonZero(renderer.render(0).moving) /
                         static_cast<double>(kCamera.width_px * kCamera.height_px);
    lorries += share > 0.2 ? 1 : 0;
    most = std::max(most, share);
  }
  EXPECT_GE(lorries, 2);
  EXPECT_GT(most, 0.3);
  EXPECT_LT(most, 0.7);
}

}  // namespace
}  // namespace stemvo::synth
