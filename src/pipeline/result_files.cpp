// SPDX-License-Identifier: MIT
#include "pipeline/result_files.hpp"

#include <algorithm>
#include <chrono>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "internal_check.hpp"
#include "options/option_fields.hpp"
#include "pipeline/input_notes.hpp"
#include "report/evaluate_report.hpp"
#include "report/map_ply.hpp"
#include "report/run_page.hpp"
#include "report/trajectory_plot.hpp"
#include "stemvo/version.hpp"
#include "text/text_file.hpp"

namespace stemvo::pipeline {
namespace {

/// Names come from outside: a line break in one must not end the comment it stands in.
std::string one_line(std::string text) {
  std::replace_if(text.begin(), text.end(), [](unsigned char c) { return c < 0x20; }, ' ');
  return text;
}

std::string describe_numbers(const MetricsReport& report) {
  std::string text = fmt::format("scale: {}", report.scale_source);
  if (report.metrics) {
    const Alignment alignment = report.metrics->alignment;
    text += fmt::format(", path {:.0f} m, ", report.metrics->path_length_m);
    text += alignment == Alignment::kNone ? "no alignment:"
                                          : fmt::format("fitted by {}:", to_string(alignment));
    text += fmt::format(" average offset {:.2f} m", report.metrics->average_offset_m);
    if (report.metrics->t_rel_percent) {
      text += fmt::format(", t_rel {:.2f} %", *report.metrics->t_rel_percent);
    }
  }
  return text;
}

/// Steps to both sides of a frame that tell how much its surroundings were stretched.
constexpr std::size_t kStepsAround = 5;

double path_length(std::span<const Rigid3> poses, std::size_t begin, std::size_t end) {
  double length = 0.0;
  for (std::size_t i = begin + 1; i < end; ++i) {
    length += (poses[i].translation - poses[i - 1].translation).norm();
  }
  return length;
}

/// Written units per unit of the landmarks, around a frame.
double stretch_at(std::span<const Rigid3> refined,
                  std::span<const Rigid3> written,
                  std::size_t frame) {
  const std::size_t begin = frame - std::min(frame, kStepsAround);
  const std::size_t end = std::min(frame + kStepsAround + 1, refined.size());
  const double before = path_length(refined, begin, end);
  return before > 0.0 ? path_length(written, begin, end) / before : 1.0;
}

/// "frames 10:20 of 03", in the folder's numbering.
std::string describe_frames(const FrameSource& sequence, std::size_t num_frames) {
  const std::size_t begin = sequence.range().begin;
  return one_line(fmt::format("frames {}:{} of {}", begin, begin + num_frames, sequence.name()));
}

class ResultWriter {
 public:
  ResultWriter(const RunRequest& request,
               const FrameSource& sequence,
               const PhasedOdometry& odometry,
               const Drive& drive)
      : request_(request),
        sequence_(sequence),
        odometry_(odometry),
        drive_(drive),
        trajectory_(drive.trajectory) {
    const auto truth = sequence.ground_truth_of(trajectory_.size());  // interrupted: fewer poses
    matched_ = truth ? Status() : truth.error();
    if (truth && *truth && !(*truth)->frames.empty()) {
      truth_ = **truth;
    }
    trajectory_ = as_written(request, sequence, std::move(trajectory_));
    if (request.config.odometry.mode == OdometryMode::kMap) {
      refined_ = as_written(request, sequence, odometry.frames().estimator().refined_trajectory());
    }
  }

  Status write(MetricsReport& report) {
    const std::filesystem::path& folder = request_.out_dir;
    std::vector<double> times_s;
    for (std::size_t i = 0; i < trajectory_.size(); ++i) {
      times_s.push_back(sequence_.time_s(i));
    }
    Status written = write_kitti_trajectory(folder / "trajectory_kitti.txt", trajectory_);
    keep_first(written, write_tum_trajectory(folder / "trajectory_tum.txt", times_s, trajectory_));
    if (refined_) {
      keep_first(written,
                 write_kitti_trajectory(folder / "trajectory_refined_kitti.txt", *refined_));
    }
    report = make_report();
    keep_first(written, drive_.written);
    keep_first(written, write_text_file(folder / "config.yaml", config_text()));
    if (request_.write_map) {
      keep_first(written, write_map_ply(folder / "map.ply", map_points(), *refined_));
    }
    keep_first(written, write_trajectory_png(folder / "trajectory.png", make_plot(report)));
    keep_first(written, matched_);
    if (request_.note && truth_ && sequence_.stream()) {
      request_.note("ground truth" +
                    count_matched(request_, truth_->frames.size(), trajectory_.size()));
    }
    return written;
  }

  [[nodiscard]] Status write_page(const MetricsReport& report) const {
    const TrajectoryPlot plot = make_plot(report);
    std::vector<std::size_t> drawn(drive_.frames.size());
    std::iota(drawn.begin(), drawn.end(), std::size_t{0});
    drawn = truth_ ? truth_->frames : drawn;
    std::vector<FrameResult> frames;
    for (std::size_t& i : drawn) {
      frames.push_back(drive_.frames[i]);
      i += sequence_.range().begin;
    }
    return write_run_page(
        request_.out_dir / "report.html",
        {plot.title, plot.subtitle, plot.unit, report, frames, drawn, plot.estimate,
         plot.ground_truth, drive_.images, config_text(), request_.command});
  }

