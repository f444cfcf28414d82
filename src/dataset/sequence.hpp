// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>

#include "dataset/frame_source.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// A folder with some of what only KITTI's layout has: KittiSequence says what is missing.
[[nodiscard]] bool looks_like_kitti(const std::filesystem::path& folder);

/// A KITTI odometry folder: image_N/%06d.png, calib.txt (row PN), times.txt. Frames are CV_8UC1 for
/// the gray cameras, CV_8UC3 in RGB order for colour.
class KittiSequence final : public FrameSource {
 public:
  /// Errors: folder, images, calib row, times missing or malformed; gap in the numbering; range
  /// outside; fewer poses or times than frames; a --gt file that cannot be read; a --calib file
  /// whose principal point is outside the image (one of another image size).
  [[nodiscard]] static Expected<KittiSequence> open(const std::filesystem::path& directory,
                                                    const SequenceOptions& options = {});

 private:
  using FrameSource::FrameSource;
};

}  // namespace stemvo
