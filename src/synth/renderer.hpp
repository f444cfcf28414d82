// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include <opencv2/core.hpp>

#include "stemvo/camera.hpp"
#include "stemvo/rigid3.hpp"
#include "synth/drive.hpp"
#include "synth/materials.hpp"
#include "synth/scene.hpp"
#include "synth/traffic.hpp"

namespace stemvo::synth {

struct RenderedFrame {
  cv::Mat rgb;      ///< CV_8UC3
  cv::Mat depth_m;  ///< CV_32FC1: z in the camera's frame, infinite in the sky
  cv::Mat moving;   ///< CV_8UC1: 255 where a thing moves on its own, or its shadow
};

/// A perfect camera sees this at one moment on the rows [rows.start, rows.end): frames of so many
/// rows; `rgb` is CV_32FC3, where 1 is white.
[[nodiscard]] RenderedFrame paint(const Scene& scene,
                                  const Rigid3& world_from_camera,
                                  const Camera& camera,
                                  const Textures& textures,
                                  cv::Range rows,
                                  double fill = 1.0);
using CameraPath = std::variant<Drive, Walk>;

/// Draws frames of a drive or of a walk. One frame needs nothing of the others, so any number of
/// threads may call render() at once.
class Renderer {
 public:
  /// `seed` makes the world.
  Renderer(CameraPath path,
           const Camera& camera,
           std::uint64_t seed,
           const RenderOptions& options = {});

  [[nodiscard]] const Trajectory& world_from_camera() const {
    const auto of = [](const auto& path) -> const auto& { return path.world_from_camera; };
    return std::visit(of, path_);
  }
  [[nodiscard]] double rate_hz() const {
    return std::holds_alternative<Walk>(path_) ? options_.walk_rate_hz : kDriveRate_hz;
  }
  [[nodiscard]] RenderedFrame render(std::size_t index) const;

 private:
  [[nodiscard]] Scene still_scene(std::size_t index) const;
  void follow_light();

  CameraPath path_;
  Camera camera_;
  std::uint64_t seed_;
  RenderOptions options_;
  Textures textures_;
  Vec3 to_sun_;
  double ambient_;
  Traffic traffic_;           ///< empty: nothing moves
  std::vector<float> gains_;  ///< per frame
};

}  // namespace stemvo::synth
