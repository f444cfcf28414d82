// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <memory>
#include <variant>
#include <vector>

#include "synth/drive.hpp"
#include "synth/painter.hpp"
#include "synth/traffic.hpp"
#include "synth/visit.hpp"

namespace stemvo::synth {

using CameraPath = std::variant<Drive, Walk>;

struct RenderOptions {
  int visit = 0;         ///< chooses light and noise; 0 is the first one
  bool traffic = false;  ///< on the street of a drive
  double rate_hz = kDriveRate_hz;
  /// The pose of a frame is that of its middle row in the middle of its exposure.
  double exposure_s = 0.0;  ///< 0: no motion blur
  double readout_s = 0.0;   ///< from the first row to the last; 0: all rows at once
  bool small_chip =
      false;  ///< a small camera's chip (sensor.hpp) in place of an almost perfect one
  bool follows_light = false;  ///< exposure settles in half a second; else it is constant
};

/// Draws frames of a drive or of a walk. One frame needs nothing of the others, so any number of
/// threads may call render() at once.
class Renderer {
 public:
  /// `seed` makes the world.
  Renderer(CameraPath path,
           const Camera& camera,
           std::uint64_t seed,
           const RenderOptions& options = {});

  [[nodiscard]] const Trajectory& world_from_camera() const;
  [[nodiscard]] RenderedFrame render(std::size_t index) const;

 private:
  /// The scene that stands still around a frame.
  [[nodiscard]] Scene still_scene(std::size_t index) const;
  /// Light on the chip, before the sensor.
  [[nodiscard]] RenderedFrame light_of(std::size_t index) const;
  [[nodiscard]] RenderedFrame light_over_time(std::size_t index, const Scene& still) const;
  void follow_light();

  CameraPath path_;
  Camera camera_;
  std::uint64_t seed_;
  RenderOptions options_;
  std::uint64_t noise_seed_;
  Textures textures_;
  Daylight daylight_;
  std::unique_ptr<Traffic> traffic_;  ///< none: nothing moves
  std::vector<float> gains_;          ///< per frame
};

}  // namespace stemvo::synth
