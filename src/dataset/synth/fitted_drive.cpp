// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>

#include "dataset/synth/drive.hpp"

namespace stemvo::synth {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr double kJump_m = 12.0;       // a step no car makes in 0.1 s
constexpr double kJump_m_s = 120.0;    // and in longer intervals
constexpr double kMinAdvance_m = 0.3;  // less is standing, turning on the spot, or reversing
constexpr double kFine_m = 0.25;       // spacing while smoothing

/// One camera that moved the path on.
struct Key {
  Eigen::Vector3d position;
  Eigen::Vector3d forward;
  Eigen::Vector3d up;
};

Key key_of(const Rigid3& world_from_camera) {
  const Eigen::Matrix3d r = world_from_camera.rotation_matrix();
  return {world_from_camera.translation, r.col(2), -r.col(1)};
}

std::vector<Key> keys_of(std::span<const Rigid3> poses) {
  std::vector<Key> keys = {key_of(poses.front())};
  for (const Rigid3& pose : poses) {
    const Key key = key_of(pose);
    const Eigen::Vector3d step = key.position - keys.back().position;
    if (step.dot(key.forward + keys.back().forward) > 2.0 * kMinAdvance_m) {
      keys.push_back(key);
    }
  }
  return keys;
}

/// Mean weighted by a Gaussian of `sigma` samples.
Points smooth(const Points& points, double sigma) {
  const int n = static_cast<int>(points.size());
  const int reach = static_cast<int>(std::ceil(3.0 * sigma));
  std::vector<double> weights;
  for (int k = -reach; k <= reach; ++k) {
    weights.push_back(std::exp(-0.5 * k * k / (sigma * sigma)));
  }
  Points result(points.size());
  for (int i = 0; i < n; ++i) {
    // At the ends the window shrinks evenly, so that a straight line stays where it is.
    const int span = std::min({reach, i, n - 1 - i});
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double total = 0.0;
    for (int k = -span; k <= span; ++k) {
      const double weight = weights[static_cast<std::size_t>(k + reach)];
      sum += weight * points[static_cast<std::size_t>(i + k)];
      total += weight;
    }
    result[static_cast<std::size_t>(i)] = sum / total;
  }
  return result;
}

/// A polyline with an up direction, walked at equal steps.
struct Path {
  Points points;
  Points ups;
};

Path resample(const Path& from, double spacing_m) {
  Path to;
  double left_m = 0.0;  // from the last sample to the start of this edge, as a debt
  for (std::size_t i = 0; i + 1 < from.points.size(); ++i) {
    const Eigen::Vector3d edge = from.points[i + 1] - from.points[i];
    const double length_m = edge.norm();
    for (; left_m < length_m; left_m += spacing_m) {
      const double t = left_m / length_m;
      to.points.push_back(from.points[i] + t * edge);
      to.ups.push_back(((1.0 - t) * from.ups[i] + t * from.ups[i + 1]).normalized());
    }
    left_m -= length_m;
  }
  return to;
}

/// The keys, prolonged straight on both sides.
Path prolong(const std::vector<Key>& keys) {
  const auto direction = [&](std::size_t from, std::size_t to, const Key& end) {
    const Eigen::Vector3d along = keys[to].position - keys[from].position;
    return along.norm() > 1.0 ? along.normalized() : end.forward;
  };
  const std::size_t last = keys.size() - 1;
  const std::size_t reach = std::min<std::size_t>(4, last);
  const Key& first = keys.front();
  const Key& end = keys.back();
  Path path;
  path.points.push_back(first.position - (kRoadBehind_m + 10.0) * direction(0, reach, first));
  path.ups.push_back(first.up);
  for (const Key& key : keys) {
    path.points.push_back(key.position);
    path.ups.push_back(key.up);
  }
  path.points.push_back(end.position + (kRoadAhead_m + 10.0) * direction(last - reach, last, end));
  path.ups.push_back(end.up);
  return path;
}

/// The path is followed closely to the sides (2 m), loosely in height (7 m) and bank (10 m): that
/// is what is left of bounce, pitch and roll once the road is taken away.
RoadCurve fit_road(const std::vector<Key>& keys) {
  const Path fine = resample(prolong(keys), kFine_m);
  const Points ups = smooth(fine.ups, 10.0 / kFine_m);
  const Points close = smooth(fine.points, 2.0 / kFine_m);
  const Points loose = smooth(fine.points, 7.0 / kFine_m);
  Path ground;
  for (std::size_t i = 0; i < ups.size(); ++i) {
    const Eigen::Vector3d up = ups[i].normalized();
    const double height_m = up.dot(loose[i] - close[i]) - kCameraHeight_m;
    ground.points.push_back(close[i] + height_m * up);
    ground.ups.push_back(up);
  }
  const Path knots = resample(ground, kKnotSpacing_m);
  return {knots.points, knots.ups};
}

}  // namespace

Drive make_drive_along(const Trajectory& world_from_camera, double rate_hz) {
  const double jump_m = std::max(kJump_m, kJump_m_s / rate_hz);
  Drive drive;
  drive.world_from_camera = world_from_camera;
  for (std::size_t begin = 0; begin < world_from_camera.size();) {
    std::size_t end = begin + 1;
    while (end < world_from_camera.size() &&
           (world_from_camera[end].translation - world_from_camera[end - 1].translation).norm() <=
               jump_m) {
      ++end;
    }
    const auto poses = std::span(world_from_camera).subspan(begin, end - begin);
    drive.roads.push_back(fit_road(keys_of(poses)));
    double arc_m = kRoadBehind_m + 10.0;
    for (const Rigid3& pose : poses) {
      arc_m = drive.roads.back().nearest(pose.translation, arc_m, 2.0 * jump_m);
      drive.places.push_back({drive.roads.size() - 1, arc_m});
    }
    begin = end;
  }
  return drive;
}

}  // namespace stemvo::synth
