// SPDX-License-Identifier: MIT
#include "pipeline/run.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "mapping/map_file.hpp"
#include "pipeline/frame_pipeline.hpp"
#include "pipeline/out_folder.hpp"
#include "pipeline/result_files.hpp"
#include "report/frame_image.hpp"
#include "stem/stem.hpp"
#include "text/text_file.hpp"
#include "timing/stage_timer.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

using pipeline::Run;

Expected<FrameSource> open_sequence(const RunRequest& request) {
  FrameSourceRequest source = request;
  source.camera = request.config.input.camera;
  auto sequence = open_source(source);
  if (sequence && request.config.scale_choice == ScaleChoice::kGroundTruth &&
      !(sequence->ground_truth && sequence->ground_truth->frames.size() == sequence->size())) {
    return fail(fmt::format(
        "{}: expected a true pose of every frame (see --gt), which scale.source=ground_truth "
        "needs, found {}",
        request.sequence_dir.string(),
        sequence->stream         ? "a stream, whose times are not known before"
        : sequence->ground_truth ? "some only"
                                 : "none"));
  }
  return sequence;
}

/// Removes an earlier run's results, so that every file under its final name belongs to this run
/// whenever it is killed: config.yaml comes before frames and results.
Status prepare_out_folder(const Run& run) {
  const std::filesystem::path& out = run.request.out_dir;
  Status status;
  for (const char* name : pipeline::kResultNames) {
    status = status ? remove_file(out / name) : status;
  }
  std::error_code code;
  std::filesystem::remove_all(out / "pictures", code);
  if (status && run.request.image_every > 0) {
    status = pipeline::create_out_folder(out / "pictures");
  }
  return status ? write_text_file(out / "config.yaml", pipeline::config_text(run, 0)) : status;
}

std::string describe_truth(const RunRequest& request, const FrameSource& sequence) {
  if (!sequence.ground_truth) {
    return sequence.match ? "ground truth to be matched" : "no ground truth";
  }
  const std::size_t count = sequence.ground_truth->frames.size();
  return count == sequence.size()
             ? "ground truth"
             : "ground truth" + pipeline::count_matched(request, count, sequence.size());
}

std::string describe_size(const FrameSource& sequence) {
  const Camera& camera = sequence.camera;
  const std::string count = sequence.stream ? "frames" : fmt::format("{} frames", sequence.size());
  const cv::Size full = sequence.full_size;
  const std::string worked_on =
      full == cv::Size(camera.width_px, camera.height_px)
          ? ""
          : fmt::format(" worked on at {}x{}", camera.width_px, camera.height_px);
  return fmt::format("{} of {}x{} pixels{}", count, full.width, full.height, worked_on);
}

