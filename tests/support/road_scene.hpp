// SPDX-License-Identifier: MIT
#pragma once

#include "odometry/road/image.hpp"
#include "odometry/road/model.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"
#include "support/test.hpp"

namespace stemvo::testing {

/// A road rendered by intersecting viewing rays with it, for tests of the metric scale: metres,
/// known plane, known motion. Small (half of KITTI's size), so that a test takes milliseconds.
struct RoadScene {
  Camera camera{718.0, 718.0, 330.0, 120.0, 660, 310};
  double height_m = 1.65;
  double slope_rad = 0.0;  ///< y = height + slope z + roll x in the camera
  double roll_rad = 0.0;
  double noise_gray = 0.0;
  bool has_road = true;  ///< false: a gray field
  /// Metres that the surface rises above the plane at (x, z) of the *current* camera's ground.
  std::function<double(double x, double z)> bump = nullptr;
  /// Pixels that show something that moves with the camera (a car ahead).
  std::function<bool(int u, int v)> is_covered = nullptr;
};

/// Gray value noise of unit cells in [-1, 1], smooth between lattice points.
inline double value_noise(double x, double y, std::uint32_t seed) {
  const auto lattice = [seed](std::int64_t i, std::int64_t j) {
    auto h = static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15ULL ^
             static_cast<std::uint64_t>(j) * 0xC2B2AE3D27D4EB4FULL ^ (seed * 0x165667B19E3779F9ULL);
    h = (h ^ (h >> 29)) * 0xBF58476D1CE4E5B9ULL;
    h = (h ^ (h >> 32)) * 0x94D049BB133111EBULL;
    return static_cast<double>(h >> 40) / static_cast<double>(1U << 23) - 1.0;
  };
  const double fx = std::floor(x);
  const double fy = std::floor(y);
  const auto smooth = [](double a) { return a * a * (3.0 - 2.0 * a); };
  const double a = smooth(x - fx);
  const double b = smooth(y - fy);
  const auto i = static_cast<std::int64_t>(fx);
  const auto j = static_cast<std::int64_t>(fy);
  return (1 - b) * ((1 - a) * lattice(i, j) + a * lattice(i + 1, j)) +
         b * ((1 - a) * lattice(i, j + 1) + a * lattice(i + 1, j + 1));
}

/// Asphalt: four sizes of grain, each faded out where a pixel is larger than it.
inline double asphalt(double x, double z, double pixel_m) {
  double gray = 0.0;
  const std::array<double, 4> sizes_m{0.08, 0.17, 0.4, 1.1};
  for (std::size_t k = 0; k < sizes_m.size(); ++k) {
    const double ratio = pixel_m / sizes_m[k];
    gray += 14.0 / (1.0 + 4.0 * ratio * ratio) *
            value_noise(x / sizes_m[k], z / sizes_m[k], static_cast<std::uint32_t>(k));
  }
  return gray;
}

/// The image of a camera that is `camera_from_cur` away from the current one (whose plane the
/// scene describes).
inline cv::Mat render_road(const RoadScene& scene,
                           const Rigid3& camera_from_cur,
                           std::uint64_t seed) {
  const Rigid3 cur_from_camera = camera_from_cur.inverse();
  const Eigen::Matrix3d rotation = cur_from_camera.rotation_matrix();
  const Eigen::Vector3d origin = cur_from_camera.translation;
  const Eigen::Vector3d normal(-scene.roll_rad, 1.0, -scene.slope_rad);
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> noise;
  const Camera& camera = scene.camera;
  cv::Mat image(camera.height_px, camera.width_px, CV_8U);
  const auto shade = [&](double u, double v) {
    const Eigen::Vector3d ray = rotation * camera.normalize({u, v}).homogeneous();
    const double down = normal.dot(ray);
    if (!scene.has_road || down < 0.02) {
      return 0.0;
    }
    double height = scene.height_m * normal.norm();
    double depth = (height - normal.dot(origin)) / down;
    Eigen::Vector3d point = origin + depth * ray;
    for (int i = 0; i < 4 && scene.bump != nullptr; ++i) {
      height = scene.height_m * normal.norm() - scene.bump(point.x(), point.z());
      depth = (height - normal.dot(origin)) / down;
      point = origin + depth * ray;
    }
    return asphalt(point.x(), point.z(), depth / camera.fy_px * depth / scene.height_m);
  };
  for (int v = 0; v < camera.height_px; ++v) {
    for (int u = 0; u < camera.width_px; ++u) {
      double gray = 110.0;
      if (scene.is_covered != nullptr && scene.is_covered(u, v)) {
        gray += 40.0 * value_noise(u / 5.0, v / 5.0, 99);
      } else {
        for (const double d : {-0.25, 0.25}) {
          gray += 0.25 * (shade(u + d, v - 0.25) + shade(u + d, v + 0.25));
        }
      }
      image.at<std::uint8_t>(v, u) =
          cv::saturate_cast<std::uint8_t>(gray + scene.noise_gray * noise(engine));
    }
  }
  return image;
}

/// Two images of a scene; the camera drove `step_m` along the road, and turned.
struct RoadPair {
  RoadImage prev;
  RoadImage cur;
  Rigid3 cur_from_prev;  ///< metres
};

inline RoadPair render_pair(const RoadScene& scene, double step_m, double yaw_rad = 0.0) {
  const Eigen::Vector3d forward =
      Eigen::Vector3d(-0.5 * yaw_rad, scene.slope_rad, 1.0).normalized() * step_m;
  RoadPair pair;
  pair.cur_from_prev = {so3_exp({0.0, -yaw_rad, 0.0}), -forward};
  const Rigid3 prev_from_cur = pair.cur_from_prev.inverse();
  pair.prev = make_road_image({render_road(scene, prev_from_cur, 1), {}}, scene.camera);
  pair.cur = make_road_image({render_road(scene, Rigid3{}, 2), {}}, scene.camera);
  return pair;
}

/// The motion in units that are 1 / metres_per_unit long.
inline Rigid3 in_units(Rigid3 motion, double metres_per_unit) {
  motion.translation /= metres_per_unit;
  return motion;
}

/// Belief that the unit is that long, to 3 %; nothing about the road.
inline RoadPrior near(double metres_per_unit) {
  return {.log_scale = std::log(metres_per_unit), .log_scale_sigma = 0.03};
}

}  // namespace stemvo::testing
