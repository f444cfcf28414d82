// SPDX-License-Identifier: MIT
#include "mapping/pose_graph.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include "odometry/scale_filter.hpp"

namespace stemvo {
namespace {

/// A loop that is off by more sigmas, all seven errors together, loses its pull.
constexpr double kLoopLoss = 3.0;
/// Far more than drift brings.
constexpr double kNoLoss = 1e6;

/// A similarity as Ceres moves it: log scale, quaternion (x, y, z, w), translation.
using Node = std::array<double, 8>;
using NodeManifold = ceres::ProductManifold<ceres::EuclideanManifold<1>,
                                            ceres::EigenQuaternionManifold,
                                            ceres::EuclideanManifold<3>>;

Node node_of(const Similarity3& at) {
  const Eigen::Quaterniond& q = at.rotation;
  const Eigen::Vector3d& t = at.translation;
  return {std::log(at.scale), q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
}

Similarity3 similarity_of(const Node& node) {
  return {std::exp(node[0]), Eigen::Quaterniond(&node[1]), Eigen::Vector3d(&node[5])};
}

/// Errors of a motion in its sigmas: scale, rotation, translation in the unit of `from`.
struct MotionError {
  const MapEdge& edge;

  template <typename T>
  bool operator()(const T* from, const T* to, T* residual) const {
    using Quaternion = Eigen::Quaternion<T>;
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Quaternion> map_from_from(from + 1);
    const Eigen::Map<const Quaternion> map_from_to(to + 1);
    const Vector way = Eigen::Map<const Vector>(to + 5) - Eigen::Map<const Vector>(from + 5);
    residual[0] = (to[0] - from[0] - std::log(edge.from_to.scale)) / edge.sigma_log_scale;
    const Quaternion turn = edge.from_to.rotation.conjugate().template cast<T>() *
                            (map_from_from.conjugate() * map_from_to);
    const T wxyz[] = {turn.w(), turn.x(), turn.y(), turn.z()};
    ceres::QuaternionToAngleAxis(wxyz, residual + 1);
    Eigen::Map<Vector>(residual + 4) = map_from_from.conjugate() * way * exp(-from[0]) -
                                       edge.from_to.translation.template cast<T>();
    for (int i = 1; i < 7; ++i) {
      residual[i] /= i < 4 ? edge.sigma_rad : edge.sigma_translation;
    }
    return true;
  }
};

/// The unit of a keyframe as it was measured.
struct LengthError {
  MapLength length;

  template <typename T>
  bool operator()(const T* node, T* residual) const {
    residual[0] = (node[0] - length.log_metres_per_unit) / length.sigma;
    return true;
  }
};

ceres::Problem::Options shared_parts() {
  ceres::Problem::Options options;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  return options;
}

/// The graph as Ceres sees it. `map` outlives it.
class Graph {
 public:
  explicit Graph(const KeptMap& map) : problem_(shared_parts()) {
    std::ranges::transform(map.map_from_keyframe, std::back_inserter(nodes_), node_of);
    for (Node& node : nodes_) {
      problem_.AddParameterBlock(node.data(), 8, &manifold_);
    }
    problem_.SetManifold(nodes_.front().data(), &scale_alone_);
    if (map.lengths.empty()) {
      problem_.SetParameterBlockConstant(nodes_.front().data());
    }
    for (const MapEdge& edge : map.motions) {
      add(edge, nullptr);
    }
    for (const Loop& loop : map.loops) {
      add(loop, &loop_loss_);
    }
    for (std::size_t i = 0; i < map.lengths.size(); ++i) {
      MapLength length = map.lengths[i];
      length.sigma = independent_sigma(map, i);
      problem_.AddResidualBlock(
          new ceres::AutoDiffCostFunction<LengthError, 1, 8>(new LengthError{length}), nullptr,
          nodes_.at(slot(length.keyframe)).data());
    }
  }

  /// With loops that are off by `loop_loss` sigmas losing their pull; false: not solved.
  bool solve(double loop_loss) {
    loop_loss_.Reset(new ceres::CauchyLoss(loop_loss), ceres::TAKE_OWNERSHIP);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;  // same bytes with any BLAS
    options.max_num_iterations = 50;
    options.function_tolerance = 1e-4;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    return summary.IsSolutionUsable();
  }

  [[nodiscard]] std::vector<Similarity3> similarities() const {
    std::vector<Similarity3> result;
    std::ranges::transform(nodes_, std::back_inserter(result), similarity_of);
    return result;
  }

 private:
  void add(const MapEdge& edge, ceres::LossFunction* loss) {
    problem_.AddResidualBlock(
        new ceres::AutoDiffCostFunction<MotionError, 7, 8, 8>(new MotionError{edge}), loss,
        nodes_.at(slot(edge.from)).data(), nodes_.at(slot(edge.to)).data());
  }

  std::vector<Node> nodes_;
  NodeManifold manifold_;
  ceres::SubsetManifold scale_alone_{8, {1, 2, 3, 4, 5, 6, 7}};
  ceres::LossFunctionWrapper loop_loss_{nullptr, ceres::TAKE_OWNERSHIP};
  ceres::Problem problem_;
};

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
    if (sigmas_off(graph, loop) < kMaxTakenInSigmas) {
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
  const auto square = [](double value) { return value * value; };
  const Eigen::Vector3d end = graph.pose(loop.to).translation;
  Drift drift;
  for (const MapEdge& motion : way) {
    const Similarity3& from = graph.pose(motion.from);
    const double arm = (end - from.translation).norm();
    drift.rotation += square(motion.sigma_rad);
    drift.log_scale += square(motion.sigma_log_scale);
    drift.shift += square(from.scale * motion.sigma_translation) + square(motion.sigma_rad * arm);
    drift.shift_by_scale += square(motion.sigma_log_scale * arm);
    drift.path += (graph.pose(motion.to).translation - from.translation).norm();
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

double independent_sigma(const KeptMap& map, std::size_t length) {
  const auto time_of = [&](const MapLength& one) {
    return map.keyframes.at(slot(one.keyframe)).time_s;
  };
  const MapLength& at = map.lengths[length];
  const double interval_s = length > 0 ? time_of(at) - time_of(map.lengths[length - 1]) : 0.0;
  // A steady filter of a random walk forgets by 1 / e in memory_s.
  const double memory_s = at.sigma * at.sigma / (kScaleDrift * kScaleDrift);
  return interval_s > 0.0 ? at.sigma * std::sqrt(std::max(1.0, 2.0 * memory_s / interval_s))
                          : at.sigma;
}

double sigmas_off(const KeptMap& map, const MapEdge& edge) {
  const Node from = node_of(map.pose(edge.from));
  const Node to = node_of(map.pose(edge.to));
  Eigen::Matrix<double, 7, 1> error;
  MotionError{edge}(from.data(), to.data(), error.data());
  return error.norm();
}

bool solve_pose_graph(KeptMap& map) {
  if (map.keyframes.size() < 2 || (map.loops.empty() && map.lengths.empty())) {
    return false;
  }
  Graph graph(map);
  // From far away the loss would let go of true loops: drift is many sigmas of a loop.
  if (!graph.solve(kNoLoss) || !graph.solve(kLoopLoss)) {
    return false;
  }
  map.map_from_keyframe = graph.similarities();
  return true;
}

bool is_within_drift(const KeptMap& graph, const MapEdge& loop) {
  const std::vector<MapEdge> way = surest_way(graph, loop.from, loop.to);
  const Drift drift = drift_along(graph, way, loop);
  if (way.empty() || std::max(drift.rotation, drift.log_scale) >= kUnknown) {
    return true;
  }
  const Similarity3& old = graph.pose(loop.from);
  const Similarity3 told = old.inverse() * graph.pose(loop.to);
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
