// SPDX-License-Identifier: MIT
#include "pipeline/run.hpp"

#include <exception>
#include <optional>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utility.hpp>

#include "dataset/camera_height.hpp"
#include "pipeline/checkpoint.hpp"
#include "pipeline/drive_loop.hpp"
#include "pipeline/earlier_run.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "pipeline/input_hashes.hpp"
#include "pipeline/out_folder.hpp"
#include "pipeline/result_files.hpp"
#include "pipeline/thread_scope.hpp"
#include "report/frames_csv.hpp"
#include "stem/model_file.hpp"
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
Expected<std::string> identity_of(const Run& run) {
  const auto program = pipeline::hash_program();
  if (!program) {
    return program.error();
  }
  std::string files;
  const RunRequest& request = run.request;
  for (const std::filesystem::path& file :
       pipeline::input_files(request, run.sequence, request.config, request.models_dir)) {
    files += version_of(file) + '\n';
  }
  const Camera& c = run.sequence.camera();
  return fmt::format("{}\n{}\n{} {} frames, pictures {}\n{} {} {} {} {}x{}\n{}\n{}", *program,
                     cv::getCPUFeaturesLine(), run.sequence.kind(), run.sequence.size(),
                     run.request.image_every, c.fx_px, c.fy_px, c.cx_px, c.cy_px, c.width_px,
                     c.height_px, pipeline::config_text(run, 0), internal::sha256_hex(files));
}

/// What an earlier run left in the folder is removed, unless this one goes on from it. Whenever it
/// is killed, all under final names is of one run: config.yaml comes before frames and results.
Expected<std::optional<pipeline::Checkpoint>> prepare_out_folder(const Run& run,
                                                                 const std::string& identity) {
  const RunRequest& request = run.request;
  const std::filesystem::path& out = request.out_dir;
  const auto file = pipeline::checkpoint_file(out);
  auto checkpoint = request.resume ? pipeline::read_checkpoint(file, identity, run.sequence.size())
                                   : std::optional<pipeline::Checkpoint>();
  if (!checkpoint) {
    return checkpoint;
  }
  if (*checkpoint &&
      (!run.odometry.set_state((*checkpoint)->odometry) ||
       run.odometry.frames().estimator().trajectory().size() != (*checkpoint)->frame)) {
    return pipeline::damaged_checkpoint(file);
  }
  Status status;
  if (!*checkpoint) {
    status = request.image_every > 0 ? pipeline::check_pictures(out) : Status();
    status = status ? remove_file(file) : status;
    status = status ? pipeline::remove_earlier_results(out) : status;
  }
  if (status && request.image_every > 0) {
    status = pipeline::create_out_folder(out / "pictures");
  }
  if (status) {
    status = write_text_file(out / "config.yaml", pipeline::config_text(run, 0));
  }
  if (status) {  // from now on it can be seen how far the run is
    status = write_text_file(out / "frames.csv",
                             *checkpoint ? (*checkpoint)->drive.csv : frames_csv_header());
  }
  return status ? std::move(checkpoint) : status.error();
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

/// What the input was taken for, where a run that may go on begins, and what is lost.
void note_start(const Run& run,
                const std::optional<pipeline::Checkpoint>& checkpoint,
                bool has_earlier) {
  const auto& [request, sequence, odometry] = run;
  if (!request.note) {
    return;
  }
  request.note(fmt::format("input: {} {}, {}, {}", sequence.kind(), sequence.name(),
                           describe_size(sequence), describe_truth(request, sequence)));
  if (request.resume) {
    request.note(
        checkpoint ? fmt::format("goes on at frame {}", sequence.range().begin + checkpoint->frame)
                   : "starts at the first frame: no checkpoint in " + request.out_dir.string());
  }
  if (has_earlier && !checkpoint) {
    request.note(
        fmt::format("results of an earlier run in {} are replaced (another --out keeps them)",
                    request.out_dir.string()));
  }
}

Expected<RunSummary> finish_run(const Run& run,
                                const std::string& identity,
                                std::optional<pipeline::Checkpoint> from,
                                const RunProgress& progress) {
  const RunRequest& request = run.request;
  pipeline::Drive done = pipeline::run_drive(run, identity, std::move(from), progress);
  if (done.frames.empty()) {
    return fail(fmt::format("{}: expected at least one frame that can be decoded, found none",
                            request.sequence_dir.string()));
  }
  MetricsReport report;
  Status written = pipeline::write_results(run, done, report);
  if (!done.interrupted && written) {
    written = remove_file(pipeline::checkpoint_file(request.out_dir));
  }
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
  const auto identity = identity_of(run);
  if (!lock || !identity) {
    return lock ? identity.error() : lock.error();
  }
  const bool has_earlier = pipeline::has_earlier_run(request.out_dir);
  auto checkpoint = prepare_out_folder(run, *identity);
  if (!checkpoint) {
    return checkpoint.error();
  }
  std::optional<StageRecorder> recorder;
  if (request.measure_times) {
    recorder.emplace();
  }
  note_start(run, *checkpoint, has_earlier);
  if (!*checkpoint) {
    return finish_run(run, *identity, std::nullopt, progress);
  }
  // Whatever the checks of a forged state did not see ends as they do.
  const auto damaged = [&](const std::exception& error) {
    return pipeline::damaged_checkpoint(pipeline::checkpoint_file(request.out_dir), error.what());
  };
  try {
    return finish_run(run, *identity, *std::move(checkpoint), progress);
  } catch (const std::logic_error& error) {
    return damaged(error);
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) {
      throw;
    }
    return damaged(error);
  }
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
  effective.config = dataset::with_camera_height(request.config, sequence->frames());
  if (request.out_dir.empty()) {
    effective.out_dir = std::filesystem::path("results") / sequence->name();
  }
  return run_source(effective, *sequence, progress);
}

}  // namespace stemvo
