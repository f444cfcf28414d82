// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "evaluation/trajectory.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

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

/// What a source knows of its frames before one is read. Files, times and poses are those of the
/// range, one per frame.
struct FrameList {
  std::string name;  ///< of the folder, e.g. "03"
  FrameRange range;  ///< in the folder's numbering
  Camera camera;     ///< of the frames as they are read: without distortion
  std::vector<std::filesystem::path> files;
  std::vector<double> timestamps_s;
  std::optional<Trajectory> ground_truth = std::nullopt;  ///< first pose is the identity
  std::optional<std::filesystem::path> ground_truth_file = std::nullopt;
  std::optional<std::filesystem::path> given_calibration = std::nullopt;
  std::optional<double> camera_height_m = std::nullopt;  ///< above the road, of a camera file
  /// File -> frame; several threads may call it.
  std::function<Expected<cv::Mat>(const std::filesystem::path&)> read = {};
};

/// Frames of one camera, in order.
class FrameSource {
 public:
  explicit FrameSource(FrameList frames) : frames_(std::move(frames)) {}

  [[nodiscard]] std::size_t size() const { return frames_.files.size(); }
  /// Pinhole without distortion, of the frames as `read` gives them.
  [[nodiscard]] const Camera& camera() const { return frames_.camera; }
  [[nodiscard]] const std::string& name() const { return frames_.name; }
  [[nodiscard]] FrameRange range() const { return frames_.range; }
  [[nodiscard]] const std::vector<double>& timestamps_s() const { return frames_.timestamps_s; }
  /// First pose is the identity; absent when there is no file.
  [[nodiscard]] const std::optional<Trajectory>& ground_truth() const {
    return frames_.ground_truth;
  }
  /// The pose file the ground truth was read from.
  [[nodiscard]] const std::optional<std::filesystem::path>& ground_truth_file() const {
    return frames_.ground_truth_file;
  }
  /// The calibration or camera file that was asked for; absent: calib.txt in the folder was read.
  [[nodiscard]] const std::optional<std::filesystem::path>& given_calibration() const {
    return frames_.given_calibration;
  }
  /// Above the road; absent where no camera file says it.
  [[nodiscard]] const std::optional<double>& camera_height_m() const {
    return frames_.camera_height_m;
  }
  [[nodiscard]] const std::filesystem::path& file(std::size_t index) const {
    return frames_.files[index];
  }

  /// Frame `index` in [0, size()): CV_8UC1, or CV_8UC3 in RGB order, of the camera's size; all
  /// frames of a source alike. May be called by several threads at a time. Error (file named):
  /// unreadable or truncated, or of another size.
  [[nodiscard]] Expected<cv::Mat> read(std::size_t index) const;

 private:
  FrameList frames_;
};

/// What was asked for, and the files given beside it.
struct FrameSourceRequest {
  /// A folder in KITTI's layout or, with `camera_file`, a folder of images or a pattern such as
  /// `drive/left_*.png` (* and ? in the last part).
  std::filesystem::path path;
  std::string kitti_camera = "auto";  ///< key input.camera
  std::optional<FrameRangeRequest> frames = std::nullopt;
  std::optional<std::filesystem::path> ground_truth = std::nullopt;
  std::optional<std::filesystem::path> calibration = std::nullopt;  ///< KITTI's layout only
  std::optional<std::filesystem::path> camera_file = std::nullopt;
  std::optional<std::filesystem::path> times = std::nullopt;  ///< with camera_file only
};

/// KITTI's layout without a camera file: KittiSequence::open. With one: PNG and JPEG images in
/// the order of their names, numbers by value, undistorted when read, colour if the images are.
/// `ground_truth` (KITTI's pose format) and `times` (seconds) hold a line per image; without
/// `times` the camera file's rate_hz counts. Errors: those of KittiSequence::open; neither layout
/// nor camera file; a camera file that is wrong; no images; images of another size; more or
/// fewer times or poses than images; a range outside.
[[nodiscard]] Expected<std::unique_ptr<const FrameSource>> open_source(
    const FrameSourceRequest& request);

}  // namespace stemvo
