// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "stemvo/error.hpp"
#include "stemvo/odometry.hpp"

namespace stemvo {

/// Writes frames.csv row by row, so that a run that is killed keeps the rows it had. Columns:
/// frame, timestamp_s, state, matches, inliers, s_h, s_f, r_h, model, stem_ms, features_ms,
/// pose_ms, scale_sigma (of log(metres per unit); empty where no road is asked), road (-, none,
/// held, measured: RoadState), fx_px, cx_px, cy_px (what was learnt of the camera), cx_sigma_px,
/// cy_sigma_px (empty where it is not refined).
class FramesCsv {
 public:
  /// Replaces the file and writes the header. Error: it cannot be written.
  [[nodiscard]] static Expected<FramesCsv> create(const std::filesystem::path& file);

  /// Frame in the folder's numbering. A failed write is kept for `close`.
  void write(std::size_t frame, double timestamp_s, const FrameResult& result);
  /// Flushes. Error: any write since `create` failed (disk full). Write nothing afterwards.
  [[nodiscard]] Status close();

 private:
  FramesCsv() = default;
  void put(std::string_view text);
  void check();

  std::filesystem::path file_;
  std::ofstream stream_;
  Status written_;  ///< the first failed write
};

}  // namespace stemvo
