// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "stemvo/odometry.hpp"

namespace stemvo {

/// The header of frames.csv, with its newline. Columns: frame, timestamp_s, state, matches,
/// inliers, s_h, s_f, r_h, model, stem_ms, features_ms, pose_ms, scale_sigma (of log(metres per
/// unit); empty where no road is asked), scale_state (-, none, held, measured: ScaleState), fx_px,
/// cx_px, cy_px (what was learnt of the camera), fx_sigma_px, cx_sigma_px, cy_sigma_px (empty where
/// it is not refined), recognized_frame (whose place the frame shows; empty: none was recognized;
/// from -2 down: of the map that was loaded), map_scale, map_x, map_y, map_z, map_qx, map_qy,
/// map_qz, map_qw (FrameResult::map_from_world).
[[nodiscard]] std::string_view frames_csv_header();
/// A row with its newline; the frame in the folder's numbering.
[[nodiscard]] std::string frames_csv_row(std::size_t frame,
                                         double timestamp_s,
                                         const FrameResult& result);

}  // namespace stemvo
