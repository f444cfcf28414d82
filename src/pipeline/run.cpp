// SPDX-License-Identifier: MIT
#include "pipeline/run.hpp"

#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "dataset/camera_height.hpp"
#include "pipeline/drive_loop.hpp"
#include "pipeline/earlier_run.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "pipeline/out_folder.hpp"
#include "pipeline/result_files.hpp"
#include "pipeline/thread_scope.hpp"
#include "report/frames_csv.hpp"
#include "text/text_file.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo {
namespace {

using pipeline::Run;

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

/// What an earlier run left in the folder is removed. Whenever this one is killed, all under final
/// names is of one run: config.yaml comes before frames and results.
Status prepare_out_folder(const Run& run) {
  const RunRequest& request = run.request;
  const std::filesystem::path& out = request.out_dir;
  Status status = request.image_every > 0 ? pipeline::check_pictures(out) : Status();
  status = status ? pipeline::remove_earlier_results(out) : status;
  if (status && request.image_every > 0) {
    status = pipeline::create_out_folder(out / "pictures");
  }
  if (status) {
    status = write_text_file(out / "config.yaml", pipeline::config_text(run, 0));
  }
  // From now on it can be seen how far the run is.
  return status ? write_text_file(out / "frames.csv", frames_csv_header()) : status;
}

/// Results must not take the place of what they are made from.
Expected<pipeline::FolderLock> open_folder(const RunRequest& request, const FrameSource& sequence) {
  std::vector<std::string> names = pipeline::run_files();
  auto inputs = pipeline::input_files(request, sequence, request.config, request.models_dir);
  // The configuration of an earlier run may be that of the next, in the same folder.
  const auto config = read_text_file(request.config.file);
  if (config && config->starts_with("# stemvo ")) {
    std::erase(inputs, request.config.file);
  }
  if (request.image_every > 0) {
    names.emplace_back("pictures");
    if (!sequence.frames().files.empty()) {  // a live camera has none
      inputs.push_back(sequence.file(0).parent_path());
    }
  }
  return pipeline::open_out_folder(request.out_dir, names, inputs);
}

std::string describe_truth(const RunRequest& request, const FrameSource& sequence) {
  if (!sequence.has_ground_truth()) {
    return "no ground truth";
  }
  if (sequence.stream()) {
    return "ground truth to be matched";
  }
  const auto& frames = sequence.frames().ground_truth_frames;
  return "ground truth" + (frames
                               ? pipeline::count_matched(request, frames->size(), sequence.size())
                               : std::string());
}

std::string describe_size(const FrameSource& sequence) {
  const Camera& camera = sequence.camera();
  const std::string count =
      sequence.stream() ? "frames" : fmt::format("{} frames", sequence.size());
  const cv::Size full = sequence.frames().full_size;
  const std::string worked_on =
      full == cv::Size(camera.width_px, camera.height_px)
          ? ""
          : fmt::format(" worked on at {}x{}", camera.width_px, camera.height_px);
  return fmt::format("{} of {}x{} pixels{}", count, full.width, full.height, worked_on);
}

/// What the input was taken for, and what is lost.
void note_start(const Run& run, bool has_earlier) {
  const auto& [request, sequence, odometry] = run;
  if (!request.note) {
    return;
  }
  request.note(fmt::format("input: {} {}, {}, {}", sequence.kind(), sequence.name(),
                           describe_size(sequence), describe_truth(request, sequence)));
  if (has_earlier) {
    request.note(
        fmt::format("results of an earlier run in {} are replaced (another --out keeps them)",
                    request.out_dir.string()));
  }
}

Expected<RunSummary> finish_run(const Run& run, const RunProgress& progress) {
  const RunRequest& request = run.request;
  pipeline::Drive done = pipeline::run_drive(run, progress);
  if (done.frames.empty()) {
    return fail(fmt::format("{}: expected at least one frame that can be decoded, found none",
                            request.sequence_dir.string()));
  }
  MetricsReport report;
  Status written = pipeline::write_results(run, done, report);
  return RunSummary{report, request.out_dir, std::move(done.warnings), done.interrupted,
                    std::move(written)};
}

Expected<RunSummary> run_source(const RunRequest& request,
                                const FrameSource& sequence,
                                const RunProgress& progress) {
  Expected<PhasedOdometry> odometry = pipeline::create_odometry(
      request.config, sequence.camera(), request.models_dir, sequence.frames().mask);
  if (!odometry) {
    return odometry.error();
  }
  const Run run{request, sequence, *odometry};
  const auto lock = open_folder(request, sequence);
  if (!lock) {
    return lock.error();
  }
  const bool has_earlier = pipeline::has_earlier_run(request.out_dir);
  if (const Status status = prepare_out_folder(run); !status) {
    return status.error();
  }
  std::optional<StageRecorder> recorder;
  if (request.measure_times) {
    recorder.emplace();
  }
  note_start(run, has_earlier);
  return finish_run(run, progress);
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
  effective.config = dataset::with_camera_height(request.config, sequence->frames());
  if (request.out_dir.empty()) {
    effective.out_dir = std::filesystem::path("results") / sequence->name();
  }
  return run_source(effective, *sequence, progress);
}

}  // namespace stemvo
