// SPDX-License-Identifier: MIT
#include "pipeline/run.hpp"

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "evaluation/metrics.hpp"
#include "evaluation/trajectory.hpp"
#include "internal_check.hpp"
#include "options/option_fields.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "pipeline/out_folder.hpp"
#include "pipeline/result_files.hpp"
#include "pipeline/thread_scope.hpp"
#include "report/frame_image.hpp"
#include "report/frames_csv.hpp"
#include "stemvo/version.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

/// The first thing that went wrong while writing; the rest is written all the same.
void keep_first(Status& first, Status next) {
  if (first && !next) {
    first = std::move(next);
  }
}

/// What the loop over the frames leaves behind.
struct Drive {
  Trajectory trajectory;              ///< one pose per frame done
  std::optional<Trajectory> refined;  ///< the same with look-ahead; mode map only
  std::size_t num_measured = 0;
  std::size_t num_road_measured = 0;
  std::vector<std::string> warnings;
  bool interrupted = false;
  Status written;  ///< of frames.csv and the pictures
};

/// A folder of pictures is no car of KITTI's: what its camera file does not say is not known.
Config with_camera_height(Config config, const RunRequest& request, const FrameSource& source) {
  const bool is_default =
      config.scale.source == ScaleSource::kCameraHeight && !request.chosen.source;
  if (request.camera_file && !source.camera_height_m() && is_default) {
    config.scale.source = ScaleSource::kNone;
  }
  if (source.camera_height_m() && !request.chosen.camera_height) {
    config.scale.camera_height_m = *source.camera_height_m();
  }
  return config;
}

