// SPDX-License-Identifier: MIT
#pragma once

#include "config/config.hpp"
#include "dataset/frame_source.hpp"

namespace stemvo::dataset {

/// The configuration for these frames. A camera file's camera_height sets scale.camera_height_m
/// where --set did not. Where nobody named scale.source it becomes camera_height on a KITTI folder,
/// with a camera file's height, and with one that was given without a source; else none.
[[nodiscard]] Config with_camera_height(Config config, const FrameSource& frames);

}  // namespace stemvo::dataset
