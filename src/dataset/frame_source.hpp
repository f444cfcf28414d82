// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
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
  Camera camera;     ///< pinhole without distortion, of the frames as they are read
  std::vector<std::filesystem::path> files;
  std::vector<double> timestamps_s;
  std::optional<Trajectory> ground_truth;  ///< first pose is the identity
  std::optional<std::filesystem::path> ground_truth_file;
  /// The calibration or camera file that was asked for; absent: calib.txt in the folder was read.
  std::optional<std::filesystem::path> given_calibration;
  std::optional<double> camera_height_m;  ///< above the road, where a camera file says it
  /// Index in `files` -> frame; several threads may call it.
  std::function<Expected<cv::Mat>(std::size_t)> read;
};

/// Frames of one camera, in order; what is known of them as in FrameList.
class FrameSource {
 public:
  explicit FrameSource(FrameList frames) : frames_(std::move(frames)) {}

  [[nodiscard]] std::size_t size() const { return frames_.files.size(); }
  [[nodiscard]] const Camera& camera() const { return frames_.camera; }
  [[nodiscard]] const std::string& name() const { return frames_.name; }
  [[nodiscard]] FrameRange range() const { return frames_.range; }
  [[nodiscard]] const std::vector<double>& timestamps_s() const { return frames_.timestamps_s; }
  [[nodiscard]] const std::optional<Trajectory>& ground_truth() const {
    return frames_.ground_truth;
  }
  [[nodiscard]] const std::optional<std::filesystem::path>& ground_truth_file() const {
    return frames_.ground_truth_file;
  }
  [[nodiscard]] const std::optional<std::filesystem::path>& given_calibration() const {
    return frames_.given_calibration;
  }
  [[nodiscard]] const std::optional<double>& camera_height_m() const {
    return frames_.camera_height_m;
  }
  [[nodiscard]] const std::filesystem::path& file(std::size_t index) const {
    return frames_.files[index];
  }
  [[nodiscard]] const FrameList& frames() const { return frames_; }

  /// Frame `index` in [0, size()): CV_8UC1, or CV_8UC3 in RGB order, of the camera's size; all
  /// frames of a source alike. May be called by several threads at a time. Error (file named):
  /// unreadable or truncated, or of another size.
  [[nodiscard]] Expected<cv::Mat> read(std::size_t index) const;

 private:
  FrameList frames_;
};

/// Keys `input.*` of the configuration, and the program's --frames, --gt and --calib.
struct SequenceOptions {
  std::string camera = "auto";  ///< `auto` (image_2 if there, else image_0), `image_0` .. `image_3`
  std::optional<FrameRangeRequest> frames = std::nullopt;
  /// Else ../../poses/NN.txt if it exists; of images none.
  std::optional<std::filesystem::path> ground_truth = std::nullopt;
  /// Else calib.txt in the folder. KITTI's layout only.
  std::optional<std::filesystem::path> calibration = std::nullopt;
};

/// What was asked for, and the files given beside it.
struct FrameSourceRequest : SequenceOptions {
  /// A folder in KITTI's layout or, with `camera_file`, a folder of images or a pattern such as
  /// `drive/left_*.png` (* and ? in the last part).
  std::filesystem::path sequence_dir;
  std::optional<std::filesystem::path> camera_file;  ///< of images
  std::optional<std::filesystem::path> times;        ///< of images; else the camera's rate_hz
};

/// KITTI's layout without a camera file: KittiSequence::open. With one: PNG and JPEG images in
/// the order of their names, numbers by value, undistorted when read, colour if the images are.
/// `ground_truth` (KITTI's pose format) and `times` (seconds) hold a line per image; without
/// `times` the camera file's rate_hz counts. Errors: those of KittiSequence::open; neither layout
/// nor camera file; a camera file that is wrong; no images; images of another size; more or
/// fewer times or poses than images; a range outside.
[[nodiscard]] Expected<FrameSource> open_source(const FrameSourceRequest& request);

}  // namespace stemvo
