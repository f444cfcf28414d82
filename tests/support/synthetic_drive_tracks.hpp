// SPDX-License-Identifier: MIT
#pragma once

#include "features/front_end.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"
#include "support/synthetic_scene.hpp"
#include "support/test.hpp"

namespace stemvo::testing {

/// A camera's path past points, in metres, with perfect tracks plus noise.
class DriveTracks {
 public:
  /// A car's drive along a bend, past points on both sides.
  DriveTracks(int num_frames, double noise_px, std::uint64_t seed, double step_m = 1.0)
      : random_(seed), noise_px_(noise_px) {
    const Rigid3 motion(so3_exp({0.0, 0.01, 0.002}), {0.02, 0.0, step_m});
    world_from_camera = repeat(motion, num_frames);
    for (int i = 0; i < 1500; ++i) {
      const double side = random_.uniform(-1.0, 1.0);
      const double z = random_.uniform(5.0, 60.0);
      points.emplace_back(side * 12.0, random_.uniform(-4.0, 2.0), z);
    }
    observe_all();
  }

  /// Along these poses, past these points.
  DriveTracks(std::vector<Rigid3> path,
              std::vector<Eigen::Vector3d> seen_points,
              double noise_px,
              std::uint64_t seed,
              const Camera& seen_by = kitti_camera())
      : camera(seen_by),
        world_from_camera(std::move(path)),
        points(std::move(seen_points)),
        random_(seed),
        noise_px_(noise_px) {
    observe_all();
  }

  /// A path of equal motions (prev_from_cur).
  [[nodiscard]] static std::vector<Rigid3> repeat(const Rigid3& motion, int num_frames) {
    return go_on(std::vector<Rigid3>(1), motion, num_frames - 1);
  }
  /// The path, and so many motions more.
  [[nodiscard]] static std::vector<Rigid3> go_on(std::vector<Rigid3> path,
                                                 const Rigid3& motion,
                                                 int count) {
    for (int i = 0; i < count; ++i) {
      path.push_back(path.back() * motion);
    }
    return path;
  }

  /// From this frame on every `one_in`-th track has another id (that of its point, plus the number
  /// of points): its corner was lost and is new.
  void renew_tracks(int frame, int remainder, int one_in = 2) {
    for (int i = frame; i < num_frames(); ++i) {
      auto& seen = observations[static_cast<std::size_t>(i)];
      const auto before = seen;
      for (const auto& [id, uv] : before) {
        if (id % one_in == remainder && id < static_cast<int>(points.size())) {
          seen.erase(id);
          seen.emplace(id + static_cast<int>(points.size()), uv);
        }
      }
    }
  }

  [[nodiscard]] int num_frames() const { return static_cast<int>(world_from_camera.size()); }
  [[nodiscard]] const Rigid3& pose(int i) const {
    return world_from_camera[static_cast<std::size_t>(i)];
  }

  /// Matches of frame i - 1 to frame i under the points' numbers.
  [[nodiscard]] Matches matches(int i) const { return matches(i - 1, i); }
  /// The same under numbers that nobody has seen.
  [[nodiscard]] Matches other_matches(int i) const {
    Matches result = matches(i);
    for (int& id : result.track_ids) {
      id += 100000;
    }
    return result;
  }
  [[nodiscard]] Matches matches(int prev, int cur) const {
    Matches result;
    result.prev_frame = prev;
    for (const auto& [id, uv] : observations[static_cast<std::size_t>(cur)]) {
      const auto& before = observations[static_cast<std::size_t>(prev)];
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
  void observe_all() {
    for (int i = 0; i < num_frames(); ++i) {
      observations.push_back(observe(i));
    }
  }

  std::map<int, Eigen::Vector2d> observe(int frame) {
    std::map<int, Eigen::Vector2d> seen;
    const Rigid3 camera_from_world = pose(frame).inverse();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d x = camera_from_world * points[i];
      if (x.z() < 0.4) {
        continue;
      }
      const Eigen::Vector2d uv = camera.project(x);
      if (is_inside(camera, uv)) {
        const Eigen::Vector2d noise = random_.noise(noise_px_);
        seen.emplace(static_cast<int>(i), uv + noise);
      }
    }
    return seen;
  }

  SceneRandom random_;
  double noise_px_;
};

/// Points on both sides of a path and ahead of it, as a street has them.
inline std::vector<Eigen::Vector3d> points_along(const std::vector<Rigid3>& path,
                                                 int num_points,
                                                 std::uint64_t seed) {
  SceneRandom random(seed);
  std::vector<Eigen::Vector3d> points;
  while (static_cast<int>(points.size()) < num_points) {
    const auto at =
        static_cast<std::size_t>(random.uniform(0.0, static_cast<double>(path.size()) - 1e-6));
    const double side = random.uniform(0.0, 1.0) < 0.5 ? -1.0 : 1.0;
    const double z = random.uniform(5.0, 60.0);
    const double y = random.uniform(-4.0, 1.6);
    const Eigen::Vector3d in_camera(side * random.uniform(3.0, 14.0), y, z);
    points.push_back(path[at] * in_camera);
  }
  return points;
}

/// Points of a room around the origin: on its walls and on things before them.
inline std::vector<Eigen::Vector3d> points_of_room(int num_points,
                                                   double radius_m,
                                                   std::uint64_t seed) {
  SceneRandom random(seed);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < num_points; ++i) {
    const double bearing = random.uniform(-3.14159, 3.14159);
    const double distance = radius_m * random.uniform(0.5, 1.0);
    points.emplace_back(distance * std::sin(bearing), random.uniform(-1.5, 1.5),
                        distance * std::cos(bearing));
  }
  return points;
}

}  // namespace stemvo::testing
