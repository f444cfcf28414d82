// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <vector>

#include "stemvo/error.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo::dataset {

/// Intrinsics of camera `index` (0..3) from its row `PN:` (odometry and object benchmarks) or
/// `P_rect_0N:` (raw data): 12 numbers, row-major 3x4. The size of the picture is left at zero.
/// Errors: no such row; not 12 finite numbers; a focal length that is not positive; skew.
[[nodiscard]] Expected<Camera> read_kitti_camera(const std::filesystem::path& file, int index);

/// One time in seconds per line. Errors: not one finite number in a line, not increasing, fewer
/// lines than `num_expected`.
[[nodiscard]] Expected<std::vector<double>> read_kitti_times(const std::filesystem::path& file,
                                                             std::size_t num_expected);

}  // namespace stemvo::dataset
