// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "stemvo/error.hpp"

namespace stemvo {
namespace synth {
/// How frames of a drive or walk are rendered.
struct RenderOptions {
  double walk_rate_hz = 30.0;
  /// The world of `seed` (and `trajectory`, `num_frames`) at another time: on another path, in
  /// other light. 0: the first visit.
  int visit = 0;
  /// Cars, lorries and people that move. An own drive then stands at crossings.
  bool traffic = false;
  bool blank_walls = false;                              ///< of a walk
  std::optional<double> turn_rate_deg_s = std::nullopt;  ///< of a walk, at a turn's middle
  double exposure_s = 0.0;     ///< motion blur: a frame's pose is that of its exposure's middle
  double readout_s = 0.0;      ///< rolling shutter, first to last row: the pose is the middle row's
  bool small_chip = false;     ///< point spread, fill, noise, response of a small camera's chip
  bool follows_light = false;  ///< exposure settles in half a second; else it is constant
};
}  // namespace synth

/// A rendered street or courtyard in KITTI layout with exact poses.
struct SyntheticDriveOptions {
  /// KITTI poses to drive along; else own curve.
  std::optional<std::filesystem::path> trajectory = std::nullopt;
  /// A hand-held camera through a courtyard, in place of a car along a street.
  bool walk = false;
  int num_frames = 100;  ///< with a trajectory: at most its length
  std::uint64_t seed = 1;
  synth::RenderOptions render = {};
  std::optional<int> width_px = std::nullopt;   ///< nullopt: 1241, with a walk 640
  std::optional<int> height_px = std::nullopt;  ///< nullopt: 376, with a walk 480
  std::string name = "00";                      ///< names the sequence's folder and the pose file
  bool write_depth = false;  ///< also depth/%06d.npy (float32 metres along z), to learn from
};

/// Called after each batch of frames: frames done, frames in all; false stops (an interrupt).
using RenderProgress = std::function<bool(std::size_t, std::size_t)>;

/// Writes OUT/sequences/NAME/{image_2,calib.txt,times.txt} and OUT/poses/NAME.txt, in place of an
/// earlier drive; with traffic also moving/%06d.png: 255 where a thing moves, or its shadow.
/// Stopped, the frames that were done are the drive. The same options give the same bytes, whatever
/// the number of threads. Error: a sequence of that name is there that was not rendered.
[[nodiscard]] Status render_synthetic_drive(const std::filesystem::path& out_dir,
                                            const SyntheticDriveOptions& options,
                                            const RenderProgress& progress = {});

}  // namespace stemvo
