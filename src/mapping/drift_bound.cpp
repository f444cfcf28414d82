// SPDX-License-Identifier: MIT
#include "mapping/drift_bound.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace stemvo {
namespace {

/// So many standard deviations: motions err alike, and no true loop is to be refused.
constexpr double kFactor = 5.0;
/// Variance of a rotation, or of a log scale, that nobody knows.
constexpr double kUnknown = 1.0;

/// Variances of where one keyframe lies to another one.
struct Drift {
  double rotation = 0.0;
  double log_scale = 0.0;
  double shift = 0.0;           ///< squared units of the map, but for what errors of scale bring
  double shift_by_scale = 0.0;  ///< the same
  double path = 0.0;            ///< units of the map
  int num_motions = 0;
};

/// Each motion's errors move the end by their lever arm.
Drift drift_along(const KeptMap& graph, const MapEdge& loop) {
  const auto pose_of = [&](int node) -> const Similarity3& {
    return graph.map_from_keyframe.at(static_cast<std::size_t>(node));
  };
  const auto square = [](double value) { return value * value; };
  const Eigen::Vector3d end = pose_of(loop.to).translation;
  Drift drift;
  for (const MapEdge& motion : graph.motions) {
    if (motion.from < loop.from || motion.to > loop.to) {
      continue;
    }
    const Similarity3& from = pose_of(motion.from);
    const double arm = (end - from.translation).norm();
    drift.rotation += square(motion.sigma_rad);
    drift.log_scale += square(motion.sigma_log_scale);
    drift.shift += square(from.scale * motion.sigma_translation) + square(motion.sigma_rad * arm);
    drift.shift_by_scale += square(motion.sigma_log_scale * arm);
    drift.path += (pose_of(motion.to).translation - from.translation).norm();
    ++drift.num_motions;
  }
  double sigma_length = 0.0;
  for (const MapLength& length : graph.lengths) {
    if (length.keyframe >= loop.from && length.keyframe <= loop.to) {
      sigma_length = std::max(sigma_length, length.sigma);
    }
  }
  if (sigma_length > 0.0) {
    drift.log_scale = std::min(drift.log_scale, 2.0 * square(sigma_length));
    drift.shift_by_scale = std::min(drift.shift_by_scale, square(sigma_length * drift.path));
  }
  return drift;
}

}  // namespace

bool is_within_drift(const KeptMap& graph, const MapEdge& loop) {
  const Drift drift = drift_along(graph, loop);
  if (drift.num_motions < loop.to - loop.from ||
      std::max(drift.rotation, drift.log_scale) >= kUnknown) {
    return true;
  }
  const Similarity3& old = graph.map_from_keyframe[static_cast<std::size_t>(loop.from)];
  const Similarity3 told =
      old.inverse() * graph.map_from_keyframe[static_cast<std::size_t>(loop.to)];
  const auto is_small = [](double error, double sigma_of_loop, double variance) {
    return error <= kFactor * std::hypot(sigma_of_loop, std::sqrt(variance));
  };
  return is_small(told.rotation.angularDistance(loop.from_to.rotation), loop.sigma_rad,
                  drift.rotation) &&
         is_small(std::abs(std::log(told.scale / loop.from_to.scale)), loop.sigma_log_scale,
                  drift.log_scale) &&
         is_small(old.scale * (told.translation - loop.from_to.translation).norm(),
                  old.scale * loop.sigma_translation, drift.shift + drift.shift_by_scale);
}

}  // namespace stemvo
