// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <variant>

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "synth/drive.hpp"
#include "synth/materials.hpp"
#include "synth/visit.hpp"

namespace stemvo::synth {

using CameraPath = std::variant<Drive, Walk>;

struct RenderedFrame {
  cv::Mat rgb;      ///< CV_8UC3
  cv::Mat depth_m;  ///< CV_32FC1: z in the camera's frame, infinite in the sky
};

/// Draws frames of a drive or of a walk. One frame needs nothing of the others, so any number of
/// threads may call render() at once.
class Renderer {
 public:
  /// `seed` makes the world; `visit` chooses its light and the noise, 0 is the first one.
  Renderer(CameraPath path, const Camera& camera, std::uint64_t seed, int visit = 0);

  [[nodiscard]] const Trajectory& world_from_camera() const;
  [[nodiscard]] RenderedFrame render(std::size_t index) const;

 private:
  CameraPath path_;
  Camera camera_;
  std::uint64_t seed_;
  std::uint64_t noise_seed_;
  Textures textures_;
  Daylight daylight_;
};

}  // namespace stemvo::synth