void note_start(const Run& run, bool is_replacing) {
  const auto& [request, sequence, odometry, beside, video] = run;
  if (!request.note) {
    return;
  }
  request.note(fmt::format("input: {} {}, {}, {}{}", sequence.kind, sequence.name,
                           describe_size(sequence), describe_truth(request, sequence),
                           beside.note));
  for (const std::vector<std::string>& notes : {sequence.notes, beside.unit_notes}) {
    std::ranges::for_each(notes, request.note);
  }
  if (is_replacing) {
    request.note(
        fmt::format("files of an earlier result in {} are replaced (another --out keeps them)",
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
  const auto odd = run.sequence.warnings_so_far();
  done.warnings.insert(done.warnings.begin(), odd.begin(), odd.end());
  MetricsReport report;
  Status written = pipeline::write_results(run, done, report);
  add_line(done.warnings, warn_of_scale(report));
  add_line(done.warnings, warn_of_gaps(report));
  if (report.map && report.map->is_apart) {
    done.warnings.push_back(request.map->string() +
                            ": no place of it was seen; trajectory_map_*.txt and map.ply have axes "
                            "and a unit of their own");
  }
  const auto late = run.beside.warnings(done.frames.front().time_s, done.frames.back().time_s);
  done.warnings.insert(done.warnings.end(), late.begin(), late.end());
  return RunSummary{report, request.out_dir, std::move(done.warnings), done.interrupted,
                    std::move(written)};
}

Expected<RunSummary> run_source(RunRequest request,
                                const FrameSource& sequence,
                                const RunProgress& progress) {
  request.config = dataset::with_camera_height(request.config, sequence);
  STEMVO_TRY_GET(const pipeline::BesideFrames beside,
                 pipeline::read_beside_frames(request, sequence));
  // Lives longer than the odometry, whose thread that measures the camera may end last.
  std::optional<StageRecorder> recorder;
  STEMVO_TRY_GET(PhasedOdometry odometry,
                 PhasedOdometry::create(sequence.camera, request.config, sequence.mask));
  if (request.saved_map) {
    STEMVO_TRY(odometry.check_remembers("--save-map"));
  }
  if (request.map) {
    STEMVO_TRY(odometry.load_map(*request.map));
  }
  if (request.out_dir.empty()) {
    STEMVO_TRY_GET(const auto folder, pipeline::create_results_folder(sequence.name));
    request.out_dir = folder;
  }
  pipeline::DriveVideo video;
  const Run run{request, sequence, odometry, beside, video};
  const bool is_replacing = pipeline::is_folder_of(request.out_dir, "run");
  STEMVO_TRY(pipeline::open_out_folder(request.out_dir, "run"));
  // Before anything is removed: a wrong name costs no earlier result.
  if (request.saved_map) {
    STEMVO_TRY(check_place_of_map(*request.saved_map));
    STEMVO_TRY(check_can_write(*request.saved_map));
  }
  if (request.video) {
    if (std::error_code code;
        std::filesystem::equivalent(*request.video, request.sequence_dir, code)) {
      return fail(fmt::format("--video {}: expected a file to write, found the recording",
                              request.video->string()));
    }
    STEMVO_TRY_GET(video, pipeline::DriveVideo::create(request, sequence));
  }
  STEMVO_TRY(prepare_out_folder(run));
  if (request.measure_times) {
    recorder.emplace();
  }
  note_start(run, is_replacing);
  return finish_run(run, progress);
}

}  // namespace

Expected<RunSummary> run_sequence(const RunRequest& request, const RunProgress& progress) {
  STEMVO_TRY(validate(request.config));
  RunRequest resolved = request;
  if (request.num_threads > 0) {
    resolved.config.threads = request.num_threads;
  }
  const auto limit = pipeline::limit_threads(resolved.config.threads);
  STEMVO_TRY_GET(const auto sequence, open_sequence(resolved));
  return run_source(std::move(resolved), sequence, progress);
}

Expected<ChannelImagesReport> write_channel_images(const ChannelImagesRequest& request,
                                                   const RunProgress& progress) {
  STEMVO_TRY(validate(request.config));
  FrameSourceRequest source = request;
  source.camera = request.config.input.camera;
  STEMVO_TRY_GET(const auto sequence, open_source(source));
  STEMVO_TRY_GET(const Stem stem, Stem::load_all(request.config.stem));
  STEMVO_TRY_GET(
      const FrameRange filters,
      dataset::resolve_range(request.filters, static_cast<std::size_t>(stem.info().num_filters),
                             stem.info().model, "filters"));
  STEMVO_TRY(pipeline::open_out_folder(request.out_dir, "channel"));
  std::size_t num_written = 0;
  const auto save = [&](const cv::Mat& image, std::size_t number, const std::string& name) {
    ++num_written;
    return write_image(request.out_dir / fmt::format("{:06}_{}.png", number, name), image);
  };
  // Each filter keeps its own contrast limits.
  std::vector<ContrastNormalization> contrasts(filters.end - filters.begin,
                                               ContrastNormalization(request.config.stem));
  bool goes_on = true;
  for (std::size_t i = 0; i < sequence.size() && goes_on; ++i) {
    const std::size_t number = sequence.range.begin + i;
    STEMVO_TRY_GET(const cv::Mat frame, sequence.read(i));
    if (frame.empty()) {  // behind a stream's last
      break;
    }
    STEMVO_TRY_GET(const auto channels, stem.apply_all(frame));
    std::vector<cv::Mat> images = {frame};
    std::vector<std::string> captions = {fmt::format("input, frame {}", number)};
    STEMVO_TRY(save(frame, number, "input"));
    for (std::size_t k = filters.begin; k < filters.end; ++k) {
      images.push_back(contrasts[k - filters.begin].apply(channels[k]).pixels);
      captions.push_back(fmt::format("{} filter {}", request.config.stem.model, k));
      STEMVO_TRY(save(images.back(), number, fmt::format("filter_{:03}", k)));
    }
    STEMVO_TRY(save(draw_sheet(images, captions), number, "sheet"));
    goes_on = !progress || progress(i + 1, sequence.size());
  }
  return ChannelImagesReport{num_written, sequence.remarks()};
}

}  // namespace stemvo
