// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>

#include "stemvo/error.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo::calibration {

/// The text of a calib.txt with the refined intrinsics in every projection row (`PN:` or
/// `P_rect_0N:`) whose intrinsics are `given`: rectified cameras share them. The row's offset to
/// the first camera in metres, K^-1 p4, stays. Every other line is kept as it is. Error: the file
/// cannot be read.
[[nodiscard]] Expected<std::string> rewrite_calibration(const std::filesystem::path& file,
                                                        const Camera& given,
                                                        const Camera& refined);

/// Proves that the file can be written, without touching it. Error: it is a folder, or a file
/// beside it cannot be made.
[[nodiscard]] Status check_can_write(const std::filesystem::path& file);
/// Replaces the file at once: whoever reads it finds the old or the new one. Error: as above, or
/// the disk took less than all of it.
[[nodiscard]] Status replace_file(const std::filesystem::path& file, const std::string& text);

}  // namespace stemvo::calibration
