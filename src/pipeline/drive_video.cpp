// SPDX-License-Identifier: MIT
#include "pipeline/drive_video.hpp"

#include <algorithm>
#include <bit>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "report/frame_image.hpp"
#include "report/trajectory_plot.hpp"
#include "try.hpp"

namespace stemvo::pipeline {
namespace {

/// Frames a second of one video, whatever gaps the recording has.
double rate_of(const FrameSource& sequence) {
  const auto& times_s = sequence.timestamps_s;
  const double rate_hz = sequence.stream      ? sequence.stream->rate_hz
                         : times_s.size() > 1 ? static_cast<double>(times_s.size() - 1) /
                                                    (times_s.back() - times_s.front())
                                              : 0.0;
  return std::clamp(rate_hz, 1.0, 240.0);
}

}  // namespace

Expected<DriveVideo> DriveVideo::create(const RunRequest& request, const FrameSource& sequence) {
  DriveVideo video;
  if (request.video) {
    const Camera& camera = sequence.camera;
    const cv::Mat blank(camera.height_px, camera.width_px, CV_8UC3);
    const cv::Size size = draw_under_caption(blank, "", "").size();
    video.file_ = request.video->string();
    video.size_ = {(size.width + size.height) & ~1, size.height & ~1};  // as encoders want them
    STEMVO_TRY_GET(video.write_,
                   dataset::encode_file(*request.video, rate_of(sequence), video.size_));
  }
  return video;
}

void DriveVideo::add(const cv::Mat& image, const Trajectory& path, const std::string& unit) const {
  // Each frame draws the path anew: of a long drive few poses, or it takes longer and longer.
  constexpr std::size_t kMaxPoses = 2000;
  const std::size_t step = std::bit_ceil(path.size() / kMaxPoses + 1);
  Trajectory drawn;
  for (std::size_t i = 0; i + 1 < path.size(); i += step) {
    drawn.push_back(path[i]);
  }
  drawn.push_back(path.back());
  cv::Mat frame;
  cv::hconcat(image, draw_path(drawn, image.rows, unit), frame);
  cv::cvtColor(frame, frame, cv::COLOR_RGB2BGR);
  write_(frame(cv::Rect({0, 0}, size_)));
}

Status DriveVideo::finish() const {
  return !is_on() || write_({}) ? Status()
                                : fail(fmt::format("{}: expected a video with all frames, found it "
                                                   "cut off: is the disk full?",
                                                   file_));
}

}  // namespace stemvo::pipeline
