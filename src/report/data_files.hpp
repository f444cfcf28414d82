// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "stemvo/error.hpp"
#include "stemvo/odometry.hpp"

namespace stemvo {

/// With its newline: docs/results.md says what each column holds.
inline constexpr std::string_view kFramesCsvHeader =
    "frame,timestamp_s,state,matches,inliers,s_h,s_f,r_h,model,stem_ms,features_ms,pose_ms,"
    "scale_sigma,scale_state,fx_px,cx_px,cy_px,fx_sigma_px,cx_sigma_px,cy_sigma_px,"
    "recognized_frame,map_scale,map_x,map_y,map_z,map_qx,map_qy,map_qz,map_qw,"
    "map_id,is_scale_new,x,y,z,qx,qy,qz,qw,"
    "step_var_x,step_var_y,step_var_z,step_var_rx,step_var_ry,step_var_rz,error_m,error_deg\n";
/// A row with its newline; the frame in the folder's numbering, the pose as result files hold it.
/// The columns of its error are empty.
[[nodiscard]] std::string frames_csv_row(std::size_t frame,
                                         double timestamp_s,
                                         const FrameResult& result,
                                         const Rigid3& written);

struct FrameError {
  std::size_t row = 0;  ///< counted from 0
  double position_m = 0.0;
  double rotation_deg = 0.0;
};
/// The table with errors of some rows, in their order.
[[nodiscard]] std::string frames_csv_with_errors(std::string_view table,
                                                 std::span<const FrameError> errors);

struct ColoredPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  std::array<std::uint8_t, 3> rgb{};
};

inline constexpr std::array<std::uint8_t, 3> kMapPathColor{255, 64, 0};

/// A map as binary PLY: `vertex` with the points that are finite, then the camera positions, and
/// `edge` from each camera position to the next. Error: it cannot be written.
[[nodiscard]] Status write_map_ply(const std::filesystem::path& file,
                                   std::span<const ColoredPoint> points,
                                   std::span<const Rigid3> world_from_camera);

}  // namespace stemvo
