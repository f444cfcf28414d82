// SPDX-License-Identifier: MIT
#include <algorithm>
#include <filesystem>
#include <limits>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace {

/// The camera's image: the driver of a camera may give another size than it was asked for.
Status check_stream_size(const cv::Size& size, const Camera& camera, const std::string& owner) {
  if (size != cv::Size(camera.width_px, camera.height_px)) {
    return fail(
        fmt::format("{}: expected frames of {}x{} pixels, as the camera file says, found "
                    "{}x{}",
                    owner, camera.width_px, camera.height_px, size.width, size.height));
  }
  return {};
}

/// Error: poses without times are fewer than the frames. The container's count may be wrong, so
/// that --frames overrides it.
Status check_length(const PoseFile& truth,
                    const FrameSource& frames,
                    const FrameSourceRequest& request) {
  const std::size_t num_expected = frames.range.begin + frames.stream->expected_frames;
  if (!truth.timestamps_s.empty() || frames.stream->expected_frames == 0 ||
      truth.poses.size() >= num_expected) {
    return {};
  }
  return fail(fmt::format(
      "{}: expected a pose for each of {} frames, as the video's container counts them, found {} "
      "poses; --frames A:B takes fewer frames",
      request.ground_truth->string(), num_expected, truth.poses.size()));
}

/// The last part of an address behind the host, without a query.
std::string stem_of(const std::filesystem::path& path) {
  const std::string address = path.string();
  if (!is_address(path)) {
    return path.stem().string();
  }
  const std::size_t end = std::min(address.find_first_of("?#"), address.size());
  const std::size_t way = address.find('/', address.find("://") + 3);
  return way < end ? std::filesystem::path(address.substr(way, end - way)).stem().string() : "";
}

}  // namespace

std::vector<std::string> warn_of_turn(const VideoStream& stream, const std::string& owner) {
  if (stream.decoder().turned_deg == 0) {
    return {};
  }
  return {
      fmt::format("{}: frames are turned by {} degrees, as the container asks and players do; "
                  "the camera file is one of such frames",
                  owner, stream.decoder().turned_deg)};
}

Expected<FrameSource> open_stream(const std::shared_ptr<VideoStream>& stream,
                                  const CameraFile& camera,
                                  const FrameSourceRequest& request) {
  const std::string owner = without_secrets(request.sequence_dir.string());
  const FrameRangeRequest range = request.frames.value_or(FrameRangeRequest{});
  STEMVO_TRY(check_stream_size(stream->decoder().size, camera.camera, owner));
  STEMVO_TRY_GET(const FrameView view, view_of(camera.camera, *request.camera_file));
  if (const auto& rate_hz = camera.rate_hz ? camera.rate_hz : request.rate_hz) {
    stream->set_counted_rate(*rate_hz);
  }
  STEMVO_TRY(stream->skip(range.begin));
  FrameSource frames;
  frames.kind = stream->is_live() ? "live camera" : "video";
  const auto number = camera_number(owner);
  const std::string stem = stem_of(request.sequence_dir);
  frames.name = number ? fmt::format("camera{}", *number) : stem.empty() ? "stream" : stem;
  if (!number && !is_address(request.sequence_dir)) {
    frames.files = {request.sequence_dir};
  }
  const std::size_t end = range.end.value_or(std::numeric_limits<std::size_t>::max());
  frames.range = {range.begin, end};
  const std::size_t all = stream->expected_frames();
  frames.stream = StreamInfo{end - range.begin,
                             all > range.begin ? std::min(all, end) - range.begin : 0U,
                             stream->is_live(),
                             [stream](std::size_t index) { return stream->time_s(index); },
                             [stream] { return stream->num_counted(); },
                             stream->rate_hz(),
                             stream->counted_hz()};
  frames.given_calibration = request.camera_file;
  frames.camera_height_m = camera.camera_height_m;
  frames.warnings = camera.warnings;
  const auto turns = warn_of_turn(*stream, owner);
  frames.warnings.insert(frames.warnings.end(), turns.begin(), turns.end());
  if (stream->decoder().gray_bits > 8) {
    frames.warnings.push_back(fmt::format(
        "{}: of {} bits per gray level the upper 8 are taken; images of 16 bits are read whole",
        owner, stream->decoder().gray_bits));
  }
  frames.camera_from_imu = camera.camera_from_imu();
  if (request.ground_truth) {
    STEMVO_TRY_GET(const auto truth, read_truth(*request.ground_truth, request.camera_file));
    STEMVO_TRY(check_length(truth, frames, request));
    frames.ground_truth_file = request.ground_truth;
    frames.match = [truth, request](const std::vector<double>& times_s) {
      return match_frames(truth, request.frames.value_or(FrameRangeRequest{}).begin, times_s,
                          request.ground_truth_tolerance_s);
    };
  }
  const auto read = [stream, owner, raw = camera.camera](std::size_t index) -> Expected<cv::Mat> {
    STEMVO_TRY_GET(const cv::Mat image, stream->read(index));
    if (!image.empty()) {
      STEMVO_TRY(check_stream_size(image.size(), raw, owner));
    }
    return image;
  };
  STEMVO_TRY(add_view(frames, view, request.masks, read));
  return frames;
}

Expected<FrameSource> open_video(const FrameSourceRequest& request) {
  if (!request.camera_file) {
    return fail(
        fmt::format("{}: {}: expected --camera FILE, found none; 'stemvo run --help' shows what it "
                    "holds",
                    request.sequence_dir.string(),
                    camera_number(request.sequence_dir) ? "a live camera" : "taken for a video"));
  }
  STEMVO_TRY_GET(const auto camera, read_camera_file(*request.camera_file));
  const auto number = camera_number(request.sequence_dir);
  const cv::Size size(camera.camera.width_px, camera.camera.height_px);
  const auto stream = number ? VideoStream::open_camera(*number, size)
                      : is_address(request.sequence_dir)
                          ? VideoStream::open_address(request.sequence_dir.string(), size)
                          : VideoStream::open_file(request.sequence_dir, size);
  return stream.and_then([&](const std::shared_ptr<VideoStream>& opened) {
    return open_stream(opened, camera, request);
  });
}

}  // namespace stemvo::dataset
