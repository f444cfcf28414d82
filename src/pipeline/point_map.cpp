// SPDX-License-Identifier: MIT
#include <algorithm>
#include <vector>

#include "internal_check.hpp"
#include "pipeline/result_files.hpp"
#include "report/map_ply.hpp"

namespace stemvo::pipeline {
namespace {

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

}  // namespace

Status write_point_map(const std::filesystem::path& out_dir,
                       std::span<const MapLandmark> landmarks,
                       std::span<const Rigid3> refined,
                       std::span<const Rigid3> written) {
  STEMVO_CHECK(refined.size() == written.size(), "the same poses, before and after rescaling");
  std::vector<ColoredPoint> points;
  points.reserve(landmarks.size());
  for (const MapLandmark& landmark : landmarks) {
    const auto frame = static_cast<std::size_t>(landmark.frame);
    STEMVO_CHECK(frame < written.size(), "landmarks belong to frames");
    const Eigen::Vector3d in_camera =
        stretch_at(refined, written, frame) * landmark.position.cast<double>();
    points.push_back({(written[frame] * in_camera).cast<float>(), landmark.rgb});
  }
  return write_map_ply(out_dir / "map.ply", points, written);
}

}  // namespace stemvo::pipeline
