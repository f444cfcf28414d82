// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <variant>

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "synth/drive.hpp"
#include "synth/ripmap.hpp"
#include "synth/scene.hpp"
#include "synth/walk.hpp"

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

struct RenderedFrame {
  cv::Mat rgb;      ///< CV_8UC3
  cv::Mat depth_m;  ///< CV_32FC1: z in the camera's frame, infinite in the sky
};

/// Draws frames of a drive or of a walk. One frame needs nothing of the others, so any number of
/// threads may call render() at once.
class Renderer {
 public:
  Renderer(std::variant<Drive, Walk> path, const Camera& camera, std::uint64_t seed);

  [[nodiscard]] const Trajectory& world_from_camera() const;
  [[nodiscard]] RenderedFrame render(std::size_t index) const;

 private:
  [[nodiscard]] Scene scene_at(std::size_t index) const;

  std::variant<Drive, Walk> path_;
  Camera camera_;
  std::uint64_t seed_;
  Textures textures_;
  Vec3 to_sun_;
};

}  // namespace stemvo::synth
