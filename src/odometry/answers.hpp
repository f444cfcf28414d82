// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "odometry/channel_odometry.hpp"
#include "stemvo/frame_result.hpp"

namespace stemvo {

// The answers of Odometry and AsyncOdometry, out of what the frames left.

[[nodiscard]] MapChanges landmarks_since(const ChannelOdometry& frames, int version);
[[nodiscard]] std::vector<MapKeyframe> keyframes_of(const ChannelOdometry& frames, int first);
[[nodiscard]] std::vector<TrackedPoint> tracked_points_of(const ChannelOdometry& frames);

}  // namespace stemvo
