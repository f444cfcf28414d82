// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "odometry/channel_odometry.hpp"
#include "stemvo/frame_result.hpp"

namespace stemvo {

// The answers of Odometry and AsyncOdometry, out of what the frames left.

[[nodiscard]] std::vector<MapLandmark> landmarks_of(const ChannelOdometry& frames);
[[nodiscard]] std::vector<TrackedPoint> tracked_points_of(const ChannelOdometry& frames);

}  // namespace stemvo
