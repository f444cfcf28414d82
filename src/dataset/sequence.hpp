// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "dataset/frame_source.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

/// Keys `input.*` of the configuration, and the program's --frames, --gt and --calib.
struct SequenceOptions {
  std::string camera = "auto";  ///< `auto` (image_2 if there, else image_0), `image_0` .. `image_3`
  std::optional<FrameRangeRequest> frames = std::nullopt;
  /// Else ../../poses/NN.txt if it exists.
  std::optional<std::filesystem::path> ground_truth = std::nullopt;
  /// Else calib.txt in the folder.
  std::optional<std::filesystem::path> calibration = std::nullopt;
};

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
