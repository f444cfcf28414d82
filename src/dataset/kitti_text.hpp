// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "text/text_file.hpp"

namespace stemvo::dataset {

/// Intrinsics of camera `index` (0..3) from its row `PN:` (odometry and object benchmarks) or
/// `P_rect_0N:` (raw data): 12 numbers, row-major 3x4. The size of the image is left at zero.
/// Errors: no such row; not 12 finite numbers; a focal length that is not positive; skew.
[[nodiscard]] Expected<Camera> read_kitti_camera(const std::filesystem::path& file, int index);

/// The text of a calib.txt with other intrinsics in every projection row whose intrinsics are
/// `given`: rectified cameras share them. The row's offset to the first camera in metres,
/// K^-1 p4, stays. Every other line is kept as it is. Error: the file cannot be read.
[[nodiscard]] Expected<std::string> replace_kitti_camera(const std::filesystem::path& file,
                                                         const Camera& given,
                                                         const Camera& refined);

/// One time per line, as read_timed_rows reads them, for at least `num_expected` images. Errors:
/// not one finite number in a line, not increasing, fewer lines.
[[nodiscard]] Expected<TimedRows<double>> read_kitti_times(const std::filesystem::path& file,
                                                           std::size_t num_expected);

}  // namespace stemvo::dataset
