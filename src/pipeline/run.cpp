// SPDX-License-Identifier: MIT
#include "pipeline/run.hpp"

#include <bit>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "pipeline/frame_pipeline.hpp"
#include "pipeline/input_notes.hpp"
#include "pipeline/out_folder.hpp"
#include "pipeline/result_files.hpp"
#include "pipeline/result_keeper.hpp"
#include "pipeline/thread_scope.hpp"
#include "report/frame_image.hpp"
#include "report/frames_csv.hpp"
#include "text/spared_inputs.hpp"
#include "text/text_file.hpp"
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

/// The frame last done, its channel and tracks.
cv::Mat draw_frame(const PhasedOdometry& odometry,
                   const cv::Mat& frame,
                   std::size_t number,
                   const FrameResult& result) {
  const std::string caption =
      fmt::format("frame {}: {}, {} of {} matches", number, to_string(result.state),
                  result.num_inliers, result.num_matches);
  return draw_frame_image(frame, odometry.frames().image(), odometry.frames().matches(),
                          odometry.frames().inlier_mask(), caption);
}

/// Whether frame i is one of the few in report.html: evenly spaced among n, each twice as far as
/// the one before where n is not known (0).
bool is_in_report(std::size_t i, std::size_t n) {
  constexpr std::size_t kImages = 6;
  return n == 0 ? i >= kImages && std::has_single_bit(i) : (i + 1) * kImages / n > i * kImages / n;
}

pipeline::Drive drive(const RunRequest& request,
                      const FrameSource& sequence,
                      PhasedOdometry& odometry,
                      pipeline::ResultKeeper& keeper,
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
    result.frames.push_back(pose);
    result.num_measured += is_measured(pose.state) ? 1 : 0;
    result.num_road_measured += pose.road == RoadState::kMeasured ? 1 : 0;
    const StageTimer timer(Stage::kFrameFiles);
    keeper.add(frames_csv_row(number, sequence.time_s(i), pose), pose.world_from_camera);
    const std::size_t expected = pipeline::expected_frames(sequence, i + 1);
    const bool is_asked_for =
        request.image_every > 0 && i % static_cast<std::size_t>(request.image_every) == 0;
    if (is_asked_for || is_in_report(i, expected)) {
      const cv::Mat image = draw_frame(odometry, frame.value_or(cv::Mat()), number, pose);
      if (is_asked_for) {
        const auto file = request.out_dir / "pictures" / fmt::format("{:06}.png", number);
        pipeline::keep_first(result.written, write_image(file, image));
      }
      if (is_in_report(i, expected)) {
        constexpr int kReportWidth_px = 720;
        result.images.push_back(
            {fmt::format("frame {}", number), encode_jpeg(image, kReportWidth_px)});
      }
    }
    result.interrupted = progress && !progress(i + 1, expected) && i + 1 < sequence.size();
    return !result.interrupted;
  };
  pipeline::run_frames(sequence, odometry, visit);
  if (sequence.stream()) {
    pipeline::end_stream(sequence, progress, result);
  }
  pipeline::keep_first(result.written, keeper.finish());
  return result;
}

/// The folder and what an earlier run left in it, before work starts.
Expected<pipeline::FolderLock> prepare_out_folder(const RunRequest& request) {
  auto lock = pipeline::open_out_folder(request.out_dir);
  const Status status =
      lock && request.image_every > 0 ? pipeline::prepare_pictures(request.out_dir) : Status();
  return status ? std::move(lock) : status.error();
}

/// The configuration of an earlier run may be that of the next, in the same folder.
bool is_config_of_results(const std::filesystem::path& file) {
  const auto text = read_text_file(file);
  return text && text->starts_with("# stemvo ");
}

/// Results must not take the place of what they are made from.
Status check_inputs_are_spared(const RunRequest& request, const FrameSource& sequence) {
  std::vector<std::filesystem::path> results;
  for (const char* name :
       {"trajectory_kitti.txt", "trajectory_tum.txt", "trajectory_refined_kitti.txt", "report.html",
        "trajectory.png", "trajectory.svg", "frames.csv", "metrics.json", "config.yaml"}) {
    results.push_back(request.out_dir / name);
  }
  Config config = request.config;
  if (is_config_of_results(config.file)) {
    config.file.clear();
  }
  std::vector<std::filesystem::path> inputs = pipeline::input_files(sequence, config);
  if (request.image_every > 0) {
    results.push_back(request.out_dir / "pictures");
    if (!sequence.frames().files.empty()) {  // a live camera has none
      inputs.push_back(sequence.file(0).parent_path());
    }
  }
  if (request.times) {
    inputs.push_back(*request.times);
  }
  inputs.insert(inputs.end(), request.masks.begin(), request.masks.end());
  return check_spares_inputs(results, inputs);
}

Expected<RunSummary> run_source(const RunRequest& request,
                                const FrameSource& sequence,
                                const RunProgress& progress) {
  Expected<PhasedOdometry> odometry = pipeline::create_odometry(
      request.config, sequence.camera(), request.models_dir, sequence.frames().mask);
  if (!odometry) {
    return odometry.error();
  }
  const auto lock = check_inputs_are_spared(request, sequence).and_then([&] {
    return prepare_out_folder(request);
  });
  if (!lock) {
    return lock.error();
  }
  pipeline::ResultKeeper keeper(request.out_dir, [&](Trajectory so_far) {
    return pipeline::as_written(request, sequence, std::move(so_far));
  });
  if (const Status status = keeper.start(); !status) {
    return status.error();
  }

  std::optional<StageRecorder> recorder;
  if (request.measure_times) {
    recorder.emplace();
  }
  pipeline::note_input(request, sequence);
  pipeline::Drive done = drive(request, sequence, *odometry, keeper, progress);
  if (done.trajectory.empty()) {
    return fail(fmt::format("{}: expected at least one frame that can be decoded, found none",
                            request.sequence_dir.string()));
  }
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
  pipeline::keep_first(written,
                       pipeline::write_report_page(request, sequence, *odometry, done, report));
  return RunSummary{report, request.out_dir, std::move(done.warnings), done.interrupted,
                    std::move(written)};
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
  if (request.out_dir.empty()) {
    effective.out_dir = std::filesystem::path("results") / sequence->name();
  }
  return run_source(effective, *sequence, progress);
}

}  // namespace stemvo
