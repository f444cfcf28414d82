// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core.hpp>

#include "dataset/camera_file.hpp"
#include "dataset/frame_source.hpp"
#include "dataset/listing.hpp"
#include "dataset/video_stream.hpp"
#include "io/image_file.hpp"
#include "odometry/frame_view.hpp"
#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"
#include "text/text_file.hpp"

/// Parts that all frame sources share.
namespace stemvo::dataset {

/// Without a trailing separator, so that its last part is the folder's name.
[[nodiscard]] std::filesystem::path absolute_folder(const std::filesystem::path& folder);
/// The last part of a folder's name that not every recording has, as `images` or `cam0`.
[[nodiscard]] std::string recording_name(const std::filesystem::path& folder);
/// All entries of a folder, in no order. Error: it cannot be listed.
[[nodiscard]] Expected<std::vector<std::filesystem::path>> list_folder(
    const std::filesystem::path& folder);

/// All where nothing is asked for. Error: empty or outside the `count` frames (or what `things`
/// are) of `owner`.
[[nodiscard]] Expected<FrameRange> resolve_range(const std::optional<FrameRangeRequest>& request,
                                                 std::size_t count,
                                                 const std::string& owner,
                                                 std::string_view things = "frames");

/// Where there are more poses without times than frames: some may be missing. Empty: not so.
[[nodiscard]] std::string warn_of_spare_poses(const PoseFile& truth, std::size_t num_frames);

/// Files and times of the range; the rest of the list is left as it is made.
[[nodiscard]] FrameSource list_frames(const FrameRange& range,
                                      const std::vector<std::filesystem::path>& files,
                                      const std::vector<double>& times_s);
/// Adds the poses of a file: by time where it has times, else one per frame, as many as there are
/// files in all if `is_exact`. Errors: those of read_truth; another number of poses; other times.
[[nodiscard]] Status add_ground_truth(FrameSource& frames,
                                      const std::filesystem::path& poses,
                                      const std::optional<std::filesystem::path>& camera_file,
                                      double tolerance_s,
                                      std::size_t num_files,
                                      bool is_exact);

/// Images that were listed; what the request names goes before what lies beside them.
[[nodiscard]] Expected<FrameSource> open_listing(const Listing& listing,
                                                 const FrameSourceRequest& request);
/// "rtsp://..", "http://.." and the like.
[[nodiscard]] bool is_address(const std::filesystem::path& path);
/// A text with addresses, whose users and queries are left out: they may hold passwords.
[[nodiscard]] std::string without_secrets(const std::string& text);
/// N of "camera:N".
[[nodiscard]] std::optional<int> camera_number(const std::filesystem::path& path);
[[nodiscard]] Expected<FrameSource> open_video(const FrameSourceRequest& request);
[[nodiscard]] Expected<FrameSource> open_stream(const std::shared_ptr<VideoStream>& stream,
                                                const CameraFile& camera,
                                                const FrameSourceRequest& request);

/// A line where frames are turned as the container asks; else empty.
[[nodiscard]] std::string warn_of_turn(const VideoStream& stream, const std::string& owner);

/// Error: the images of `owner` are of another size than the camera file says, if it says one.
[[nodiscard]] Status check_size(const cv::Size& found,
                                const Camera& camera,
                                const std::string& owner,
                                const std::filesystem::path& camera_file);
/// Adds the camera file's view, mask and reader: `read_whole` gives the frames as they come, of the
/// view's full size. Errors: those of FrameView::create, naming the camera file, and of make_mask.
[[nodiscard]] Expected<FrameView> add_view(
    FrameSource& frames,
    const CameraFile& camera,
    const std::filesystem::path& camera_file,
    const std::vector<std::string>& masks,
    std::function<Expected<cv::Mat>(std::size_t)> read_whole);

struct SharedKind {
  cv::Size size;
  bool is_color = false;
  io::Levels levels;
};
/// Properties of most of the first five readable images: one odd frame must not throw the rest
/// away. Levels that differ from all of 16 bits are a warning. Error: none can be read.
[[nodiscard]] Expected<SharedKind> vote_on_images(FrameSource& frames);

/// Where points are wanted: CV_8UC1, 0 in the parts and 255 elsewhere; no parts: an empty image.
/// They are rectangles `X,Y,WIDTH,HEIGHT`, which may reach over the rim, and image files of the
/// frames' size as they come, black (below 128) where none. Errors: neither of both; a rectangle
/// that is empty or outside; a file of another size; nothing left.
[[nodiscard]] Expected<cv::Mat> make_mask(const std::vector<std::string>& parts, cv::Size size);

/// The camera's poses, also of EuRoC's file, whose poses are the body's: T_BS of the camera file
/// says how the camera sits on it; without one, of ../cam0/sensor.yaml. Errors: those of
/// read_pose_file; EuRoC's without T_BS.
[[nodiscard]] Expected<PoseFile> read_truth(
    const std::filesystem::path& file, const std::optional<std::filesystem::path>& camera_file);

/// Error: fewer than two pairs, which the spans of time may explain. `owner`: of the times.
[[nodiscard]] Status check_pairs(const PoseFile& truth,
                                 const std::string& owner,
                                 std::span<const double> times_s,
                                 const TimePairs& pairs,
                                 double tolerance_s);

/// The poses that frames have: by their times where the file has times, else one per frame, from
/// pose `begin` on. Errors: fewer than two of these times; fewer poses than frames.
[[nodiscard]] Expected<GroundTruth> match_frames(const PoseFile& truth,
                                                 std::size_t begin,
                                                 const std::vector<double>& times_s,
                                                 double tolerance_s);

/// Intrinsics of camera `index` (0..3) from its row `PN:` (odometry and object benchmarks) or
/// `P_rect_0N:` (raw data); the size is that of `S_rect_0N:`, else zero. Errors: no row of the
/// camera; other numbers than 12 and 2; skew.
[[nodiscard]] Expected<Camera> read_kitti_camera(const std::filesystem::path& file, int index);

/// The text of a calib.txt with other intrinsics in every projection row whose intrinsics are
/// `given`; the row's offset to the first camera in metres, K^-1 p4, stays. Error: unreadable.
[[nodiscard]] Expected<std::string> replace_kitti_camera(const std::filesystem::path& file,
                                                         const Camera& given,
                                                         const Camera& refined);

/// One time per line, for at least `num_expected` images, or as many if `is_exact`. Errors:
/// read_timed_rows'; another number of lines.
[[nodiscard]] Expected<TimedRows<double>> read_kitti_times(const std::filesystem::path& file,
                                                           std::size_t num_expected,
                                                           bool is_exact = false);

}  // namespace stemvo::dataset
