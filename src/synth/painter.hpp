// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"
#include "synth/materials.hpp"
#include "synth/scene.hpp"

namespace stemvo::synth {

struct RenderedFrame {
  cv::Mat rgb;      ///< CV_8UC3
  cv::Mat depth_m;  ///< CV_32FC1: z in the camera's frame, infinite in the sky
  cv::Mat moving;   ///< CV_8UC1: 255 where a thing moves on its own, or its shadow
};

/// A perfect camera sees this at one moment on the rows [rows.start, rows.end): frames of so many
/// rows; `rgb` is CV_32FC3, where 1 is white. `scene_from_camera`: in the axes of the faces'
/// points.
[[nodiscard]] RenderedFrame paint(std::span<const Face* const> faces,
                                  const Rigid3& scene_from_camera,
                                  const Camera& camera,
                                  const Textures& textures,
                                  cv::Range rows,
                                  double fill = 1.0);

}  // namespace stemvo::synth