 private:
  [[nodiscard]] MetricsReport make_report() const {
    const std::chrono::duration<double> elapsed =
        std::chrono::steady_clock::now() - request_.started +
        std::chrono::duration<double>(drive_.elapsed_before_s);
    const Config& config = request_.config;
    const auto num_frames = static_cast<double>(trajectory_.size());
    MetricsReport report;
    report.stemvo_version = version();
    report.sequence = sequence_.name();
    report.first_frame = sequence_.range().begin;
    report.num_frames = trajectory_.size();
    report.model = config.stem.model;
    report.filter = odometry_.stem_info().filter;
    report.fps = num_frames / std::max(elapsed.count(), 1e-9);
    report.scale_source = options::to_string(config.scale.source);
    report.tracked_fraction = static_cast<double>(drive_.num_measured) / num_frames;
    report.camera = {drive_.frames.back().camera, drive_.frames.back().principal_point_sigma_px};
    if (config.scale.source == ScaleSource::kCameraHeight) {
      report.road_measured_fraction = static_cast<double>(drive_.num_road_measured) / num_frames;
    }
    if (truth_) {
      // A trajectory without a scale has no error in metres until one is fitted.
      const Alignment alignment =
          config.scale.source == ScaleSource::kNone ? Alignment::kSim3 : Alignment::kNone;
      const auto compare = [&](const Trajectory& trajectory) {
        return evaluate_aligned(take_poses(trajectory, truth_->frames), truth_->poses, alignment,
                                config.evaluation);
      };
      report.metrics = compare(trajectory_);
      if (refined_) {
        report.refined = compare(*refined_);
      }
    }
    return report;
  }

  [[nodiscard]] std::string config_text() const {
    return pipeline::config_text(request_, sequence_, odometry_, trajectory_.size());
  }

  /// The landmarks in the world of trajectory_refined_kitti.txt: where steps were rescaled, they
  /// are with them.
  [[nodiscard]] std::vector<ColoredPoint> map_points() const {
    const Trajectory refined = odometry_.frames().estimator().refined_trajectory();
    STEMVO_CHECK(refined.size() == refined_->size(), "the same poses, before and after rescaling");
    std::vector<ColoredPoint> points;
    for (const MapLandmark& landmark : odometry_.frames().estimator().landmarks()) {
      const auto frame = static_cast<std::size_t>(landmark.frame);
      STEMVO_CHECK(frame < refined.size(), "landmarks belong to frames");
      const Eigen::Vector3d in_camera =
          stretch_at(refined, *refined_, frame) * landmark.position.cast<double>();
      points.push_back({((*refined_)[frame] * in_camera).cast<float>(), landmark.rgb});
    }
    return points;
  }

  /// Against the ground truth where there is one.
  [[nodiscard]] TrajectoryPlot make_plot(const MetricsReport& report) const {
    TrajectoryPlot plot;
    plot.title = describe_frames(sequence_, trajectory_.size());
    plot.subtitle = describe_numbers(report);
    plot.estimate = trajectory_;
    if (truth_) {
      plot.ground_truth = truth_->poses;
      plot.estimate = take_poses(trajectory_, truth_->frames);
      if (report.metrics->alignment != Alignment::kNone) {
        plot.estimate = align_trajectory(plot.estimate, truth_->poses, report.metrics->alignment);
      }
    } else if (report.scale_source == "none") {
      plot.unit = "units";
    }
    return plot;
  }

  const RunRequest& request_;
  const FrameSource& sequence_;
  const PhasedOdometry& odometry_;
  const Drive& drive_;
  Trajectory trajectory_;
  std::optional<Trajectory> refined_;  ///< the same with look-ahead; mode map only
  std::optional<GroundTruth> truth_;
  Status matched_;  ///< the ground truth of a stream
};

}  // namespace

void keep_first(Status& first, Status next) {
  if (first && !next) {
    first = std::move(next);
  }
}

Trajectory as_written(const RunRequest& request,
                      const FrameSource& sequence,
                      Trajectory trajectory) {
  return request.config.scale.source == ScaleSource::kGroundTruth
             ? rescale_steps(trajectory,
                             std::span(*sequence.ground_truth()).first(trajectory.size()))
             : trajectory;
}

std::string config_text(const RunRequest& request,
                        const FrameSource& sequence,
                        const PhasedOdometry& odometry,
                        std::size_t num_frames) {
  const StemInfo& stem = odometry.stem_info();
  std::string text =
      fmt::format("# stemvo {}\n# {}\n", version(),
                  describe_frames(sequence, sequence.stream() ? num_frames : sequence.size()));
  text += fmt::format("# model {}: {} filters, sampled every {} px{}\n", one_line(stem.model),
                      stem.num_filters, stem.sampling_px,
                      stem.sha256.empty() ? "" : ", sha256 " + stem.sha256);
  if (const auto& calibration = sequence.given_calibration()) {
    text += fmt::format("# calibration {}\n", one_line(calibration->string()));
  }
  // With what auto, -1 and 0 stand for, which may change with the manifest.
  Config effective = request.config;
  effective.stem.upsample =
      choose_upsample(effective.stem.upsample, effective.features.method, sequence.camera());
  effective.stem.filter = stem.filter;
  effective.stem.sampling_px = stem.sampling_px;
  return text + "\n" + dump_config(effective);
}

Status write_results(const RunRequest& request,
                     const FrameSource& sequence,
                     const PhasedOdometry& odometry,
                     const Drive& drive,
                     MetricsReport& report) {
  return ResultWriter(request, sequence, odometry, drive).write(report);
}

Status write_report_page(const RunRequest& request,
                         const FrameSource& sequence,
                         const PhasedOdometry& odometry,
                         const Drive& drive,
                         const MetricsReport& report) {
  return ResultWriter(request, sequence, odometry, drive).write_page(report);
}

}  // namespace stemvo::pipeline
