// SPDX-License-Identifier: MIT
#include "pipeline/result_files.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "report/evaluate_report.hpp"
#include "report/trajectory_plot.hpp"
#include "stemvo/version.hpp"

namespace stemvo::pipeline {
namespace {

/// Names come from outside: a line break in one must not end the comment it stands in.
std::string one_line(std::string text) {
  std::replace_if(text.begin(), text.end(), [](unsigned char c) { return c < 0x20; }, ' ');
  return text;
}

/// "frames 10:20 of 03", in the folder's numbering.
std::string describe_frames(const FrameSource& sequence, std::size_t num_frames) {
  const std::size_t begin = sequence.range().begin;
  return fmt::format("frames {}:{} of {}", begin, begin + num_frames, sequence.name());
}

std::string describe_numbers(const MetricsReport& report) {
  std::string text = fmt::format("scale: {}", report.scale_source);
  if (report.metrics) {
    const Alignment alignment = report.metrics->alignment;
    text += fmt::format("   path {:.0f} m   ", report.metrics->path_length_m);
    text += alignment == Alignment::kNone ? "no alignment:"
                                          : fmt::format("fitted by {}:", to_string(alignment));
    text += fmt::format(" average offset {:.2f} m", report.metrics->average_offset_m);
    if (report.metrics->t_rel_percent) {
      text += fmt::format("   t_rel {:.2f} %", *report.metrics->t_rel_percent);
    }
  }
  return text;
}

}  // namespace

Status write_trajectories(const std::filesystem::path& out_dir,
                          const FrameSource& sequence,
                          std::span<const Rigid3> trajectory) {
  const std::span<const double> times_s(sequence.timestamps_s().data(), trajectory.size());
  const Status kitti = write_kitti_trajectory(out_dir / "trajectory_kitti.txt", trajectory);
  const Status tum = write_tum_trajectory(out_dir / "trajectory_tum.txt", times_s, trajectory);
  return kitti ? tum : kitti;
}

Status write_refined_trajectory(const std::filesystem::path& out_dir,
                                const std::optional<Trajectory>& refined) {
  const std::filesystem::path file = out_dir / "trajectory_refined_kitti.txt";
  if (refined) {
    return write_kitti_trajectory(file, *refined);
  }
  std::error_code code;
  std::filesystem::remove(file, code);
  if (code) {
    return fail(fmt::format("{}: an earlier run's file cannot be removed ({})", file.string(),
                            code.message()));
  }
  return {};
}

Status write_config(const std::filesystem::path& out_dir,
                    const Config& config,
                    const FrameSource& sequence,
                    const StemInfo& stem) {
  const std::filesystem::path file = out_dir / "config.yaml";
  std::ofstream out(file, std::ios::binary);
  out << fmt::format("# stemvo {}\n", version());
  out << fmt::format("# {}\n", one_line(describe_frames(sequence, sequence.size())));
  out << fmt::format("# model {}: {} filters, sampled every {} px", one_line(stem.model),
                     stem.num_filters, stem.sampling_px);
  out << (stem.sha256.empty() ? "" : fmt::format(", sha256 {}", stem.sha256)) << "\n";
  if (const auto& calibration = sequence.given_calibration()) {
    out << fmt::format("# calibration {}\n", one_line(calibration->string()));
  }
  out << "\n";
  // With what auto, -1 and 0 stand for, which may change with the manifest.
  Config effective = config;
  effective.stem.upsample =
      choose_upsample(config.stem.upsample, config.features.method, sequence.camera().width_px);
  effective.stem.filter = stem.filter;
  effective.stem.sampling_px = stem.sampling_px;
  out << dump_config(effective);
  if (!out.flush()) {
    return fail(fmt::format("{}: cannot be written ({})", file.string(), std::strerror(errno)));
  }
  return {};
}

Status write_map(const std::filesystem::path& out_dir,
                 const FrameSource& sequence,
                 std::span<const Rigid3> trajectory,
                 const MetricsReport& report) {
  TrajectoryPlot plot;
  plot.title = one_line(describe_frames(sequence, trajectory.size()));
  plot.subtitle = describe_numbers(report);
  plot.estimate.assign(trajectory.begin(), trajectory.end());
  const Alignment alignment = report.metrics ? report.metrics->alignment : Alignment::kNone;
  if (const std::optional<Trajectory>& truth = sequence.ground_truth()) {
    const auto end = truth->begin() + static_cast<std::ptrdiff_t>(trajectory.size());
    plot.ground_truth = Trajectory(truth->begin(), end);
    if (alignment != Alignment::kNone) {
      plot.estimate = align_trajectory(trajectory, *plot.ground_truth, alignment);
    }
  } else if (report.scale_source == "none") {
    plot.unit = "units";
  }
  const Status png = write_trajectory_png(out_dir / "trajectory.png", plot);
  const Status svg = write_trajectory_svg(out_dir / "trajectory.svg", plot);
  return png ? svg : png;
}

}  // namespace stemvo::pipeline
