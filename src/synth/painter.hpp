// SPDX-License-Identifier: MIT
#pragma once

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"
#include "synth/ripmap.hpp"
#include "synth/scene.hpp"

namespace stemvo::synth {

struct PaintedFrame {
  cv::Mat light;    ///< CV_32FC3, RGB, 1 = white
  cv::Mat depth_m;  ///< CV_32FC1: z in the camera's frame, infinite in the sky
};

/// What a perfect camera sees.
[[nodiscard]] PaintedFrame paint_scene(const Scene& scene,
                                       const Rigid3& world_from_camera,
                                       const Camera& camera,
                                       const Textures& textures);

}  // namespace stemvo::synth
