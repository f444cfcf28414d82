// SPDX-License-Identifier: MIT
#include "pipeline/run.hpp"

#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "pipeline/frame_pipeline.hpp"
#include "pipeline/input_notes.hpp"
#include "pipeline/out_folder.hpp"
#include "pipeline/result_files.hpp"
#include "pipeline/thread_scope.hpp"
#include "report/frame_image.hpp"
#include "report/frames_csv.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// Another camera is not on KITTI's car: what its camera file does not say is not known.
Config with_camera_height(Config config, const FrameSource& source) {
  constexpr const char* kSource = "scale.source";
  const bool is_chosen = config.scale.source != ScaleSource::kCameraHeight ||
                         config.keys_in_file.contains(kSource) ||
                         config.keys_overridden.contains(kSource);
  if (!source.is_kitti() && !source.camera_height_m() && !is_chosen) {
    config.scale.source = ScaleSource::kNone;
  }
  // A file's height is some camera's, often the default; that of the camera file is this one's.
  if (source.camera_height_m() && !config.keys_overridden.contains("scale.camera_height_m")) {
    config.scale.camera_height_m = *source.camera_height_m();
  }
  return config;
}

Expected<FrameSource> open_sequence(const RunRequest& request) {
  FrameSourceRequest source = request;
  source.camera = request.config.input.camera;
  auto sequence = open_source(source);
  if (!sequence || request.config.scale.source != ScaleSource::kGroundTruth) {
    return sequence;
  }
  if (!sequence->has_ground_truth()) {
    const auto file = sequence->is_kitti()
                          ? request.sequence_dir / "../../poses" / (sequence->name() + ".txt")
                          : request.sequence_dir;
    return fail(fmt::format(
        "{}: expected a pose file, which scale.source=ground_truth needs, found none (see --gt)",
        file.lexically_normal().string()));
  }
  if (sequence->stream() || sequence->frames().ground_truth_frames) {
    return fail(fmt::format(
        "{}: expected a true pose of every frame, which scale.source=ground_truth needs, found {}",
        sequence->ground_truth_file()->string(),
        sequence->stream() ? "a stream, whose times are not known before" : "some only"));
  }
  return sequence;
}

Status write_frame_image(const RunRequest& request,
                         const PhasedOdometry& odometry,
                         const cv::Mat& frame,
                         std::size_t number,
                         const FrameResult& result) {
  const std::string caption =
      fmt::format("frame {}: {}, {} of {} matches", number, to_string(result.state),
                  result.num_inliers, result.num_matches);
  const cv::Mat image =
      draw_frame_image(frame, odometry.frames().image(), odometry.frames().matches(),
                       odometry.frames().inlier_mask(), caption);
  return write_image(request.out_dir / "pictures" / fmt::format("{:06}.png", number), image);
}

pipeline::Drive drive(const RunRequest& request,
                      const FrameSource& sequence,
                      PhasedOdometry& odometry,
                      FramesCsv& csv,
                      const RunProgress& progress) {
  pipeline::Drive result;
  const auto visit = [&](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
    const std::size_t number = sequence.range().begin + i;
    if (!frame) {
      result.warnings.push_back(frame.error().message);
    }
    if (!pose.problem.empty()) {
      result.warnings.push_back(fmt::format("frame {}: {}", number, pose.problem));
    }
    result.trajectory.push_back(pose.world_from_camera);
    result.last = pose;
    result.num_measured += is_measured(pose.state) ? 1 : 0;
    result.num_road_measured += pose.road == RoadState::kMeasured ? 1 : 0;
    const StageTimer timer(Stage::kFrameFiles);
    csv.write(number, sequence.time_s(i), pose);
    if (request.image_every > 0 && i % static_cast<std::size_t>(request.image_every) == 0) {
      pipeline::keep_first(
          result.written,
          write_frame_image(request, odometry, frame.value_or(cv::Mat()), number, pose));
    }
    result.interrupted = progress && !progress(i + 1, pipeline::expected_frames(sequence, i + 1)) &&
                         i + 1 < sequence.size();
    return !result.interrupted;
  };
  pipeline::run_frames(sequence, odometry, visit);
  if (sequence.stream()) {
    pipeline::end_stream(sequence, progress, result);
  }
  pipeline::keep_first(result.written, csv.close());
  return result;
}

/// The folder and what an earlier run left in it, before work starts.
Status prepare_out_folder(const RunRequest& request) {
  if (request.image_every == 0) {
    return pipeline::create_out_folder(request.out_dir);
  }
  const std::filesystem::path images = request.out_dir / "pictures";
  const Status status = pipeline::create_out_folder(images);
  return status ? pipeline::remove_old_frames(images, ".png") : status;
}

Expected<RunSummary> run_source(const RunRequest& request,
                                const FrameSource& sequence,
                                const RunProgress& progress) {
  Expected<PhasedOdometry> odometry =
      pipeline::create_odometry(request.config, sequence.camera(), request.models_dir);
  if (!odometry) {
    return odometry.error();
  }
  if (const Status status = prepare_out_folder(request); !status) {
    return status.error();
  }
  Expected<FramesCsv> csv = FramesCsv::create(request.out_dir / "frames.csv");
  if (!csv) {
    return csv.error();
  }

  std::optional<StageRecorder> recorder;
  if (request.measure_times) {
    recorder.emplace();
  }
  pipeline::note_input(request, sequence);
  pipeline::Drive done = drive(request, sequence, *odometry, *csv, progress);
  MetricsReport report;
  Status written = timed(Stage::kResultFiles, [&] {
    return pipeline::write_results(request, sequence, *odometry, done, report);
  });
  if (recorder) {
    report.timing = recorder->report();
    report.timing->fps = report.fps;
    report.timing->num_threads = cv::getNumThreads();
  }
  pipeline::keep_first(written, write_metrics_json(request.out_dir / "metrics.json", report));
  return RunSummary{report, std::move(done.warnings), done.interrupted, std::move(written)};
}

}  // namespace

Expected<RunSummary> run_sequence(const RunRequest& request, const RunProgress& progress) {
  if (const Status status = validate(request.config); !status) {
    return status.error();
  }
  if (request.write_map && request.config.odometry.mode != OdometryMode::kMap) {
    return fail("--map: expected odometry.mode map, which makes one, found two_frame");
  }
  const pipeline::ThreadScope threads(request.num_threads);
  const auto sequence = open_sequence(request);
  if (!sequence) {
    return sequence.error();
  }
  RunRequest effective = request;
  effective.config = with_camera_height(request.config, *sequence);
  return run_source(effective, *sequence, progress);
}

}  // namespace stemvo
