// SPDX-License-Identifier: MIT
#include "pipeline/run.hpp"

#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "pipeline/checkpoint.hpp"
#include "pipeline/drive_loop.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "pipeline/input_hashes.hpp"
#include "pipeline/input_notes.hpp"
#include "pipeline/out_folder.hpp"
#include "pipeline/result_files.hpp"
#include "pipeline/result_keeper.hpp"
#include "pipeline/thread_scope.hpp"
#include "stem/model_file.hpp"
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

/// Which file it is, and which version of it.
std::string version_of(const std::filesystem::path& file) {
  std::error_code code;
  const auto size = std::filesystem::file_size(file, code);
  const auto time = std::filesystem::last_write_time(file, code).time_since_epoch().count();
  return code ? file.string() + " is not there"
              : fmt::format("{} {} {}", std::filesystem::weakly_canonical(file, code).string(),
                            size, time);
}

/// What the results depend on: a checkpoint of anything else is not gone on from.
Expected<std::string> identity_of(const RunRequest& request,
                                  const FrameSource& sequence,
                                  const PhasedOdometry& odometry) {
  const auto program = pipeline::hash_program();
  if (!program) {
    return program.error();
  }
  std::string files;
  for (const std::filesystem::path& file : pipeline::input_files(sequence, request.config)) {
    files += version_of(file) + '\n';
  }
  for (const auto& file : {request.times, request.camera_file}) {
    files += file ? version_of(*file) + '\n' : "";
  }
  for (const std::string& mask : request.masks) {
    files += mask + ' ' + version_of(mask) + '\n';
  }
  const Camera& c = sequence.camera();
  return fmt::format("{}\n{}\n{} {} frames, pictures {}\n{} {} {} {} {}x{}\n{}\n{}", *program,
                     cv::getCPUFeaturesLine(), sequence.kind(), sequence.size(),
                     request.image_every, c.fx_px, c.fy_px, c.cx_px, c.cy_px, c.width_px,
                     c.height_px, pipeline::config_text(request, sequence, odometry, 0),
                     internal::sha256_hex(files));
}

/// What is written when all frames are done: beside the frames of a run that was killed before, an
/// earlier run's would pass for its own. Links stay.
Status remove_earlier_results(const std::filesystem::path& out_dir) {
  for (const char* name : {"metrics.json", "report.html", "trajectory.png", "trajectory_tum.txt",
                           "trajectory_refined_kitti.txt", "map.ply"}) {
    std::error_code code;
    if (is_regular_file(symlink_status(out_dir / name, code))) {
      if (Status status = remove_file(out_dir / name); !status) {
        return status;
      }
    }
  }
  return {};
}

/// What an earlier run left in the folder is removed, unless this one goes on from it.
Expected<std::optional<pipeline::Checkpoint>> prepare_out_folder(const RunRequest& request,
                                                                 const std::string& identity) {
  std::optional<pipeline::Checkpoint> checkpoint;
  if (request.resume) {
    auto found = pipeline::read_checkpoint(request.out_dir, identity);
    if (!found) {
      return found.error();
    }
    checkpoint = *std::move(found);
  }
  Status status;
  if (request.image_every > 0) {
    status = checkpoint ? pipeline::create_out_folder(request.out_dir / "pictures")
                        : pipeline::prepare_pictures(request.out_dir);
  }
  if (status && !checkpoint) {
    status = pipeline::remove_checkpoint(request.out_dir);
  }
  if (status) {
    status = remove_earlier_results(request.out_dir);
  }
  if (!status) {
    return status.error();
  }
  return checkpoint;
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
        "trajectory.png", "frames.csv", "metrics.json", "config.yaml", "checkpoint"}) {
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
    return pipeline::open_out_folder(request.out_dir);
  });
  const auto identity = identity_of(request, sequence, *odometry);
  if (!lock || !identity) {
    return lock ? identity.error() : lock.error();
  }
  auto checkpoint = prepare_out_folder(request, *identity);
  if (!checkpoint) {
    return checkpoint.error();
  }
  pipeline::ResultKeeper keeper(request.out_dir, [&](Trajectory so_far) {
    return pipeline::as_written(request, sequence, std::move(so_far));
  });
  if (*checkpoint) {
    keeper.go_on((*checkpoint)->csv, (*checkpoint)->drive.trajectory);
  }
  if (const Status status = keeper.start(); !status) {
    return status.error();
  }

  std::optional<StageRecorder> recorder;
  if (request.measure_times) {
    recorder.emplace();
  }
  pipeline::note_input(request, sequence);
  if (request.resume && request.note) {
    request.note(
        *checkpoint
            ? fmt::format("goes on at frame {}", sequence.range().begin + (*checkpoint)->frame)
            : "starts at the first frame: no checkpoint in " + request.out_dir.string());
  }
  pipeline::Drive done =
      pipeline::DriveLoop(request, sequence, *odometry, keeper, progress, *identity)
          .run(*std::move(checkpoint));
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
  if (!done.interrupted && written) {
    written = pipeline::remove_checkpoint(request.out_dir);
  }
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
  if (request.resume && sequence->stream() && sequence->stream()->is_live) {
    return fail("--resume: expected a recording, found a live camera");
  }
  RunRequest effective = request;
  effective.config = with_camera_height(request.config, *sequence);
  if (request.out_dir.empty()) {
    effective.out_dir = std::filesystem::path("results") / sequence->name();
  }
  return run_source(effective, *sequence, progress);
}

}  // namespace stemvo
