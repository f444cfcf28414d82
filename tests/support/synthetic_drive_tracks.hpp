// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <map>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "odometry/local_map.hpp"
#include "stemvo/features/front_end.hpp"
#include "stemvo/geometry/camera.hpp"
#include "stemvo/geometry/rigid3.hpp"
#include "support/synthetic_scene.hpp"

namespace stemvo::testing {

/// A drive past points on both sides, in metres, with perfect tracks plus noise.
class DriveTracks {
 public:
  DriveTracks(int num_frames, double noise_px, std::uint64_t seed, double step_m = 1.0)
      : random_(seed), noise_px_(noise_px) {
    Rigid3 pose;
    for (int i = 0; i < num_frames; ++i) {
      world_from_camera.push_back(pose);
      pose = pose * Rigid3(so3_exp({0.0, 0.01, 0.002}), {0.02, 0.0, step_m});
    }
    for (int i = 0; i < 1500; ++i) {
      const double side = random_.uniform(-1.0, 1.0);
      points.emplace_back(side * 12.0, random_.uniform(-4.0, 2.0), random_.uniform(5.0, 60.0));
    }
    for (int i = 0; i < num_frames; ++i) {
      observations.push_back(observe(i));
    }
  }

  /// Matches of frame i - 1 to frame i under the points' numbers.
  [[nodiscard]] Matches matches(int i) const {
    Matches result;
    for (const auto& [id, uv] : observations[static_cast<std::size_t>(i)]) {
      const auto& before = observations[static_cast<std::size_t>(i - 1)];
      if (const auto found = before.find(id); found != before.end()) {
        result.prev_uv.push_back(found->second);
        result.cur_uv.push_back(uv);
        result.track_ids.push_back(id);
      }
    }
    return result;
  }

  Camera camera = kitti_camera();
  std::vector<Rigid3> world_from_camera;
  std::vector<Eigen::Vector3d> points;
  std::vector<std::map<int, Eigen::Vector2d>> observations;  ///< per frame: point -> pixel

 private:
  std::map<int, Eigen::Vector2d> observe(int frame) {
    std::map<int, Eigen::Vector2d> seen;
    const Rigid3 camera_from_world = world_from_camera[static_cast<std::size_t>(frame)].inverse();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d x = camera_from_world * points[i];
      const Eigen::Vector2d uv = camera.project(x);
      if (x.z() > 2.0 && is_inside(camera, uv)) {
        const Eigen::Vector2d noise(random_.normal(noise_px_), random_.normal(noise_px_));
        seen.emplace(static_cast<int>(i), uv + noise);
      }
    }
    return seen;
  }

  SceneRandom random_;
  double noise_px_;
};

}  // namespace stemvo::testing
