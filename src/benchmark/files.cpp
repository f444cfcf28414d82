// SPDX-License-Identifier: MIT
#include "benchmark/files.hpp"

#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "benchmark/names.hpp"
#include "benchmark/runner.hpp"
#include "stemvo/report/trajectory_plot.hpp"
#include "text/text_file.hpp"

namespace stemvo::benchmark {
namespace {

namespace fs = std::filesystem;

bool is_done(const BenchmarkRun& run) { return run.report.has_value(); }

/// The first configuration without ground truth, the others (the paper's) with true steps; the
/// other protocol where that one is not done.
const BenchmarkRun* run_to_draw(const BenchmarkSequence& sequence,
                                const std::string& configuration,
                                bool is_first) {
  const ScaleProtocol wanted =
      is_first ? ScaleProtocol::kCameraHeight : ScaleProtocol::kGroundTruthSteps;
  const BenchmarkRun* best = nullptr;
  for (const BenchmarkRun& run : sequence.runs) {
    if (run.configuration == configuration && is_done(run) &&
        (best == nullptr || run.protocol == wanted)) {
      best = &run;
    }
  }
  return best;
}

Expected<std::vector<NamedTrajectory>> paths_to_draw(const BenchmarkRequest& request,
                                                     const BenchmarkSequence& sequence,
                                                     std::string& subtitle) {
  std::vector<NamedTrajectory> paths;
  for (const BenchmarkConfiguration& configuration : request.configurations) {
    const bool is_first = configuration.name == request.configurations.front().name;
    const BenchmarkRun* run = run_to_draw(sequence, configuration.name, is_first);
    if (run == nullptr) {
      continue;
    }
    const fs::path file = run_folder(request.out_dir, sequence.name, *run) / "trajectory_kitti.txt";
    Expected<Trajectory> poses = read_kitti_trajectory(file);
    if (!poses) {
      return poses.error();
    }
    paths.push_back({run->configuration, std::move(*poses)});
    subtitle += fmt::format("{}{}: {}", subtitle.empty() ? "" : "   ", run->configuration,
                            words_for(run->protocol));
  }
  return paths;
}

}  // namespace

Status write_picture(const BenchmarkRequest& request, const BenchmarkSequence& sequence) {
  const fs::path file = request.out_dir / (sequence.name + ".png");
  std::error_code ignored;
  fs::remove(file, ignored);  // an older one must not pass for this one's
  TrajectoryPlot plot;
  plot.title = fmt::format("{}, {}", sequence.name, describe_frames(sequence));
  auto paths = paths_to_draw(request, sequence, plot.subtitle);
  if (!paths || paths->empty()) {
    return paths ? Status() : paths.error();
  }
  plot.estimate = std::move(paths->front().trajectory);
  plot.estimate_name = paths->front().name;
  plot.others.assign(std::make_move_iterator(paths->begin() + 1),
                     std::make_move_iterator(paths->end()));
  const Expected<KittiSequence> opened =
      KittiSequence::open(request.kitti_root / "sequences" / sequence.name);
  if (opened) {
    plot.ground_truth = opened->ground_truth();
  }
  return write_trajectory_png(file, plot);
}

Status write_files(const BenchmarkRequest& request,
                   const BenchmarkReport& report,
                   const BenchmarkSequence& last) {
  Status written = write_text_file(request.out_dir / "benchmark.md", format_markdown(report));
  for (const auto& [name, text] : {std::pair("benchmark.json", format_json(report)),
                                   std::pair("speed.json", format_speed_json(report))}) {
    const Status next = write_text_file(request.out_dir / name, text);
    written = written ? next : written;
  }
  const Status drawn = write_picture(request, last);
  return written ? drawn : written;
}

}  // namespace stemvo::benchmark
