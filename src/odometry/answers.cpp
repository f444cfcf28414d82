// SPDX-License-Identifier: MIT
#include "odometry/answers.hpp"

namespace stemvo {

std::vector<MapLandmark> landmarks_of(const ChannelOdometry& frames) {
  const Estimator& estimator = frames.estimator();
  std::vector<MapLandmark> landmarks;
  for (const KeptLandmark& kept : estimator.landmarks()) {
    const Rigid3& world_from_camera = estimator.trajectory()[static_cast<std::size_t>(kept.frame)];
    landmarks.push_back({world_from_camera * kept.in_camera.cast<double>(), kept.rgb});
  }
  return landmarks;
}

std::vector<TrackedPoint> tracked_points_of(const ChannelOdometry& frames) {
  const Matches& matches = frames.matches();
  const std::vector<char>& is_inlier = frames.inlier_mask();
  std::vector<TrackedPoint> points;
  for (std::size_t i = 0; i < matches.track_ids.size(); ++i) {
    points.push_back({matches.track_ids[i], matches.prev_uv[i], matches.cur_uv[i],
                      i < is_inlier.size() && is_inlier[i] != 0});
  }
  return points;
}

}  // namespace stemvo
