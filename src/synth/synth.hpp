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

/// A rendered street or courtyard in KITTI layout with exact poses.
struct SyntheticDriveOptions {
  /// KITTI poses to drive along; else own curve.
  std::optional<std::filesystem::path> trajectory = std::nullopt;
  /// A hand-held camera through a courtyard, in place of a car along a street.
  bool walk = false;
  int num_frames = 100;  ///< with a trajectory: at most its length
  /// Frames per second; nullopt: 10, of a walk 30.
  std::optional<double> rate_hz = std::nullopt;
  /// In the mean over the drive, in m/s; nullopt: 8 to 12, of a walk 0.5. Not with a trajectory.
  std::optional<double> speed_m_s = std::nullopt;
  std::uint64_t seed = 1;
  std::optional<int> width_px = std::nullopt;   ///< nullopt: 1241, of a walk 640
  std::optional<int> height_px = std::nullopt;  ///< nullopt: 376, of a walk 480
  std::string name = "00";                      ///< of the sequence's folder and the pose file
  bool write_depth = false;  ///< also depth/%06d.npy (float32 metres along z), for learn_stem.py
};

/// Called after each batch of frames: frames done, frames in all; false stops (an interrupt).
using RenderProgress = std::function<bool(std::size_t, std::size_t)>;

/// Error: values that exclude each other, or are out of range.
[[nodiscard]] Status check_options(const SyntheticDriveOptions& options);

/// Writes OUT/sequences/NAME/{image_2,calib.txt,times.txt} and OUT/poses/NAME.txt; of a walk also
/// camera.yaml beside calib.txt. They take the place of an earlier drive when they are whole.
/// Stopped, an earlier drive stays; where there was none, the frames that were done are one. The
/// same options give the same bytes, whatever the number of threads. Error: a sequence of that name
/// is there that was not rendered.
[[nodiscard]] Status render_synthetic_drive(const std::filesystem::path& out_dir,
                                            const SyntheticDriveOptions& options,
                                            const RenderProgress& progress = {});

}  // namespace stemvo
