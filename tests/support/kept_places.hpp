// SPDX-License-Identifier: MIT
#pragma once

#include "mapping/kept_map.hpp"
#include "support/synthetic_drive_tracks.hpp"
#include "support/test.hpp"

namespace stemvo::testing {

/// Points that look like nothing else, and keyframes that see them.
class DescribedPoints {
 public:
  explicit DescribedPoints(std::vector<Eigen::Vector3d> points, unsigned seed = 1)
      : points_(std::move(points)), random_(seed) {
    for (std::size_t i = 0; i < points_.size(); ++i) {
      descriptors_.push_back(draw());
    }
  }

  [[nodiscard]] Descriptor draw() {
    Descriptor descriptor;
    for (std::uint64_t& word : descriptor) {
      word = random_();
    }
    return descriptor;
  }
  /// Every bit is another one with this probability.
  [[nodiscard]] Descriptor changed(Descriptor descriptor, double probability) {
    std::bernoulli_distribution is_changed(probability);
    for (std::uint64_t& word : descriptor) {
      for (int bit = 0; bit < 64; ++bit) {
        word ^= static_cast<std::uint64_t>(is_changed(random_)) << bit;
      }
    }
    return descriptor;
  }

  /// The view a camera has of the nearer points: each second one, corners off by `noise_px`,
  /// lengths in a unit of its own, `units` of it a metre; track ids from `first_track` on.
  [[nodiscard]] KeptKeyframe see(const Rigid3& world_from_camera,
                                 double units,
                                 int first_track,
                                 double noise_px = 0.5) {
    std::normal_distribution<double> noise(0.0, noise_px);
    KeptKeyframe keyframe;
    keyframe.camera = kitti_camera();
    keyframe.world_from_camera = world_from_camera;
    keyframe.world_from_camera.translation *= units;
    const Rigid3 camera_from_world = world_from_camera.inverse();
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d x = camera_from_world * points_[i];
      if (x.z() < 3.0 || x.z() > 40.0 || !is_inside(keyframe.camera, keyframe.camera.project(x))) {
        continue;
      }
      KeptCorner& corner = keyframe.corners.emplace_back();
      corner.track_id = first_track + static_cast<int>(i);
      corner.uv = keyframe.camera.project(x).cast<float>();
      corner.uv.x() += static_cast<float>(noise(random_));
      corner.uv.y() += static_cast<float>(noise(random_));
      corner.in_camera = (units * x).cast<float>();
      keyframe.descriptors.push_back(changed(descriptors_[i], 0.1));
    }
    return keyframe;
  }

 private:
  std::vector<Eigen::Vector3d> points_;
  std::mt19937_64 random_;
  std::vector<Descriptor> descriptors_;
};

}  // namespace stemvo::testing
