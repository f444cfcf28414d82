// SPDX-License-Identifier: MIT
#include <algorithm>
#include <bit>
#include <cerrno>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "evaluation/trajectory.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "pipeline/result_files.hpp"
#include "report/data_files.hpp"
#include "report/frame_image.hpp"
#include "timing/stage_timer.hpp"
#include "try.hpp"

namespace stemvo::pipeline {
namespace {

struct GrowingFile {
  std::filesystem::path path;
  std::ofstream stream = std::ofstream(path, std::ios::binary);
};

/// Whether frame i is one of the few in report.html: evenly spaced among n, each twice as far as
/// the one before where n is not known (0).
bool is_in_report(std::size_t i, std::size_t n) {
  constexpr std::size_t kImages = 6;
  return n == 0 ? i >= kImages && std::has_single_bit(i) : (i + 1) * kImages / n > i * kImages / n;
}

/// Frames in all, of a stream as its container says; 0: not known, or said wrongly.
std::size_t expected_frames(const FrameSource& sequence, std::size_t num_done) {
  if (!sequence.stream) {
    return sequence.size();
  }
  const std::size_t told = sequence.stream->expected_frames;
  return told > num_done ? told : 0;  // a last frame is known by what comes behind it
}

class DriveLoop {
 public:
  DriveLoop(const Run& run, const RunProgress& progress) : run_(run), progress_(progress) {
    drive_.csv = kFramesCsvHeader;
    append(rows_, drive_.csv);
  }

  Drive drive() {
    run_frames(
        run_.sequence, run_.odometry,
        [this](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
          return visit(i, frame, pose);
        },
        run_.beside);
    if (run_.sequence.stream) {
      end_stream(*run_.sequence.stream);
    }
    keep_first(drive_.written, run_.video.finish());
    return std::move(drive_);
  }

 private:
  /// With every frame: a run that is killed leaves whole rows.
  void append(GrowingFile& file, std::string_view rows) {
    file.stream << rows << std::flush;
    if (!file.stream) {
      keep_first(drive_.written, fail(fmt::format("{}: cannot write: {}", file.path.string(),
                                                  std::generic_category().message(errno))));
    }
  }

  /// False: the run ends behind this frame.
  bool visit(std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
    const std::size_t number = run_.sequence.range.begin + i;
    if (!frame) {
      drive_.warnings.push_back(frame.error().message);
    }
    if (!pose.problem.empty()) {
      drive_.warnings.push_back(fmt::format("frame {}: {}", number, pose.problem));
    }
    drive_.frames.push_back(pose);
    const StageTimer timer(Stage::kFrameFiles);
    const double time_s = run_.sequence.time_s(i);
    const Rigid3& written = drive_.trajectory.emplace_back(as_written(i, pose.world_from_camera));
    const std::string row = frames_csv_row(number, time_s, pose, written);
    drive_.csv += row;
    append(rows_, row);
    if (run_.request.on_frame) {
      run_.request.on_frame(number, pose, written);
    }
    append(kitti_, kitti_row(written));
    append(tum_, tum_row(time_s, written));
    keep_image(i, frame, pose);
    const std::size_t expected = expected_frames(run_.sequence, i + 1);
    drive_.interrupted = progress_ && !progress_(i + 1, expected) && i + 1 < run_.sequence.size();
    return !drive_.interrupted;
  }

  /// The last pose as result files hold it: with scale.source=ground_truth its step has the true
  /// length.
  [[nodiscard]] Rigid3 as_written(std::size_t i, Rigid3 pose) const {
    if (i > 0 && run_.request.config.scale_choice == ScaleChoice::kGroundTruth) {
      const Trajectory& estimate = run_.odometry.frames().estimator().trajectory();
      pose.translation = drive_.trajectory.back().translation +
                         rescaled_step(estimate, run_.sequence.ground_truth->poses, i);
    }
    return pose;
  }

  void keep_image(std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
    const RunRequest& request = run_.request;
    const std::size_t number = run_.sequence.range.begin + i;
    drive_.small_frames.add(i, number, frame.value_or(cv::Mat()));
    const bool is_asked_for =
        request.image_every > 0 && i % static_cast<std::size_t>(request.image_every) == 0;
    const bool is_reported = is_in_report(i, expected_frames(run_.sequence, i + 1));
    if (!is_asked_for && !is_reported && !run_.video.is_on()) {
      return;
    }
    const ChannelOdometry& seen = run_.odometry.frames();
    const std::string caption =
        fmt::format("frame {}: {}, {} of {} matches", number, to_string(pose.state),
                    pose.num_inliers, pose.num_matches);
    const std::string colors = describe_flow(seen.matches(), seen.inlier_mask());
    if (run_.video.is_on()) {
      const Camera& camera = run_.sequence.camera;
      const cv::Mat plain =
          frame.value_or(cv::Mat(camera.height_px, camera.width_px, CV_8UC1, cv::Scalar(60)));
      const cv::Mat drawn =
          draw_frame_image(plain, {{}, seen.image().map}, seen.matches(), seen.inlier_mask());
      has_scale_ = has_scale_ || pose.scale_state >= ScaleState::kHeld ||
                   request.config.scale_choice == ScaleChoice::kGroundTruth;
      run_.video.add(draw_under_caption(drawn, caption, colors), drive_.trajectory,
                     has_scale_ ? "m" : "units");
    }
    if (!is_asked_for && !is_reported) {
      return;
    }
    const cv::Mat image = draw_frame_image(frame.value_or(cv::Mat()), seen.image(), seen.matches(),
                                           seen.inlier_mask());
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
          "{}: the video ends after {} frames where its container counts {}: it was trimmed, or "
          "may be cut off",
          run_.sequence.name, num_done, told));
    }
  }

  const Run& run_;
  const RunProgress& progress_;
  Drive drive_;
  GrowingFile rows_{run_.request.out_dir / "frames.csv"};
  GrowingFile kitti_{run_.request.out_dir / "trajectory_kitti.txt"};
  GrowingFile tum_{run_.request.out_dir / "trajectory_tum.txt"};
  bool has_scale_ = false;  ///< lengths of the path are metres
};

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

Drive run_drive(const Run& run, const RunProgress& progress) {
  return DriveLoop(run, progress).drive();
}

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
