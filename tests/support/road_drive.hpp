// SPDX-License-Identifier: MIT
#pragma once

#include "config/config.hpp"
#include "odometry/road/image.hpp"
#include "support/estimator_run.hpp"
#include "support/road_scene.hpp"
#include "support/test.hpp"

namespace stemvo::testing {

/// Straight ahead along a road whose images are rendered, past points on both sides whose tracks
/// are exact.
struct RoadDrive {
  static constexpr double kStep_m = 0.8;

  const RoadScene scene{};
  DriveTracks tracks;

  explicit RoadDrive(int num_frames) : tracks(make_tracks(num_frames)) {}

  /// Rendered once for all drives: they differ in their length alone.
  [[nodiscard]] std::shared_ptr<const RoadImage> road_image(int frame, bool has_road) const {
    static std::map<std::pair<int, bool>, std::shared_ptr<const RoadImage>> rendered;
    std::shared_ptr<const RoadImage>& image = rendered[{frame, has_road}];
    if (image == nullptr) {
      RoadScene shown = scene;
      shown.noise_gray = 1.0;
      shown.has_road = has_road;
      const cv::Mat pixels =
          render_road(shown, tracks.pose(frame).inverse(), static_cast<std::uint64_t>(frame));
      image = std::make_shared<RoadImage>(make_road_image({pixels, {}}, scene.camera));
    }
    return image;
  }

 private:
  static DriveTracks make_tracks(int num_frames) {
    SceneRandom random(11);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 800; ++i) {
      const double z = random.uniform(6.0, 60.0);
      const double y = random.uniform(-4.0, 0.5);
      points.emplace_back(random.uniform(-12.0, 12.0), y, z);
    }
    const Rigid3 step(Eigen::Quaterniond::Identity(), {0.0, 0.0, kStep_m});
    return {DriveTracks::repeat(step, num_frames), points, 0.0, 11, RoadScene().camera};
  }
};

inline Options metric_config(OdometryMode mode = OdometryMode::kMap) {
  Options config;
  config.odometry.mode = mode;
  config.scale.source = ScaleSource::kCameraHeight;
  return config;
}

}  // namespace stemvo::testing
