// SPDX-License-Identifier: MIT
#include "odometry/answers.hpp"

#include <algorithm>
#include <span>
#include <utility>

namespace stemvo {

MapChanges landmarks_since(const ChannelOdometry& frames, int version) {
  const Estimator& estimator = frames.estimator();
  LandmarkChanges changes = estimator.landmarks_since(version);
  MapChanges placed{changes.version, {}, std::move(changes.removed)};
  for (const KeptLandmark& kept : changes.landmarks) {
    const Rigid3& world_from_camera = estimator.trajectory()[static_cast<std::size_t>(kept.frame)];
    placed.landmarks.push_back(
        {kept.id, world_from_camera * kept.in_camera.cast<double>(), kept.rgb});
  }
  return placed;
}

std::vector<MapKeyframe> keyframes_of(const ChannelOdometry& frames, int first) {
  const std::span<const int> all = frames.estimator().keyframes();
  std::vector<MapKeyframe> keyframes;
  for (auto id = static_cast<std::size_t>(std::max(first, 0)); id < all.size(); ++id) {
    const auto frame = static_cast<std::size_t>(all[id]);
    keyframes.push_back({static_cast<int>(id), all[id], frames.times_s()[frame],
                         frames.estimator().trajectory()[frame]});
  }
  return keyframes;
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
