// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "stemvo/error.hpp"
#include "stemvo/evaluation/trajectory.hpp"
#include "stemvo/geometry/camera.hpp"

namespace stemvo {

/// Half-open range of frames [begin, end).
struct FrameRange {
  std::size_t begin = 0;
  std::size_t end = 0;
};
/// "A:B", "A:" or ":B"; nullopt end means the last frame. Error: not of that form, or A >= B.
struct FrameRangeRequest {
  std::size_t begin = 0;
  std::optional<std::size_t> end = std::nullopt;
};
[[nodiscard]] Expected<FrameRangeRequest> parse_frame_range(const std::string& text);

/// Keys `input.*` of the configuration, and the program's --frames, --gt and --calib.
struct SequenceOptions {
  std::string camera = "auto";  ///< `auto` (image_2 if there, else image_0), `image_0` .. `image_3`
  std::optional<FrameRangeRequest> frames = std::nullopt;
  /// Else ../../poses/NN.txt if it exists.
  std::optional<std::filesystem::path> ground_truth = std::nullopt;
  /// Else calib.txt in the folder.
  std::optional<std::filesystem::path> calibration = std::nullopt;
};

/// A KITTI odometry folder: image_N/%06d.png, calib.txt (row PN), times.txt.
class KittiSequence {
 public:
  /// Errors: folder, images, calib row, times missing or malformed; gap in the numbering; range
  /// outside; fewer poses or times than frames; a --gt file that cannot be read; a --calib file
  /// whose principal point is outside the picture (one of another picture size).
  [[nodiscard]] static Expected<KittiSequence> open(const std::filesystem::path& directory,
                                                    const SequenceOptions& options = {});

  [[nodiscard]] std::size_t size() const { return files_.size(); }
  [[nodiscard]] const Camera& camera() const { return camera_; }
  [[nodiscard]] const std::string& name() const { return name_; }  ///< folder name, e.g. "03"
  [[nodiscard]] FrameRange range() const { return range_; }        ///< in the folder's numbering
  [[nodiscard]] const std::vector<double>& timestamps_s() const { return timestamps_s_; }
  /// First pose is the identity; absent when there is no file.
  [[nodiscard]] const std::optional<Trajectory>& ground_truth() const { return ground_truth_; }
  /// The pose file the ground truth was read from.
  [[nodiscard]] const std::optional<std::filesystem::path>& ground_truth_file() const {
    return ground_truth_file_;
  }
  /// Of the options; absent: calib.txt in the folder was read.
  [[nodiscard]] const std::optional<std::filesystem::path>& given_calibration() const {
    return given_calibration_;
  }
  [[nodiscard]] const std::filesystem::path& file(std::size_t index) const { return files_[index]; }

  /// Frame `index` in [0, size()): CV_8UC1 for the gray cameras, CV_8UC3 in RGB order for colour.
  /// Error (file named): unreadable or truncated, or not of the camera's size.
  [[nodiscard]] Expected<cv::Mat> read(std::size_t index) const;

 private:
  std::string name_;
  FrameRange range_;
  Camera camera_;
  std::optional<std::filesystem::path> given_calibration_;
  bool is_color_ = false;
  std::vector<std::filesystem::path> files_;
  std::vector<double> timestamps_s_;
  std::optional<Trajectory> ground_truth_;
  std::optional<std::filesystem::path> ground_truth_file_;
};

}  // namespace stemvo
