// SPDX-License-Identifier: MIT
#pragma once

#include "config/config.hpp"
#include "dataset/frame_source.hpp"

namespace stemvo::dataset {

/// The configuration for these frames. A camera file's camera_height sets scale.camera_height_m
/// where --set did not; without one scale.source becomes none where neither --set nor a
/// configuration file named it: another camera is not on KITTI's car.
[[nodiscard]] Config with_camera_height(Config config, const FrameList& frames);

}  // namespace stemvo::dataset