Expected<std::unique_ptr<const FrameSource>> open_sequence(const RunRequest& request) {
  auto sequence =
      open_source({request.sequence_dir, request.config.input.camera, request.frames,
                   request.ground_truth, request.calibration, request.camera_file, request.times});
  if (sequence && request.config.scale.source == ScaleSource::kGroundTruth &&
      !(*sequence)->ground_truth()) {
    const auto file = request.camera_file
                          ? request.sequence_dir
                          : request.sequence_dir / "../../poses" / ((*sequence)->name() + ".txt");
    return fail(fmt::format(
        "{}: expected a pose file, which scale.source=ground_truth needs, found none (see --gt)",
        file.lexically_normal().string()));
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
  const cv::Mat picture =
      draw_frame_image(frame, odometry.frames().image(), odometry.frames().matches(),
                       odometry.frames().inlier_mask(), caption);
  return write_image(request.out_dir / "pictures" / fmt::format("{:06}.png", number), picture);
}

Drive drive(const RunRequest& request,
            const FrameSource& sequence,
            PhasedOdometry& odometry,
            FramesCsv& csv,
            const RunProgress& progress) {
  Drive result;
  const auto visit = [&](std::size_t i, const Expected<cv::Mat>& frame, const FrameResult& pose) {
    const std::size_t number = sequence.range().begin + i;
    if (!frame) {
      result.warnings.push_back(frame.error().message);
    }
    if (!pose.problem.empty()) {
      result.warnings.push_back(fmt::format("frame {}: {}", number, pose.problem));
    }
    result.trajectory.push_back(pose.world_from_camera);
    result.num_measured += is_measured(pose.state) ? 1 : 0;
    result.num_road_measured += pose.road == RoadState::kMeasured ? 1 : 0;
    const StageTimer timer(Stage::kFrameFiles);
    csv.write(number, sequence.timestamps_s()[i], pose);
    if (request.picture_every > 0 && i % static_cast<std::size_t>(request.picture_every) == 0) {
      keep_first(result.written,
                 write_frame_image(request, odometry, frame.value_or(cv::Mat()), number, pose));
    }
    result.interrupted = progress && !progress(i + 1, sequence.size()) && i + 1 < sequence.size();
    return !result.interrupted;
  };
  pipeline::run_frames(sequence, odometry, visit);
  keep_first(result.written, csv.close());
  return result;
}

/// The ground truth of the frames done; an interrupted run has fewer than the sequence.
std::optional<std::span<const Rigid3>> truth_of(const FrameSource& sequence,
                                                std::size_t num_frames) {
  if (!sequence.ground_truth()) {
    return std::nullopt;
  }
  return std::span(*sequence.ground_truth()).first(num_frames);
}

/// A trajectory without a scale has no error in metres until one is fitted.
Alignment alignment_of(const ScaleOptions& scale) {
  return scale.source == ScaleSource::kNone ? Alignment::kSim3 : Alignment::kNone;
}

Trajectory refined_trajectory(const RunRequest& request,
                              const FrameSource& sequence,
                              const PhasedOdometry& odometry) {
  Trajectory refined = odometry.frames().estimator().refined_trajectory();
  return request.config.scale.source == ScaleSource::kGroundTruth
             ? rescale_steps(refined, *truth_of(sequence, refined.size()))
             : refined;
}

MetricsReport make_report(const RunRequest& request,
                          const FrameSource& sequence,
                          const StemInfo& stem,
                          const Drive& done,
                          double seconds) {
  MetricsReport report;
  const std::size_t num_frames = done.trajectory.size();
  report.stemvo_version = version();
  report.sequence = sequence.name();
  report.first_frame = sequence.range().begin;
  report.num_frames = num_frames;
  report.model = request.config.stem.model;
  report.filter = stem.filter;
  report.fps = static_cast<double>(num_frames) / std::max(seconds, 1e-9);
  report.scale_source = options::to_string(request.config.scale.source);
  report.tracked_fraction =
      static_cast<double>(done.num_measured) / static_cast<double>(num_frames);
  if (request.config.scale.source == ScaleSource::kCameraHeight) {
    report.road_measured_fraction =
        static_cast<double>(done.num_road_measured) / static_cast<double>(num_frames);
  }
  if (const auto truth = truth_of(sequence, num_frames)) {
    const Alignment alignment = alignment_of(request.config.scale);
    report.metrics =
        evaluate_aligned(done.trajectory, *truth, alignment, request.config.evaluation);
    if (done.refined) {
      report.refined =
          evaluate_aligned(*done.refined, *truth, alignment, request.config.evaluation);
    }
  }
  return report;
}

/// All but metrics.json, for which it makes the report.
Status write_results(const RunRequest& request,
                     const FrameSource& sequence,
                     const PhasedOdometry& odometry,
                     Drive& done,
                     MetricsReport& report) {
  if (request.config.scale.source == ScaleSource::kGroundTruth) {
    done.trajectory = rescale_steps(done.trajectory, *truth_of(sequence, done.trajectory.size()));
  }
  Status written = pipeline::write_trajectories(request.out_dir, sequence, done.trajectory);
  if (request.config.odometry.mode == OdometryMode::kMap) {
    done.refined = refined_trajectory(request, sequence, odometry);
  }
  keep_first(written, pipeline::write_refined_trajectory(request.out_dir, done.refined));
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - request.started;

  report = make_report(request, sequence, odometry.stem_info(), done, elapsed.count());
  keep_first(written, done.written);
  keep_first(written, pipeline::write_config(request.out_dir, request.config, sequence,
                                             odometry.stem_info()));
  if (request.write_map) {
    keep_first(written, pipeline::write_point_map(
                            request.out_dir, odometry.frames().estimator().landmarks(),
                            odometry.frames().estimator().refined_trajectory(), *done.refined));
  }
  keep_first(written, pipeline::write_map(request.out_dir, sequence, done.trajectory, report));
  return written;
}

/// The folder and what an earlier run left in it, before work starts.
Status prepare_out_folder(const RunRequest& request) {
  if (request.picture_every == 0) {
    return pipeline::create_out_folder(request.out_dir);
  }
  const std::filesystem::path pictures = request.out_dir / "pictures";
  const Status status = pipeline::create_out_folder(pictures);
  return status ? pipeline::remove_old_frames(pictures, ".png") : status;
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
  Drive done = drive(request, sequence, *odometry, *csv, progress);
  MetricsReport report;
  Status written = timed(Stage::kResultFiles,
                         [&] { return write_results(request, sequence, *odometry, done, report); });
  if (recorder) {
    report.timing = recorder->report();
    report.timing->fps = report.fps;
    report.timing->num_threads = cv::getNumThreads();
  }
  keep_first(written, write_metrics_json(request.out_dir / "metrics.json", report));
  return RunSummary{report, odometry->stem_info(), std::move(done.warnings), done.interrupted,
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
  effective.config = with_camera_height(request.config, request, **sequence);
  return run_source(effective, **sequence, progress);
}

}  // namespace stemvo
