// SPDX-License-Identifier: MIT
#include "pipeline/result_files.hpp"

#include <algorithm>
#include <functional>
#include <span>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "geometry/degrees.hpp"
#include "odometry/metric_scale.hpp"
#include "options/visit.hpp"
#include "pipeline/map_result.hpp"
#include "report/data_files.hpp"
#include "report/evaluate_report.hpp"
#include "report/frame_image.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"
#include "timing/stage_timer.hpp"

namespace stemvo::pipeline {
namespace {

std::string describe_numbers(const MetricsReport& report) {
  std::string text = fmt::format("scale: {}", report.scale_source);
  if (report.metrics) {
    const Alignment alignment = report.metrics->alignment;
    text += fmt::format(", path {} m, ", format_length(report.metrics->path_length_m, 0));
    text += alignment == Alignment::kNone ? "no alignment:"
                                          : fmt::format("fitted by {}:", to_string(alignment));
    text += fmt::format(" average offset {} m", format_length(report.metrics->average_offset_m, 2));
    if (report.metrics->t_rel_percent) {
      text += fmt::format(", t_rel {:.2f} %", *report.metrics->t_rel_percent);
    }
  }
  return text;
}

/// "frames 10:20 of 03", in the folder's numbering; "frames 10: of 03" where the end is not known.
std::string describe_frames(const FrameSource& sequence, std::size_t num_frames) {
  const std::size_t begin = sequence.range.begin;
  const std::string end = num_frames > 0 ? std::to_string(begin + num_frames) : "";
  // A line break in a name must not end the comment it stands in.
  return one_line(fmt::format("frames {}:{} of {}", begin, end, sequence.name));
}

template <typename Predicate>
double share_of(const std::vector<FrameResult>& frames, const Predicate& is_one) {
  return static_cast<double>(std::ranges::count_if(frames, is_one)) /
         static_cast<double>(frames.size());
}

/// The share of frames behind the first that measured no translation.
double share_in_place(const std::vector<FrameResult>& frames) {
  const auto count = std::ranges::count_if(frames, [](const FrameResult& frame) {
    return frame.state == FrameState::kStationary || frame.state == FrameState::kRotating ||
           frame.state == FrameState::kLowParallax;
  });
  return frames.size() > 1 ? static_cast<double>(count) / static_cast<double>(frames.size() - 1)
                           : 0.0;
}

void add_maps(const std::vector<FrameResult>& frames, MetricsReport& report) {
  for (std::size_t i = 0; i < frames.size(); ++i) {
    report.num_maps = std::max(report.num_maps, frames[i].map_id + 1);
    if (frames[i].is_scale_new) {
      report.scale_new_frames.push_back(i);
    }
  }
}

/// Frames that found the camera again in a place, behind one that had not measured it.
std::size_t count_relocalizations(const std::vector<FrameResult>& frames) {
  std::size_t count = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const FrameState before = frames[i - 1].state;
    const bool was_lost = !is_measured(before) || before == FrameState::kInitializing;
    count += was_lost && frames[i].recognized_frame != -1 ? 1 : 0;
  }
  return count;
}

class ResultWriter {
 public:
  ResultWriter(const Run& run, const Drive& drive)
      : request_(run.request),
        sequence_(run.sequence),
        run_(run),
        drive_(drive),
        trajectory_(drive.trajectory),
        config_text_(config_text(run, trajectory_.size())),
        csv_(drive.csv) {
    const auto truth = sequence_.ground_truth_of(trajectory_.size());  // interrupted: fewer poses
    matched_ = truth ? Status() : truth.error();
    if (truth && *truth) {
      truth_ = seen_part(**truth);
    }
  }

  /// All but metrics.json and report.html.
  [[nodiscard]] Status write(MetricsReport& report) {
    const std::filesystem::path& folder = request_.out_dir;
    Status written = drive_.written;
    report = make_report();
    if (truth_) {
      csv_ = frames_csv_with_errors(drive_.csv, frame_errors(report));
      keep_first(written, write_text_file(folder / "frames.csv", csv_));
    }
    keep_first(written, write_text_file(folder / "config.yaml", config_text_));
    if (request_.config.odometry.mode == OdometryMode::kMap) {
      keep_first(written, write_map(report));
    }
    keep_first(written, write_image(folder / "trajectory.png", draw_trajectory(make_plot(report))));
    keep_first(written, matched_);
    if (request_.note && truth_ && sequence_.stream) {
      request_.note("ground truth" +
                    count_matched(request_, truth_->frames.size(), trajectory_.size()));
    }
    return written;
  }

