// SPDX-License-Identifier: MIT
#include "pipeline/drive_loop.hpp"

#include <algorithm>
#include <bit>
#include <new>
#include <utility>

#include <fmt/format.h>

#include "pipeline/frame_pipeline.hpp"
#include "pipeline/input_notes.hpp"
#include "report/frame_image.hpp"
#include "report/frames_csv.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {
namespace {

constexpr std::chrono::duration<double> kMaxPeriod(10.0);

/// Whether frame i is one of the few in report.html: evenly spaced among n, each twice as far as
/// the one before where n is not known (0).
bool is_in_report(std::size_t i, std::size_t n) {
  constexpr std::size_t kImages = 6;
  return n == 0 ? i >= kImages && std::has_single_bit(i) : (i + 1) * kImages / n > i * kImages / n;
}

}  // namespace

DriveLoop::DriveLoop(const RunRequest& request,
                     const FrameSource& sequence,
                     PhasedOdometry& odometry,
                     ResultKeeper& keeper,
                     const RunProgress& progress,
                     std::string identity)
    : request_(request),
      sequence_(sequence),
      odometry_(odometry),
      keeper_(keeper),
      progress_(progress),
      identity_(std::move(identity)) {}

Drive DriveLoop::run(std::optional<Checkpoint> from) {
  FrameRun frames;
  if (from) {
    odometry_.set_state(from->odometry);
    drive_ = std::move(from->drive);
    frames.tracked = from->frame;
  }
  frames.may_localize = [this](std::size_t i) { return may_localize(i); };
  frames.visit = [this](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
    return visit(i, frame, pose);
  };
  run_frames(sequence_, odometry_, frames);
  if (can_go_on() && !is_stopped_) {
    drive_.interrupted = false;  // it came with the last frame
  }
  if (sequence_.stream()) {
    end_stream(sequence_, progress_, drive_);
  }
  keep_first(drive_.written, keeper_.finish());
  return std::move(drive_);
}

bool DriveLoop::visit(std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
  const std::size_t number = sequence_.range().begin + i;
  if (!frame) {
    drive_.warnings.push_back(frame.error().message);
  }
  if (!pose.problem.empty()) {
    drive_.warnings.push_back(fmt::format("frame {}: {}", number, pose.problem));
  }
  drive_.trajectory.push_back(pose.world_from_camera);
  drive_.frames.push_back(pose);
  drive_.num_measured += is_measured(pose.state) ? 1 : 0;
  drive_.num_road_measured += pose.road == RoadState::kMeasured ? 1 : 0;
  const StageTimer timer(Stage::kFrameFiles);
  keeper_.add(frames_csv_row(number, sequence_.time_s(i), pose), pose.world_from_camera);
  keep_image(i, frame, pose);
  const std::size_t expected = expected_frames(sequence_, i + 1);
  drive_.interrupted = progress_ && !progress_(i + 1, expected) && i + 1 < sequence_.size();
  return !drive_.interrupted || can_go_on();
}

void DriveLoop::keep_image(std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
  const bool is_asked_for =
      request_.image_every > 0 && i % static_cast<std::size_t>(request_.image_every) == 0;
  const bool is_reported = is_in_report(i, expected_frames(sequence_, i + 1));
  if (!is_asked_for && !is_reported) {
    return;
  }
  const std::size_t number = sequence_.range().begin + i;
  const ChannelOdometry& seen = odometry_.frames();
  const cv::Mat image =
      draw_frame_image(frame.value_or(cv::Mat()), seen.image(), seen.matches(), seen.inlier_mask(),
                       fmt::format("frame {}: {}, {} of {} matches", number, to_string(pose.state),
                                   pose.num_inliers, pose.num_matches));
  if (is_asked_for) {
    const auto file = request_.out_dir / "pictures" / fmt::format("{:06}.png", number);
    keep_first(drive_.written, write_image(file, image));
  }
  if (is_reported) {
    constexpr int kReportWidth_px = 720;
    drive_.images.push_back({fmt::format("frame {}", number), encode_jpeg(image, kReportWidth_px)});
  }
}

bool DriveLoop::may_localize(std::size_t i) {
  const auto now = std::chrono::steady_clock::now();
  if (!drive_.written) {  // from the last checkpoint it is written again
    is_stopped_ = drive_.interrupted;
    return !is_stopped_;
  }
  if (!can_go_on() || i == 0 || (!drive_.interrupted && now - last_checkpoint_ < period_)) {
    return true;
  }
  keep_checkpoint(i, now);
  last_checkpoint_ = std::chrono::steady_clock::now();
  // Never more than a hundredth of the time.
  period_ = std::max(std::min(2.0 * period_, kMaxPeriod),
                     std::chrono::duration<double>(100 * (last_checkpoint_ - now)));
  is_stopped_ = drive_.interrupted;
  return !is_stopped_;
}

void DriveLoop::keep_checkpoint(std::size_t frame, std::chrono::steady_clock::time_point now) {
  try {
    Drive so_far = drive_;
    so_far.elapsed_before_s += std::chrono::duration<double>(now - request_.started).count();
    keeper_.keep_checkpoint(
        pack({frame, odometry_.state(), std::move(so_far), keeper_.csv()}, identity_));
  } catch (const std::bad_alloc&) {  // NOLINT: the one before stays; the drive needs no checkpoint
  }
}

}  // namespace stemvo::pipeline
