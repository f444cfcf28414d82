// SPDX-License-Identifier: MIT
#include "dataset/video_stream.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "dataset/frame_files.hpp"
#include "io/loaded_module.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace fs = std::filesystem;

namespace {

/// Whether an mp4 or mov asks to be mirrored, which OpenCV takes for a turn: by the film's matrix
/// (moov, mvhd) or a track's (moov, trak, tkhd), not by both. Boxes end before `end`.
bool is_mirrored(std::istream& file, std::int64_t end, int depth = 0) {
  bool is_film_mirrored = false;
  bool is_track_mirrored = false;
  const auto read = [&file](int bytes) {
    std::int64_t number = 0;
    for (; bytes > 0; --bytes) {
      number = number << 8 | (file.get() & 0xff);
    }
    return number;
  };
  for (std::int64_t at = file.tellg(); at >= 0 && at + 8 < end;) {
    std::int64_t size = file.seekg(at) ? read(4) : 0;
    char name[4] = {};
    file.read(name, sizeof(name));
    size = size == 1 ? read(8) : size == 0 ? end - at : size;
    if (!file || size < 8 || size > end - at) {
      break;
    }
    constexpr std::string_view kNames[] = {"moov", "trak", "tkhd"};
    const std::string_view box(name, sizeof(name));
    const bool is_film = depth == 1 && box == "mvhd";
    if (is_film || (depth == 2 && box == kNames[2])) {
      const std::int64_t times = is_film ? 16 : 20;  // longer by 12 in version 1
      file.seekg(3 + (read(1) == 1 ? 12 : 0) + times + 16, std::ios::cur);
      double matrix[6];
      for (double& number : matrix) {
        number = static_cast<std::int32_t>(read(4));
      }
      (is_film ? is_film_mirrored : is_track_mirrored) =
          matrix[0] * matrix[4] < matrix[1] * matrix[3];
    } else if (box == kNames[depth]) {
      is_track_mirrored = is_mirrored(file, at + size, depth + 1) || is_track_mirrored;
    }
    at += size;
  }
  return is_film_mirrored != is_track_mirrored;
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

constexpr const char* kVideoModule = "libstemvo_video.so";

}  // namespace

Expected<std::shared_ptr<VideoStream>> VideoStream::open(const fs::path& path,
                                                         const cv::Size& size) {
  const auto number = camera_number(path);
  const bool is_file = !number && !is_address(path);
  std::error_code code;
  // A relative path with a colon would be taken for an address.
  const fs::path whole = is_file ? fs::absolute(path, code) : path;
  STEMVO_TRY_GET(void* const found, io::load_symbol(kVideoModule, kOpenDecoder, "decodes videos"));
  VideoDecoder decoder;
  const bool is_open = reinterpret_cast<OpenDecoder*>(found)(number ? nullptr : whole.c_str(),
                                                             number.value_or(0), size, decoder);
  const std::string name = without_secrets(path.string());
  if (!is_open || (!number && decoder.size.empty())) {
    return fail(fmt::format(
        "{}: expected {}", name,
        number    ? fmt::format("a camera at /dev/video{} that this user may read, found none; "
                                "'ls -l /dev/video*' lists those there are",
                                *number)
        : is_file ? "a video that FFmpeg can decode, found a file it cannot (cut off, damaged, or "
                    "no video)"
                  : "a stream of pictures that FFmpeg can decode, found none"));
  }
  if (std::ifstream boxes(path, std::ios::binary);
      is_file && is_mirrored(boxes, static_cast<std::int64_t>(fs::file_size(path, code)))) {
    return fail(
        fmt::format("{}: expected a video that players do not mirror, found one that asks for it; "
                    "'ffmpeg -i IN OUT.mp4' writes frames as players show them",
                    name));
  }
  const bool is_live = number || (!is_file && !(decoder.frame_count > 0.0));
  return std::make_shared<VideoStream>(std::move(decoder), name, is_live);
}

std::size_t VideoStream::expected_frames() const {
  const double count = is_live_ ? 0.0 : decoder_.frame_count;
  return count > 0.0 && count < 1e12 ? static_cast<std::size_t>(count) : 0U;
}

double VideoStream::rate_hz() const {
  const double told_hz = decoder_.rate_hz;
  constexpr double kMax_hz = 1000.0;  // above it is FFmpeg's clock, of short raw MJPEG
  return told_hz > 0.0 && told_hz <= kMax_hz ? told_hz : counted_hz_.value_or(30.0);
}

double VideoStream::next_time_s() {
  constexpr double kMillisecond_s = 1e-3;
  if (is_live_) {
    const std::chrono::duration<double> since = std::chrono::steady_clock::now() - *started_;
    return since.count();
  }
  constexpr double kMinTime_s = -1e6;  // FFmpeg's number for no time is far below
  const double told_s = kMillisecond_s * decoder_.position_ms();
  if (told_s > last_time_s_.value_or(kMinTime_s) && std::isfinite(told_s)) {
    num_counted_ += std::exchange(num_untold_, 0U);
    told_step_s_ = last_time_s_ ? std::optional(told_s - *last_time_s_) : std::nullopt;
    return told_s;
  }
  ++(told_step_s_ ? num_untold_ : num_counted_);
  return last_time_s_ ? *last_time_s_ + told_step_s_.value_or(1.0 / counted_hz()) : 0.0;
}

bool VideoStream::grab() {
  if (is_ended_ || !decoder_.grab()) {
    is_ended_ = true;
    return false;
  }
  if (!started_) {
    started_ = std::chrono::steady_clock::now();
  }
  const double time_s = next_time_s();
  last_time_s_ = last_time_s_ ? std::max(time_s, std::nextafter(*last_time_s_, 1e300)) : time_s;
  return true;
}

Status VideoStream::skip(std::size_t count) {
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i <= count; ++i) {
    if (!grab()) {
      return fail(fmt::format("{}: expected more than {} frames that can be decoded, found {}",
                              name_, count, i));
    }
  }
  is_grabbed_ = true;
  return {};
}