  [[nodiscard]] Status write_page(const MetricsReport& report) const {
    const TrajectoryPlot plot = make_plot(report);
    std::optional<MapPage> map;
    if (map_ && report.map) {
      map = {in_truth(map_->trajectory, report), {}};
      for (const auto& [from, to] : frames_of_loops(map_->whole.kept)) {
        if (from >= 0) {  // else of another recording's map
          map->loops.emplace_back(from, to);
        }
      }
    }
    return write_run_page(request_.out_dir / "report.html",
                          {plot, report, csv_, map, truth_, drive_.images,
                           drive_.small_frames.images(), config_text_, request_.command});
  }

 private:
  /// From where the camera starts: images before it that cannot be read, or show nothing (a lens
  /// cap), have no pose to compare. Nullopt: no motion is left.
  [[nodiscard]] std::optional<GroundTruth> seen_part(const GroundTruth& truth) const {
    const auto& frames = drive_.frames;
    const auto seen = std::ranges::find_if(
        frames, [](const auto& frame) { return frame.state != FrameState::kNoImage; });
    const auto located = std::find_if(seen, frames.end(), [](const auto& frame) {
      return frame.state != FrameState::kNoImage && frame.state != FrameState::kFirst &&
             frame.state != FrameState::kLost;
    });
    const auto start = located == frames.end() || located == seen ? seen : located - 1;
    const auto first =
        std::ranges::lower_bound(truth.frames, static_cast<std::size_t>(start - frames.begin()));
    const auto skipped = static_cast<std::size_t>(first - truth.frames.begin());
    if (truth.frames.size() < skipped + 2) {
      return std::nullopt;
    }
    return GroundTruth{relative_to_first(std::span(truth.poses).subspan(skipped)),
                       {first, truth.frames.end()}};
  }

  [[nodiscard]] Status write_map(MetricsReport& report) {
    map_ = finish_map(run_);
    Status written = write_map_ply(run_, *map_);
    if (!request_.config.odometry.loops) {
      return written;
    }
    const std::filesystem::path& folder = request_.out_dir;
    const Trajectory& poses = map_->trajectory;
    std::vector<double> times_s;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      times_s.push_back(sequence_.time_s(i));
    }
    keep_first(written, write_kitti_trajectory(folder / "trajectory_map_kitti.txt", poses));
    keep_first(written, write_tum_trajectory(folder / "trajectory_map_tum.txt", times_s, poses));
    if (request_.saved_map) {
      keep_first(written, run_.odometry.save_map(*request_.saved_map, map_->whole.kept));
    }
    const auto is_own = [](const auto& loop) { return loop.second >= 0; };
    const auto shows_given = [](const FrameResult& frame) { return frame.recognized_frame < -1; };
    report.map = {.num_keyframes = map_->whole.kept.keyframes.size(),
                  .num_loops = static_cast<std::size_t>(
                      std::ranges::count_if(frames_of_loops(map_->whole.kept), is_own)),
                  .num_relocalizations = count_relocalizations(drive_.frames),
                  .adjustment_s = map_->adjustment_s,
                  .metrics = std::nullopt,
                  .is_apart = request_.map && std::ranges::none_of(drive_.frames, shows_given)};
    if (truth_) {
      report.map->metrics = metrics_of(map_->trajectory, report);
    }
    return written;
  }

  [[nodiscard]] Metrics metrics_of(const Trajectory& poses, const MetricsReport& report) const {
    // A trajectory without a scale has no error in metres until one is fitted.
    const Alignment alignment = report.is_up_to_scale() ? Alignment::kSim3 : Alignment::kNone;
    return evaluate_aligned({take_poses(poses, truth_->frames), truth_->poses}, alignment,
                            request_.config.evaluation);
  }

  [[nodiscard]] MetricsReport make_report() const {
    const std::chrono::duration<double> elapsed =
        std::chrono::steady_clock::now() - request_.started;
    const Config& config = request_.config;
    MetricsReport report;
    report.sequence = sequence_.name;
    report.first_frame = sequence_.range.begin;
    report.num_frames = trajectory_.size();
    report.model = config.stem.model;
    report.filter = run_.odometry.stem_info().filter;
    report.fps = static_cast<double>(trajectory_.size()) / std::max(elapsed.count(), 1e-9);
    report.scale_source = scale_source(config);
    if (!run_.beside.ways.empty() && std::ranges::any_of(drive_.frames, has_metres)) {
      report.scale_source =
          config.scale.source == ScaleSource::kNone ? "speed" : report.scale_source + " and speed";
      report.metric_fraction = share_of(drive_.frames, has_metres);
    }
    report.tracked_fraction = share_of(drive_.frames, std::mem_fn(&FrameResult::is_measured));
    add_maps(drive_.frames, report);
    report.in_place_fraction = share_in_place(drive_.frames);
    const FrameResult& last = drive_.frames.back();
    report.camera = {last.camera, last.camera_sigma, last.radial};
    if (config.scale.source == ScaleSource::kCameraHeight) {
      report.road_measured_fraction = share_of(
          drive_.frames, [](const FrameResult& frame) { return frame.road_reason.empty(); });
      report.road_believed_fraction = share_of(drive_.frames, has_metres);
      report.road_contradicted_fraction = share_of(drive_.frames, [](const FrameResult& frame) {
        return frame.road_reason == kRoadContradicted;
      });
    }
    if (truth_) {
      report.metrics = metrics_of(trajectory_, report);
    }
    return report;
  }

