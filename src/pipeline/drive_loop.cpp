// SPDX-License-Identifier: MIT
#include "pipeline/drive_loop.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <future>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "pipeline/frame_pipeline.hpp"
#include "report/frame_image.hpp"
#include "report/frames_csv.hpp"
#include "text/text_file.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

/// Whether frame i is one of the few in report.html: evenly spaced among n, each twice as far as
/// the one before where n is not known (0).
bool is_in_report(std::size_t i, std::size_t n) {
  constexpr std::size_t kImages = 6;
  return n == 0 ? i >= kImages && std::has_single_bit(i) : (i + 1) * kImages / n > i * kImages / n;
}

/// Frames in all, of a stream as its container says; 0: not known, or said wrongly.
std::size_t expected_frames(const FrameSource& sequence, std::size_t num_done) {
  if (!sequence.stream()) {
    return sequence.size();
  }
  const std::size_t told = sequence.stream()->expected_frames;
  return told > num_done ? told : 0;  // a last frame is known by what comes behind it
}

class DriveLoop {
 public:
  DriveLoop(const Run& run, const RunProgress& progress) : run_(run), progress_(progress) {}

  Drive drive() {
    drive_.csv = frames_csv_header();
    run_frames(run_.sequence, run_.odometry,
               [this](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
                 return visit(i, frame, pose);
               });
    if (run_.sequence.stream()) {
      end_stream(*run_.sequence.stream());
    }
    finish_files();
    return std::move(drive_);
  }

 private:
  /// False: the run ends behind this frame.
  bool visit(std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
    const std::size_t number = run_.sequence.range().begin + i;
    if (!frame) {
      drive_.warnings.push_back(frame.error().message);
    }
    if (!pose.problem.empty()) {
      drive_.warnings.push_back(fmt::format("frame {}: {}", number, pose.problem));
    }
    drive_.frames.push_back(pose);
    const StageTimer timer(Stage::kFrameFiles);
    drive_.csv += frames_csv_row(number, run_.sequence.time_s(i), pose);
    keep_files();
    keep_image(i, frame, pose);
    const std::size_t expected = expected_frames(run_.sequence, i + 1);
    drive_.interrupted = progress_ && !progress_(i + 1, expected) && i + 1 < run_.sequence.size();
    return !drive_.interrupted;
  }

  void keep_image(std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
    const RunRequest& request = run_.request;
    const bool is_asked_for =
        request.image_every > 0 && i % static_cast<std::size_t>(request.image_every) == 0;
    const bool is_reported = is_in_report(i, expected_frames(run_.sequence, i + 1));
    if (!is_asked_for && !is_reported) {
      return;
    }
    const std::size_t number = run_.sequence.range().begin + i;
    const ChannelOdometry& seen = run_.odometry.frames();
    const cv::Mat image = draw_frame_image(frame.value_or(cv::Mat()), seen.image(), seen.matches(),
                                           seen.inlier_mask());
    const std::string caption =
        fmt::format("frame {}: {}, {} of {} matches", number, to_string(pose.state),
                    pose.num_inliers, pose.num_matches);
    const std::string colors = describe_flow(seen.matches(), seen.inlier_mask());
    if (is_asked_for) {
      const auto file = request.out_dir / "pictures" / fmt::format("{:06}.png", number);
      keep_first(drive_.written, write_image(file, draw_under_caption(image, caption, colors)));
    }
    if (is_reported) {
      constexpr int kReportWidth_px = 720;
      drive_.images.push_back(
          {caption + (colors.empty() ? "" : "; " + colors), encode_jpeg(image, kReportWidth_px)});
    }
  }

  /// The files so far, once a second, while the frames go on.
  void keep_files() {
    const bool is_busy =
        writing_.valid() && writing_.wait_for(Seconds(0)) == std::future_status::timeout;
    if (is_busy || Clock::now() - last_files_ < std::chrono::seconds(1)) {
      return;
    }
    last_files_ = Clock::now();
    auto write = [out = run_.request.out_dir, csv = drive_.csv,
                  trajectory = drive_.trajectory(run_)]() mutable {
      static_cast<void>(write_text_file(out / "frames.csv", std::exchange(csv, {})));
      static_cast<void>(
          write_kitti_trajectory(out / "trajectory_kitti.txt", std::exchange(trajectory, {})));
    };
    // What cannot be written now is written, or reported, at the end. The future keeps what its
    // thread does not let go; one that was put off would write what it has been moved from.
    try {
      writing_ = std::async(std::launch::async, std::move(write));
    } catch (const std::system_error&) {  // NOLINT: no thread is to be had
    }
  }

  /// The trajectories are the caller's.
  void finish_files() {
    if (writing_.valid()) {
      writing_.wait();
    }
    const std::filesystem::path& out = run_.request.out_dir;
    keep_first(drive_.written, write_text_file(out / "frames.csv", drive_.csv));
  }

  /// Frames in all are known now. An interrupt is the usual end of a live camera; a video that ends
  /// long before its container says is a warning.
  void end_stream(const StreamInfo& stream) {
    const std::size_t num_done = drive_.frames.size();
    if (stream.is_live) {
      drive_.interrupted = false;
    }
    if (drive_.interrupted) {
      return;
    }
    if (progress_) {
      (void)progress_(num_done, num_done);
    }
    constexpr double kMinShare = 0.9;  // containers without an index guess
    const std::size_t told = stream.expected_frames;
    if (static_cast<double>(num_done) < kMinShare * static_cast<double>(told)) {
      drive_.warnings.push_back(fmt::format(
          "{}: the video ends after {} frames where {} were expected: it may be cut off or damaged",
          run_.sequence.name(), num_done, told));
    }
  }

  const Run& run_;
  const RunProgress& progress_;
  Drive drive_;
  Clock::time_point last_files_ = Clock::now();
  std::future<void> writing_;
};

}  // namespace

Drive run_drive(const Run& run, const RunProgress& progress) {
  return DriveLoop(run, progress).drive();
}

}  // namespace stemvo::pipeline
