// SPDX-License-Identifier: MIT
#include "odometry/road/region.hpp"

#include <algorithm>

namespace stemvo {
namespace {
constexpr double kMaxAngle_rad = 1.0;  ///< beyond it nobody knows how the turn goes on
constexpr int kBorder_px = 4;
constexpr int kCoarse = 8;  ///< the ends of a row are looked for at every 8th sample
/// atan2(ahead, beside), ahead >= 0; by its series, to 1e-6, where it is small as nearly always.
double arc_angle(double ahead, double beside) {
  const double t = ahead / beside;
  if (!(beside > 0.0 && t < 0.3)) {
    return std::atan2(ahead, beside);
  }
  const double tt = t * t;
  return t * (1.0 - tt * (1.0 / 3.0 - tt * (1.0 / 5.0 - tt / 7.0)));
}

}  // namespace

RoadRegion::RoadRegion(const Rigid3& cur_from_prev,
                       const RoadPrior& prior,
                       const RoadOptions& options)
    : plane_(road_plane(0.0, prior.slope_rad, prior.roll_rad, options.camera_height_m)),
      half_width_m_(options.half_width_m),
      far_m_(options.far_m) {
  const Eigen::Vector3d& t = cur_from_prev.translation;
  const double step_m = t.norm() * std::exp(prior.log_scale);
  // Turning right is a positive rotation about y (down) of the current camera against the previous.
  const double yaw_rad = -so3_log(cur_from_prev.rotation).y();
  if (step_m > 0.1 && t.z() < 0.0) {
    curvature_ = std::clamp(yaw_rad / step_m, -0.15, 0.15);
    // The chord from one frame to the next points half the turn away from the tangent.
    heading_ = std::clamp(t.x() / t.z() + 0.5 * yaw_rad, -0.3, 0.3);
  }
}

Eigen::Vector2d RoadRegion::on_ground(const Eigen::Vector2d& xy) const {
  const double inverse_z = plane_.dot(xy.homogeneous());
  if (!(inverse_z > 1e-3)) {
    return {0.0, -1.0};
  }
  const double z = 1.0 / inverse_z;
  // Lateral distance from the arc that starts here, and the length driven on it until there.
  const double x = xy.x() * z - heading_ * z;
  if (std::abs(curvature_) < 1e-4) {
    return {x, z};
  }
  // The arc's centre lies at x = 1 / k; multiplied by k, nothing grows where it is nearly straight.
  const double ahead = curvature_ * z;
  const double beside = 1.0 - curvature_ * x;
  const double angle = arc_angle(std::abs(ahead), beside);
  if (angle > kMaxAngle_rad) {
    return {0.0, -1.0};
  }
  const double distance = std::sqrt(beside * beside + ahead * ahead);
  return {(2.0 * x - curvature_ * (x * x + z * z)) / (1.0 + distance),
          angle / std::abs(curvature_)};
}

std::vector<RoadRegion::Sample> RoadRegion::samples(const RoadImage::Level& level,
                                                    int step_u,
                                                    int step_v) const {
  std::vector<Sample> result;
  const Camera& camera = level.camera;
  const int last_row = camera.height_px - kBorder_px;
  const double far_row = camera.cy_px + camera.fy_px * (1.0 / far_m_ - plane_.z()) / plane_.y();
  if (!(far_row > -1e6 && far_row < last_row)) {
    return result;
  }
  const int row0 = std::max(level.first_row + kBorder_px, static_cast<int>(far_row));
  const int tile_rows = kTiles / kTileColumns;
  for (int v = row0; v < last_row; v += step_v) {
    const int tile_row = tile_rows * (v - row0) / std::max(1, last_row - row0);
    const auto ground_at = [&](int u) { return on_ground(camera.normalize({u, v})); };
    int first = camera.width_px;
    int last = -1;
    for (int u = kBorder_px; u < camera.width_px - kBorder_px; u += kCoarse * step_u) {
      if (contains(ground_at(u))) {
        first = std::min(first, u);
        last = u;
      }
    }
    first = std::max(kBorder_px, first - kCoarse * step_u);
    last = std::min(camera.width_px - kBorder_px, last + kCoarse * step_u);
    for (int u = first; u < last; u += step_u) {
      const Eigen::Vector2d ground = ground_at(u);
      if (!contains(ground) || level.hides(u, v)) {
        continue;
      }
      const double across = (ground.x() + half_width_m_) / (2.0 * half_width_m_);
      const int tile_column =
          std::clamp(static_cast<int>(across * kTileColumns), 0, kTileColumns - 1);
      result.push_back({u, v, tile_row * kTileColumns + tile_column});
    }
  }
  return result;
}

}  // namespace stemvo
