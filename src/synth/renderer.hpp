// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <variant>

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "synth/drive.hpp"
#include "synth/materials.hpp"
#include "synth/walk.hpp"

namespace stemvo::synth {

struct RenderedFrame {
  cv::Mat rgb;      ///< CV_8UC3; from paint_scene() CV_32FC3, where 1 is white
  cv::Mat depth_m;  ///< CV_32FC1: z in the camera's frame, infinite in the sky
};

/// A perfect camera sees this.
[[nodiscard]] RenderedFrame paint_scene(const Scene& scene,
                                        const Rigid3& world_from_camera,
                                        const Camera& camera,
                                        const Textures& textures);

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
