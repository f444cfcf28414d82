// SPDX-License-Identifier: MIT
#include "dataset/video_stream.hpp"

#include <cmath>
#include <cstdint>
#include <fstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "dataset/frame_files.hpp"
#include "try.hpp"

namespace stemvo::dataset {

namespace fs = std::filesystem;

namespace {

/// Whether a track of an mp4 or mov asks to be mirrored, which OpenCV takes for a turn. Boxes that
/// end before `end` are looked through: moov, trak in it, tkhd in it.
bool is_mirrored(std::istream& file, std::int64_t end, int depth = 0) {
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
      return false;
    }
    constexpr std::string_view kNames[] = {"moov", "trak", "tkhd"};
    if (std::string_view(name, sizeof(name)) == kNames[depth]) {
      if (depth < 2) {
        if (is_mirrored(file, at + size, depth + 1)) {
          return true;
        }
      } else {
        constexpr std::int64_t kTimes = 20;  // longer by 12 in version 1
        const bool is_long = read(1) == 1;
        file.seekg(3 + kTimes + (is_long ? 12 : 0) + 16, std::ios::cur);
        double matrix[6];
        for (double& number : matrix) {
          number = static_cast<std::int32_t>(read(4));
        }
        return matrix[0] * matrix[4] < matrix[1] * matrix[3];
      }
    }
    at += size;
  }
  return false;
}

}  // namespace

Expected<std::shared_ptr<VideoStream>> VideoStream::open_file(const fs::path& file,
                                                              const cv::Size& size) {
  std::error_code code;
  // A relative path with a colon would be taken for an address.
  STEMVO_TRY_GET(auto decoder, open_decoder(fs::absolute(file, code).c_str(), 0, size));
  if (!decoder) {
    return fail(fmt::format(
        "{}: expected a video that FFmpeg can decode, found a file it cannot (cut off, damaged, or "
        "no video)",
        file.string()));
  }
  std::ifstream boxes(file, std::ios::binary);
  if (is_mirrored(boxes, static_cast<std::int64_t>(fs::file_size(file, code)))) {
    return fail(fmt::format(
        "{}: expected a video that players do not mirror, found a track that asks for it; "
        "'ffmpeg -i IN OUT.mp4' writes frames as players show them",
        file.string()));
  }
  return std::make_shared<VideoStream>(*std::move(decoder), file.string(), false);
}

Expected<std::shared_ptr<VideoStream>> VideoStream::open_address(const std::string& address,
                                                                 const cv::Size& size) {
  STEMVO_TRY_GET(auto decoder, open_decoder(address.c_str(), 0, size));
  const std::string name = without_secrets(address);
  if (!decoder || decoder->size.empty()) {
    return fail(
        fmt::format("{}: expected a stream of pictures that FFmpeg can decode, found none", name));
  }
  const bool is_live = !(decoder->frame_count > 0.0);
  return std::make_shared<VideoStream>(*std::move(decoder), name, is_live);
}

Expected<std::shared_ptr<VideoStream>> VideoStream::open_camera(int number, const cv::Size& size) {
  STEMVO_TRY_GET(auto decoder, open_decoder(nullptr, number, size));
  if (!decoder) {
    return fail(fmt::format(
        "camera:{0}: expected a camera at /dev/video{0} that this user may read, found none; "
        "'ls -l /dev/video*' lists those there are",
        number));
  }
  return std::make_shared<VideoStream>(*std::move(decoder), fmt::format("camera:{}", number), true);
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
    return told_s;
  }
  ++num_counted_;
  return last_time_s_ ? *last_time_s_ + 1.0 / counted_hz() : 0.0;
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
  return num_counted_;
}

}  // namespace stemvo::dataset