Expected<cv::Mat> VideoStream::read(std::size_t index) {
  std::unique_lock lock(mutex_);
  turn_.wait(lock, [&] { return next_ == index || is_ended_; });
  if (is_ended_) {
    return cv::Mat();
  }
  cv::Mat image;
  if (std::exchange(is_grabbed_, false) || grab()) {
    image = decoder_.retrieve();
    times_s_.push_back(*last_time_s_);
    ++next_;
  }
  const bool is_ended = is_ended_;
  lock.unlock();
  turn_.notify_all();
  if (is_ended) {
    return cv::Mat();
  }
  if (image.type() != CV_8UC3) {
    return fail(
        fmt::format("{}: frame {}: expected 8-bit colour, found another or none", name_, index));
  }
  cv::Mat rgb;
  cv::cvtColor(image, rgb, cv::COLOR_BGR2RGB);
  return rgb;
}

double VideoStream::time_s(std::size_t index) const {
  const std::lock_guard lock(mutex_);
  return times_s_.at(index);
}

std::size_t VideoStream::num_counted() const {
  const std::lock_guard lock(mutex_);
  constexpr std::size_t kMostKept = 16;  // frames that H.264 and H.265 put into order
  return num_counted_ + (num_untold_ > kMostKept ? num_untold_ : 0U);
}

std::string warn_of_turn(const VideoStream& stream, const std::string& owner) {
  const int turned_deg = stream.decoder().turned_deg;
  return turned_deg == 0
             ? ""
             : fmt::format(
                   "{}: frames are turned by {} degrees, as the container asks and players "
                   "do; the camera file is one of such frames",
                   owner, turned_deg);
}

