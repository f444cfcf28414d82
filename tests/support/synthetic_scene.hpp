// SPDX-License-Identifier: MIT
#pragma once

#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"
#include "support/test.hpp"

namespace stemvo::testing {

/// The camera of KITTI 00-02.
inline Camera kitti_camera() { return {718.856, 718.856, 607.1928, 185.2157, 1241, 376}; }

struct SceneOptions {
  int num_points = 200;
  double noise_px = 0.0;       ///< standard deviation, per coordinate, in both images
  double outlier_ratio = 0.0;  ///< share of matches whose point in cur is anywhere
  bool planar = false;
  Camera camera = kitti_camera();
  std::uint64_t seed = 1;
  double min_depth = 4.0;  ///< in units of the motion's translation (length 1 if random)
  double max_depth = 20.0;
  double max_rotation_rad = 0.1;
  std::optional<Rigid3> cur_from_prev = std::nullopt;  ///< random where absent
};

/// Points in front of two cameras, with everything known. Matches are in pixels.
struct Scene {
  Camera camera = kitti_camera();
  Rigid3 cur_from_prev;
  std::vector<Eigen::Vector3d> points_in_prev;
  std::vector<Eigen::Vector2d> prev_uv;
  std::vector<Eigen::Vector2d> cur_uv;
  /// Planar scenes: normal . X = distance in the previous camera.
  Eigen::Vector3d plane_normal = Eigen::Vector3d::Zero();
  double plane_distance = 0.0;
};

class SceneRandom {
 public:
  explicit SceneRandom(std::uint64_t seed) : engine_(seed * 7919 + 17) {}

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double normal(double sigma) { return sigma * std::normal_distribution<double>()(engine_); }
  // One draw a statement: among the arguments of a call each compiler has its own order.
  Eigen::Vector2d noise(double sigma) {
    const double y = normal(sigma);
    return {normal(sigma), y};
  }
  Eigen::Vector3d direction() {
    Eigen::Vector3d v;
    do {
      v = {uniform(-1.0, 1.0), uniform(-1.0, 1.0), uniform(-1.0, 1.0)};
    } while (v.norm() > 1.0 || v.norm() < 0.1);
    return v.normalized();
  }
  Eigen::Vector2d pixel(const Camera& camera) {
    return {uniform(0.0, camera.width_px - 1.0), uniform(0.0, camera.height_px - 1.0)};
  }
  Rigid3 motion(double max_rotation_rad) {
    const Eigen::Vector3d axis = direction();
    const double angle_rad = uniform(0.0, max_rotation_rad);
    return {so3_exp(angle_rad * axis), direction()};
  }

 private:
  std::mt19937_64 engine_;
};

inline bool is_inside(const Camera& camera, const Eigen::Vector2d& uv) {
  return uv.x() >= 0.0 && uv.y() >= 0.0 && uv.x() <= camera.width_px - 1.0 &&
         uv.y() <= camera.height_px - 1.0;
}

/// Adds noise and outliers to a match that is exact.
inline void add_match(const SceneOptions& options,
                      const Eigen::Vector3d& point,
                      SceneRandom& random,
                      Scene& scene) {
  const auto noise = [&] { return random.noise(options.noise_px); };
  const bool outlier = random.uniform(0.0, 1.0) < options.outlier_ratio;
  const Eigen::Vector2d cur = scene.camera.project(scene.cur_from_prev * point);
  scene.points_in_prev.push_back(point);
  scene.prev_uv.push_back(scene.camera.project(point) + noise());
  scene.cur_uv.push_back(outlier ? random.pixel(scene.camera) : cur + noise());
}

/// Every point is in front of both cameras and inside both images. A motion under which nothing
/// is seen twice gives fewer points than asked for.
inline Scene make_scene(const SceneOptions& options) {
  SceneRandom random(options.seed);
  Scene scene;
  scene.camera = options.camera;
  scene.cur_from_prev = options.cur_from_prev.value_or(random.motion(options.max_rotation_rad));
  if (options.planar) {
    // Tilted by up to 45 degrees against the image plane.
    const Eigen::Vector3d tilt = random.direction();
    scene.plane_normal = (Eigen::Vector3d::UnitZ() + random.uniform(0.2, 0.9) * tilt).normalized();
    scene.plane_distance = random.uniform(options.min_depth, 0.5 * options.max_depth);
  }
  const int max_attempts = 100 * options.num_points;
  for (int i = 0; i < max_attempts; ++i) {
    if (static_cast<int>(scene.prev_uv.size()) == options.num_points) {
      break;
    }
    const Eigen::Vector3d ray = scene.camera.normalize(random.pixel(scene.camera)).homogeneous();
    const double depth = options.planar ? scene.plane_distance / scene.plane_normal.dot(ray)
                                        : random.uniform(options.min_depth, options.max_depth);
    const Eigen::Vector3d point = depth * ray;
    const Eigen::Vector3d in_cur = scene.cur_from_prev * point;
    if (depth > 0.5 && in_cur.z() > 0.5 && is_inside(scene.camera, scene.camera.project(in_cur))) {
      add_match(options, point, random, scene);
    }
  }
  return scene;
}

/// H = K (R + T n^T / d) K^-1, pixels, cur_from_prev. Planar scenes only.
inline Eigen::Matrix3d true_homography(const Scene& scene) {
  const Eigen::Matrix3d k = scene.camera.matrix();
  return k *
         (scene.cur_from_prev.rotation_matrix() +
          scene.cur_from_prev.translation * scene.plane_normal.transpose() / scene.plane_distance) *
         k.inverse();
}

}  // namespace stemvo::testing
