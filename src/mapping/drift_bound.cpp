// SPDX-License-Identifier: MIT
#include "mapping/drift_bound.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "mapping/map_merge.hpp"
#include "mapping/pose_graph.hpp"

namespace stemvo {
namespace {

/// So many standard deviations: motions err alike, and no true loop is to be refused.
constexpr double kFactor = 5.0;
/// Variance of a rotation, or of a log scale, that nobody knows.
constexpr double kUnknown = 1.0;
/// The graph has taken a loop in that is off by less, all seven errors together.
constexpr double kMaxLoopSigmas = 5.0;

/// Variances of where one keyframe lies to another one.
struct Drift {
  double rotation = 0.0;
  double log_scale = 0.0;
  double shift = 0.0;           ///< squared units of the map, but for what errors of scale bring
  double shift_by_scale = 0.0;  ///< the same
  double path = 0.0;            ///< units of the map
};

/// The edges that tell best how `to` lies to `from`, each in the direction of the way; empty: none
/// do. Loops count that the graph has taken in.
std::vector<MapEdge> surest_way(const KeptMap& graph, int from, int to) {
  std::vector<std::vector<const MapEdge*>> edges_of(graph.map_from_keyframe.size());
  const auto add = [&](const MapEdge& edge) {
    edges_of.at(slot(edge.from)).push_back(&edge);
    edges_of.at(slot(edge.to)).push_back(&edge);
  };
  std::ranges::for_each(graph.motions, add);
  for (const Loop& loop : graph.loops) {
    if (sigmas_off(graph, loop) < kMaxLoopSigmas) {
      add(loop);
    }
  }
  struct Reached {
    double variance = std::numeric_limits<double>::infinity();
    const MapEdge* by = nullptr;
  };
  std::vector<Reached> reached(edges_of.size());
  std::set<std::pair<double, int>> next{{0.0, from}};
  reached[slot(from)].variance = 0.0;
  while (!next.empty() && next.begin()->second != to) {
    const auto [variance, node] = *next.begin();
    next.erase(next.begin());
    for (const MapEdge* edge : edges_of[slot(node)]) {
      const int other = edge->from == node ? edge->to : edge->from;
      Reached& known = reached[slot(other)];
      const double through = variance + edge->sigma_rad * edge->sigma_rad +
                             edge->sigma_log_scale * edge->sigma_log_scale;
      if (through < known.variance) {
        next.erase({known.variance, other});
        known = {through, edge};
        next.emplace(through, other);
      }
    }
  }
  std::vector<MapEdge> way;
  int node = to;
  while (const MapEdge* edge = reached[slot(node)].by) {
    way.push_back(edge->to == node ? *edge : reversed(*edge));
    node = way.back().from;
  }
  std::ranges::reverse(way);
  return way;
}

/// Each motion's errors move the end by their lever arm.
Drift drift_along(const KeptMap& graph, const std::vector<MapEdge>& way, const MapEdge& loop) {
  const auto pose_of = [&](int node) -> const Similarity3& {
    return graph.map_from_keyframe.at(slot(node));
  };
  const auto square = [](double value) { return value * value; };
  const Eigen::Vector3d end = pose_of(loop.to).translation;
  Drift drift;
  for (const MapEdge& motion : way) {
    const Similarity3& from = pose_of(motion.from);
    const double arm = (end - from.translation).norm();
    drift.rotation += square(motion.sigma_rad);
    drift.log_scale += square(motion.sigma_log_scale);
    drift.shift += square(from.scale * motion.sigma_translation) + square(motion.sigma_rad * arm);
    drift.shift_by_scale += square(motion.sigma_log_scale * arm);
    drift.path += (pose_of(motion.to).translation - from.translation).norm();
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
  const std::vector<MapEdge> way = surest_way(graph, loop.from, loop.to);
  const Drift drift = drift_along(graph, way, loop);
  if (way.empty() || std::max(drift.rotation, drift.log_scale) >= kUnknown) {
    return true;
  }
  const Similarity3& old = graph.map_from_keyframe[slot(loop.from)];
  const Similarity3 told = old.inverse() * graph.map_from_keyframe[slot(loop.to)];
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
