// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "config/config.hpp"
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

/// Properties of frames that come one behind the other, from a video or a camera.
struct StreamInfo {
  std::size_t max_frames = 0;                 ///< as asked for; the stream may end before
  std::size_t expected_frames = 0;            ///< what the container says; 0: not known
  bool is_live = false;                       ///< ends when the user says so
  std::function<double(std::size_t)> time_s;  ///< of a frame that was read
  std::function<std::size_t()> num_counted;   ///< frames so far that came without a time
  double rate_hz = 30.0;                      ///< as the container or the camera file says
  double counted_hz = 30.0;                   ///< of frames without a time
};

struct GroundTruth {
  Trajectory poses;                 ///< the first is the identity
  std::vector<std::size_t> frames;  ///< whose they are; increasing
};

/// Frames of one camera, in order, and all that is known of them before one is read. Files, times
/// and poses are those of the range; a stream has none of them but a video's file.
struct FrameSource {
  std::string kind;    ///< what it was recognised as, e.g. "KITTI sequence"
  std::string name;    ///< of the folder, e.g. "03"
  FrameRange range;    ///< in the folder's numbering
  Camera camera;       ///< pinhole without distortion, of the frames as they are read
  cv::Size full_size;  ///< of the frames as they come, where they are read at another size
  cv::Mat mask;  ///< of the frames as they are read: 0 where no points are wanted; empty: none
  std::vector<std::filesystem::path> files;
  std::vector<double> timestamps_s;
  std::optional<GroundTruth> ground_truth;
  std::optional<std::filesystem::path> ground_truth_file;
  /// The calibration or camera file that was asked for; absent: calib.txt in the folder was read.
  std::optional<std::filesystem::path> given_calibration;
  std::optional<double> camera_height_m;  ///< above the road, where a camera file says it
  std::optional<Eigen::Quaterniond> camera_from_imu;  ///< where a camera file says it
  double imu_from_camera_s = 0.0;                     ///< added to a frame's time, the gyro's
  std::vector<std::string> notes;                     ///< how it was read, for people
  std::vector<std::string> warnings;                  ///< what may be wrong with what was given
  bool is_kitti = false;                              ///< whose camera is 1.65 m above a road
  /// Frame `index` in [0, size()): CV_8UC1, or CV_8UC3 in RGB order, of the camera's size; all
  /// frames of a source alike. Several threads may call it. Of a stream, each frame once, in order;
  /// an empty image behind the last. Error (file named): unreadable or truncated, or of another
  /// size.
  std::function<Expected<cv::Mat>(std::size_t)> read;
  std::optional<StreamInfo> stream = std::nullopt;
  /// A stream with a pose file finds the true poses by the times of frames that were read.
  std::function<Expected<GroundTruth>(const std::vector<double>& times_s)> match = nullptr;

  /// A stream: the most frames there may be.
  [[nodiscard]] std::size_t size() const { return stream ? stream->max_frames : files.size(); }
  /// The time of a frame; a stream knows it after the frame was read.
  [[nodiscard]] double time_s(std::size_t index) const {
    return stream ? stream->time_s(index) : timestamps_s[index];
  }
  /// The warnings; of a stream that was read also that times were counted.
  [[nodiscard]] std::vector<std::string> warnings_so_far() const;
  [[nodiscard]] std::vector<std::string> remarks() const;
  /// True poses of the first `num_frames`, where they have one; nullopt: there is no ground truth.
  /// Error, of a stream only: no times match.
  [[nodiscard]] Expected<std::optional<GroundTruth>> ground_truth_of(std::size_t num_frames) const;
};

struct SequenceOptions {
  std::string camera = "auto";  ///< `auto` (image_2 if there, else image_0), `image_0` .. `image_3`
  std::optional<FrameRangeRequest> frames = std::nullopt;
  /// Else the recording's own: KITTI's ../../poses/NN.txt, .. if it exists. Matched by time where
  /// the file has times, else a pose per frame.
  std::optional<std::filesystem::path> ground_truth = std::nullopt;
  double ground_truth_tolerance_s = kTimeTolerance_s;
  std::vector<std::string> masks = {};  ///< parts without points, as dataset::make_mask takes them
  /// Else calib.txt in the folder. KITTI's layout only.
  std::optional<std::filesystem::path> calibration = std::nullopt;
};

struct FrameSourceRequest : SequenceOptions {
  /// A folder, a pattern such as `drive/left_*.png` (* and ? in the last part), a video file, or
  /// `camera:N`.
  std::filesystem::path sequence_dir;
  std::optional<std::filesystem::path> camera_file;  ///< in place of the recording's own
  std::optional<std::filesystem::path> times;        ///< of images; else the recording's, or a rate
  /// Frames per second of frames without times; that of a camera file goes before it, 30 behind.
  std::optional<double> rate_hz = std::nullopt;
};

/// Finds out what it is: `camera:N`; a file: a video; a folder that find_listing knows; with
/// `camera_file` any folder of PNG and JPEG images, or a pattern; else KITTI's layout. All but
/// KITTI's are undistorted when read, colour if the images are. Errors: those of open_kitti; none
/// of these; no camera file, or a wrong one; no images, or of another size; times or poses that do
/// not fit; a range outside; a rate beside times.
[[nodiscard]] Expected<FrameSource> open_source(const FrameSourceRequest& request);

/// A folder with some of what only KITTI's layout has: open_kitti says what is missing.
[[nodiscard]] bool looks_like_kitti(const std::filesystem::path& folder);
/// A KITTI odometry folder: image_N/%06d.png, calib.txt (row PN), times.txt. Frames are gray of the
/// gray cameras. Errors: folder, images, calib row, times or --gt file missing or malformed; gap in
/// the numbering; range outside; fewer poses or times than frames; a calibration of another size.
[[nodiscard]] Expected<FrameSource> open_kitti(const std::filesystem::path& directory,
                                               const SequenceOptions& options = {});

namespace dataset {
/// The configuration for these frames. A camera file's camera_height sets scale.camera_height_m
/// where --set did not. Where nobody named scale.source it becomes camera_height on a KITTI folder,
/// with a camera file's height, and with one that was given without a source; else none.
[[nodiscard]] Config with_camera_height(Config config, const FrameSource& frames);
}  // namespace dataset

}  // namespace stemvo
