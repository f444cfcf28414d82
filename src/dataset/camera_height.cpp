// SPDX-License-Identifier: MIT
#include "dataset/camera_height.hpp"

namespace stemvo::dataset {

Config with_camera_height(Config config, const FrameList& frames) {
  constexpr const char* kSource = "scale.source";
  const bool is_chosen = config.scale.source != ScaleSource::kCameraHeight ||
                         config.keys_in_file.contains(kSource) ||
                         config.keys_overridden.contains(kSource);
  if (!frames.is_kitti && !frames.camera_height_m && !is_chosen) {
    config.scale.source = ScaleSource::kNone;
  }
  // A file's height is some camera's, often the default; that of the camera file is this one's.
  if (frames.camera_height_m && !config.keys_overridden.contains("scale.camera_height_m")) {
    config.scale.camera_height_m = *frames.camera_height_m;
  }
  return config;
}

}  // namespace stemvo::dataset
