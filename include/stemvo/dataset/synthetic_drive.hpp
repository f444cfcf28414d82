// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "stemvo/error.hpp"

namespace stemvo {

/// A rendered street in KITTI layout with exact poses.
struct SyntheticDriveOptions {
  /// KITTI poses to drive along; else own curve.
  std::optional<std::filesystem::path> trajectory = std::nullopt;
  int num_frames = 100;  ///< with a trajectory: at most its length
  std::uint64_t seed = 1;
  int width_px = 1241;
  int height_px = 376;
  std::string name = "00";   ///< of the sequence's folder and the pose file
  bool write_depth = false;  ///< also depth/%06d.npy (float32 metres along z), for learn_stem.py
};

/// Called after each frame: frames done, frames in all; false stops (an interrupt).
using RenderProgress = std::function<bool(int, int)>;

/// Writes OUT/sequences/NAME/{image_2,calib.txt,times.txt} and OUT/poses/NAME.txt. The same options
/// give the same bytes, whatever the number of threads.
[[nodiscard]] Status render_synthetic_drive(const std::filesystem::path& out_dir,
                                            const SyntheticDriveOptions& options,
                                            const RenderProgress& progress = {});

}  // namespace stemvo
