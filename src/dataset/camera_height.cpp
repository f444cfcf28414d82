// SPDX-License-Identifier: MIT
#include "dataset/camera_height.hpp"

namespace stemvo::dataset {

Config with_camera_height(Config config, const FrameSource& frames) {
  constexpr const char* kHeight = "scale.camera_height_m";
  // A file that names both keys is a dump of all, whose height is the default.
  const bool is_given =
      config.keys_overridden.contains(kHeight) ||
      (config.keys_in_file.contains(kHeight) && !config.keys_in_file.contains("scale.source"));
  if (config.scale_choice == ScaleChoice::kAuto && config.scale.source == ScaleSource::kNone &&
      (frames.is_kitti || frames.camera_height_m || is_given)) {
    config.scale.source = ScaleSource::kCameraHeight;
  }
  if (config.scale_choice == ScaleChoice::kAuto) {
    config.scale_choice = ScaleChoice::kOptions;
  }
  // A file's height is some camera's, often the default; that of the camera file is this one's.
  if (frames.camera_height_m && !config.keys_overridden.contains(kHeight)) {
    config.scale.camera_height_m = *frames.camera_height_m;
  }
  return config;
}

}  // namespace stemvo::dataset