  [[nodiscard]] TrajectoryPlot make_plot(const MetricsReport& report) const {
    TrajectoryPlot plot;
    plot.title = describe_frames(sequence_, trajectory_.size());
    plot.subtitle = describe_numbers(report);
    plot.estimate = in_truth(trajectory_, report);
    if (truth_) {
      plot.ground_truth = truth_->poses;
      if (truth_->frames.size() < trajectory_.size()) {
        plot.subtitle += fmt::format(", ground truth for {} of {} frames", truth_->frames.size(),
                                     trajectory_.size());
      }
    } else if (report.is_up_to_scale()) {
      plot.unit = "units";
    }
    return plot;
  }

  [[nodiscard]] Trajectory in_truth(const Trajectory& poses, const MetricsReport& report) const {
    return truth_
               ? align_trajectory(poses, truth_->frames, truth_->poses, report.metrics->alignment)
               : poses;
  }

  [[nodiscard]] std::vector<FrameError> frame_errors(const MetricsReport& report) const {
    const Trajectory estimate = in_truth(trajectory_, report);
    std::vector<FrameError> errors;
    for (std::size_t i = 0; i < truth_->frames.size(); ++i) {
      const Rigid3 off = truth_->poses[i].inverse() * estimate[truth_->frames[i]];
      errors.push_back(
          {truth_->frames[i], off.translation.norm(), kDegPerRad * so3_log(off.rotation).norm()});
    }
    return errors;
  }

  const RunRequest& request_;
  const FrameSource& sequence_;
  const Run& run_;
  const Drive& drive_;
  const Trajectory& trajectory_;
  std::string config_text_;
  std::string csv_;
  std::optional<GroundTruth> truth_;
  std::optional<MapResult> map_;  ///< nullopt: mode two_frame
  Status matched_;                ///< the ground truth of a stream
};

}  // namespace

std::string count_matched(const RunRequest& request,
                          std::size_t num_matched,
                          std::size_t num_frames) {
  const std::string others = fmt::format(" (the others have none within {} s: --gt-tolerance)",
                                         request.ground_truth_tolerance_s);
  return fmt::format(" for {} of {} frames{}", num_matched, num_frames,
                     num_matched < num_frames ? others : "");
}

void keep_first(Status& first, Status next) {
  if (first && !next) {
    first = std::move(next);
  }
}

std::string config_text(const Run& run, std::size_t num_frames) {
  const FrameSource& sequence = run.sequence;
  const StemInfo& stem = run.odometry.stem_info();
  std::string text =
      fmt::format("# stemvo {}\n# {}\n", version(),
                  describe_frames(sequence, sequence.stream ? num_frames : sequence.size()));
  text += fmt::format("# model {}: {} filters, sampled every {} px\n", one_line(stem.model),
                      stem.num_filters, stem.sampling_px);
  if (const auto& calibration = sequence.given_calibration) {
    text += fmt::format("# calibration {}\n", one_line(calibration->string()));
  }
  // With what auto, -1 and 0 stand for, which may change with the model.
  Config effective = run.request.config;
  effective.stem.tracking_resolution = choose_tracking_resolution(
      effective.stem.tracking_resolution, effective.features.method, sequence.camera);
  effective.stem.filter = stem.filter;
  effective.stem.sampling_px = stem.sampling_px;
  return text + "\n" + dump_config(effective);
}

Status write_results(const Run& run, const Drive& drive, MetricsReport& report) {
  ResultWriter writer(run, drive);
  Status written = timed(Stage::kResultFiles, [&] { return writer.write(report); });
  if (const StageRecorder* recorder = StageRecorder::active()) {
    report.timing = recorder->report();
    report.timing->fps = report.fps;
    report.timing->num_frames = report.num_frames;
    report.timing->num_threads = run.odometry.num_threads();
  }
  keep_first(written, write_text_file(run.request.out_dir / "metrics.json",
                                      to_text(metrics_document(report))));
  keep_first(written, writer.write_page(report));
  return written;
}

}  // namespace stemvo::pipeline