Expected<FrameSource> open_stream(const std::shared_ptr<VideoStream>& stream,
                                  const CameraFile& camera,
                                  const FrameSourceRequest& request) {
  const std::string owner = without_secrets(request.sequence_dir.string());
  const FrameRangeRequest range = request.frames.value_or(FrameRangeRequest{});
  STEMVO_TRY(check_size(stream->decoder().size, camera.camera, owner, *request.camera_file));
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
  frames.warnings = camera.warnings;
  add_line(frames.warnings, warn_of_turn(*stream, owner));
  constexpr double kAlike = 0.05;
  const auto& said_hz = request.rate_hz ? request.rate_hz : camera.rate_hz;
  if (said_hz && stream->num_counted() == 0 &&
      (request.rate_hz || std::abs(*said_hz / stream->rate_hz() - 1.0) > kAlike)) {
    frames.warnings.push_back(
        fmt::format("{} {}: {} says when each frame was taken, which goes before it",
                    request.rate_hz ? "--rate" : "rate_hz", *said_hz, owner));
  }
  if (range.end && frames.stream->expected_frames > 0 && all < *range.end) {
    frames.warnings.push_back(
        fmt::format("--frames {}:{}: {} has {} frames, as its container counts them", range.begin,
                    *range.end, owner, all));
  }
  if (stream->decoder().gray_bits > 8) {
    frames.warnings.push_back(fmt::format(
        "{}: of {} bits per gray level the upper 8 are taken; images of 16 bits are read whole",
        owner, stream->decoder().gray_bits));
  }
  if (request.ground_truth) {
    STEMVO_TRY_GET(const auto truth, read_truth(*request.ground_truth, request.camera_file));
    STEMVO_TRY(check_length(truth, frames, request));
    if (!request.frames && frames.stream->expected_frames > 0) {
      add_line(frames.warnings, warn_of_spare_poses(truth, frames.stream->expected_frames));
    }
    frames.ground_truth_file = request.ground_truth;
    frames.match = [truth, request](const std::vector<double>& times_s) {
      return match_frames(truth, request.frames.value_or(FrameRangeRequest{}).begin, times_s,
                          request.ground_truth_tolerance_s);
    };
  }
  // The driver of a camera may give another size than it was asked for.
  const auto read = [stream, owner, camera_file = *request.camera_file,
                     raw = camera.camera](std::size_t index) -> Expected<cv::Mat> {
    STEMVO_TRY_GET(const cv::Mat image, stream->read(index));
    if (!image.empty()) {
      STEMVO_TRY(check_size(image.size(), raw, owner, camera_file));
    }
    return image;
  };
  STEMVO_TRY(add_view(frames, camera, *request.camera_file, request.masks, read));
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
  const cv::Size size(camera.camera.width_px, camera.camera.height_px);
  const auto stream = VideoStream::open(request.sequence_dir, size);
  return stream.and_then([&](const std::shared_ptr<VideoStream>& opened) {
    return open_stream(opened, camera, request);
  });
}

Expected<WriteFrame> encode_file(const std::filesystem::path& file,
                                 double rate_hz,
                                 const cv::Size& size) {
  constexpr const char* kEndings[] = {".mp4", ".mkv", ".avi"};
  if (std::ranges::find(kEndings, file.extension()) == std::end(kEndings)) {
    return fail(fmt::format("{}: expected a video to write that ends in .mp4, .mkv or .avi",
                            file.string()));
  }
  STEMVO_TRY(check_can_write(file));
  STEMVO_TRY_GET(void* const found, io::load_symbol(kVideoModule, kOpenWriter, "writes videos"));
  WriteFrame write;
  // A relative path with a colon would be taken for an address.
  std::error_code code;
  const auto whole = std::filesystem::absolute(file, code);
  if (!reinterpret_cast<OpenWriter*>(found)(whole.c_str(), rate_hz, size, write)) {
    return fail(fmt::format(
        "{}: expected an encoder of H.264, MPEG-4 or MJPEG for {}x{} pixels, FFmpeg found none",
        file.string(), size.width, size.height));
  }
  return write;
}

}  // namespace stemvo::dataset
