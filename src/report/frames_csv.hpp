// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "stemvo/odometry.hpp"

namespace stemvo {

/// The header of frames.csv, with its newline: docs/results.md says what each column holds.
[[nodiscard]] std::string_view frames_csv_header();
/// A row with its newline; the frame in the folder's numbering, the pose as result files hold it.
/// The columns of its error are empty.
[[nodiscard]] std::string frames_csv_row(std::size_t frame,
                                         double timestamp_s,
                                         const FrameResult& result,
                                         const Rigid3& written);

/// A frame's error that the alignment of all leaves.
struct FrameError {
  std::size_t row = 0;  ///< counted from 0
  double position_m = 0.0;
  double rotation_deg = 0.0;
};
/// The table with errors of some rows, in their order.
[[nodiscard]] std::string frames_csv_with_errors(std::string_view table,
                                                 std::span<const FrameError> errors);

}  // namespace stemvo
