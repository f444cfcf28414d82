// SPDX-License-Identifier: MIT
#include "odometry/bundle_adjustment.hpp"

#include <deque>
#include <memory>
#include <vector>

#include <ceres/ceres.h>

#include "odometry/reprojection_cost.hpp"

namespace stemvo {
namespace {

/// A keyframe's part of one solve: camera_from_world = exp(w) rotation, t; change = (w, t).
struct PoseBlock {
  Eigen::Matrix3d rotation;
  Eigen::Matrix<double, 6, 1> change;

  explicit PoseBlock(const Rigid3& camera_from_world)
      : rotation(camera_from_world.rotation_matrix()) {
    change << Eigen::Vector3d::Zero(), camera_from_world.translation;
  }
  [[nodiscard]] Rigid3 camera_from_world() const {
    return {so3_exp(change.head<3>()) * Eigen::Quaterniond(rotation), change.tail<3>()};
  }
};

struct PointBlock {
  int track_id;
  Eigen::Vector3d point;
  int num_observations = 0;
  bool is_in_front = true;  ///< of every keyframe that sees it
};

/// Everything the solver changes; the map takes it over only where it succeeds.
struct Window {
  std::vector<PoseBlock> poses;
  std::vector<PointBlock> points;  ///< ordered by track id
};

/// Calls use(keyframe, observation, point) for every observation of a landmark; both lists are
/// ordered by track id.
template <typename Use>
void for_each_observation(const LocalMap& map, std::vector<PointBlock>& points, const Use& use) {
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    auto point = points.begin();
    for (const MapObservation& observation : map.keyframes[i].observations) {
      while (point != points.end() && point->track_id < observation.track_id) {
        ++point;
      }
      if (point != points.end() && point->track_id == observation.track_id) {
        use(i, observation, *point);
      }
    }
  }
}

Window open_window(const LocalMap& map, const BundleAdjustmentOptions& options) {
  Window window;
  for (const Keyframe& keyframe : map.keyframes) {
    window.poses.emplace_back(keyframe.world_from_camera.inverse());
  }
  for (const auto& [track_id, point] : map.landmarks) {
    window.points.push_back({track_id, point});
  }
  for_each_observation(
      map, window.points, [&](std::size_t keyframe, const MapObservation&, PointBlock& point) {
        const PoseBlock& pose = window.poses[keyframe];
        const double depth = pose.rotation.row(2).dot(point.point) + pose.change[5];
        point.is_in_front = point.is_in_front && depth > ReprojectionCost::kMinDepth;
        ++point.num_observations;
      });
  std::erase_if(window.points, [&](const PointBlock& point) {  // the solver must start somewhere
    return point.num_observations < options.min_observations || !point.is_in_front;
  });
  return window;
}

/// Adds a residual per observation; every block's order is fixed, so the result is too. Returns the
/// costs, which must outlive the problem: it would keep a tree of those it had to free.
std::deque<ReprojectionCost> add_residuals(const LocalMap& map,
                                           const Camera& camera,
                                           ceres::LossFunction* loss,
                                           Window& window,
                                           ceres::Problem& problem) {
  std::deque<ReprojectionCost> costs;
  for_each_observation(
      map, window.points,
      [&](std::size_t keyframe, const MapObservation& observation, PointBlock& point) {
        PoseBlock& pose = window.poses[keyframe];
        problem.AddResidualBlock(&costs.emplace_back(camera, pose.rotation, observation.uv), loss,
                                 pose.change.data(), point.point.data());
      });
  return costs;
}

ceres::Solver::Options solver_options(const BundleAdjustmentOptions& options,
                                      Window& window,
                                      ceres::Problem& problem) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.max_num_iterations = options.max_iterations;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  solver.function_tolerance = 1e-5;
  // Turns, shifts and points are of like size here, and it would pass twice over the Jacobian.
  solver.jacobi_scaling = false;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (PointBlock& point : window.points) {
    ordering->AddElementToGroup(point.point.data(), 0);
  }
  for (std::size_t i = 0; i < window.poses.size(); ++i) {
    double* pose = window.poses[i].change.data();
    if (problem.HasParameterBlock(pose)) {
      ordering->AddElementToGroup(pose, 1);
      if (static_cast<int>(i) < options.num_fixed_keyframes) {
        problem.SetParameterBlockConstant(pose);
      }
    }
  }
  solver.linear_solver_ordering = ordering;
  return solver;
}

void write_back(const Window& window, LocalMap& map) {
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    map.keyframes[i].world_from_camera = window.poses[i].camera_from_world().inverse();
  }
  for (const PointBlock& point : window.points) {
    map.landmarks[point.track_id] = point.point;
  }
}

}  // namespace

BundleAdjustmentReport refine_window(LocalMap& map,
                                     const Camera& camera,
                                     const BundleAdjustmentOptions& options) {
  BundleAdjustmentReport report;
  if (static_cast<int>(map.keyframes.size()) <= options.num_fixed_keyframes) {
    return report;
  }
  Window window = open_window(map, options);
  ceres::CauchyLoss loss(options.loss_scale_px);
  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.disable_all_safety_checks = true;
  ceres::Problem problem(problem_options);
  const auto costs = add_residuals(map, camera, &loss, window, problem);
  report.num_residuals = static_cast<int>(costs.size());
  if (report.num_residuals == 0) {
    return report;
  }
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options(options, window, problem), &problem, &summary);
  report.num_iterations = static_cast<int>(summary.iterations.size());
  report.initial_cost = summary.initial_cost;
  report.final_cost = summary.final_cost;
  report.is_usable = summary.IsSolutionUsable();
  if (report.is_usable) {
    write_back(window, map);
  }
  return report;
}

}  // namespace stemvo
