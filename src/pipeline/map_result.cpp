// SPDX-License-Identifier: MIT
#include "pipeline/map_result.hpp"

#include <algorithm>
#include <chrono>
#include <span>

#include "geometry/median.hpp"
#include "pipeline/result_files.hpp"
#include "report/data_files.hpp"

namespace stemvo::pipeline {
namespace {

/// Written units per unit of the estimate around a frame: the median over steps, since one that
/// ends the wait for a first map spans many frames. Frames stay where no step was measured.
double stretch_at(std::span<const Similarity3> estimated,
                  std::span<const Rigid3> written,
                  std::size_t frame) {
  constexpr std::size_t kStepsAround = 5;  // to both sides
  const auto step = [](const auto& poses, std::size_t i) {
    return (poses[i].translation - poses[i - 1].translation).norm();
  };
  std::vector<double> stretches;
  const std::size_t begin = frame - std::min(frame, kStepsAround);
  const std::size_t end = std::min(frame + kStepsAround + 1, estimated.size());
  for (std::size_t i = begin + 1; i < end; ++i) {
    if (const double before = step(estimated, i); before > 0.0) {
      stretches.push_back(step(written, i) / before);
    }
  }
  return stretches.empty() ? 1.0 : median(stretches);
}

}  // namespace

MapResult finish_map(const Run& run) {
  MapResult map{WholeMap(run.odometry), {}};
  if (run.request.adjust_map || !map.whole.kept.loops.empty()) {
    const auto start = std::chrono::steady_clock::now();
    (void)map.whole.adjust({}, false);  // no covariances: no error
    map.adjustment_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  } else {
    map.whole.close_loops();
  }
  for (const Similarity3& placed : map.whole.map_from_frame) {
    map.trajectory.emplace_back(placed.rotation, placed.translation);
  }
  if (run.request.config.scale_choice == ScaleChoice::kGroundTruth) {
    map.trajectory = rescale_steps(
        {map.trajectory, std::span(run.sequence.ground_truth->poses).first(map.trajectory.size())});
  }
  return map;
}

Status write_map_ply(const Run& run, const MapResult& map) {
  std::vector<ColoredPoint> points;
  for (const KeptLandmark& landmark : map.whole.landmarks) {
    const auto frame = static_cast<std::size_t>(landmark.frame);
    const Similarity3& placed = map.whole.map_from_frame[frame];
    const Eigen::Vector3d in_camera = placed.scale *
                                      stretch_at(map.whole.map_from_frame, map.trajectory, frame) *
                                      landmark.in_camera.cast<double>();
    points.push_back({(map.trajectory[frame] * in_camera).cast<float>(), landmark.rgb});
  }
  return stemvo::write_map_ply(run.request.out_dir / "map.ply", points, map.trajectory);
}

}  // namespace stemvo::pipeline
