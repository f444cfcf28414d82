// SPDX-License-Identifier: MIT
#include "odometry/bundle_adjustment.hpp"

#include <algorithm>
#include <map>
#include <memory>
#include <vector>

#include <ceres/ceres.h>

#include "odometry/reprojection_cost.hpp"

namespace stemvo {
namespace {

/// The parameter blocks of one solve.
struct Parameters {
  std::vector<Rigid3> cameras_from_world;
  std::map<int, Eigen::Vector3d> points;
};

std::map<int, int> count_observations(const LocalMap& map) {
  std::map<int, int> counts;
  for (const Keyframe& keyframe : map.keyframes) {
    for (const MapObservation& observation : keyframe.observations) {
      ++counts[observation.track_id];
    }
  }
  return counts;
}

Parameters collect(const LocalMap& map, const BundleAdjustmentOptions& options) {
  Parameters parameters;
  for (const Keyframe& keyframe : map.keyframes) {
    parameters.cameras_from_world.push_back(keyframe.world_from_camera.inverse());
  }
  const std::map<int, int> counts = count_observations(map);
  for (const auto& [track_id, point] : map.landmarks) {
    const auto count = counts.find(track_id);
    if (count != counts.end() && count->second >= options.min_observations) {
      parameters.points.emplace(track_id, point);
    }
  }
  return parameters;
}

/// Adds a residual per observation; every block's order is fixed, so the result is too.
int add_residuals(const LocalMap& map,
                  const Camera& camera,
                  ceres::LossFunction* loss,
                  Parameters& parameters,
                  ceres::Problem& problem) {
  int num_residuals = 0;
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    Rigid3& pose = parameters.cameras_from_world[i];
    for (const MapObservation& observation : map.keyframes[i].observations) {
      const auto point = parameters.points.find(observation.track_id);
      if (point == parameters.points.end()) {
        continue;
      }
      auto* cost = new ceres::AutoDiffCostFunction<ReprojectionCost, 2, 4, 3, 3>(
          new ReprojectionCost{camera, observation.uv});  // the problem takes it
      problem.AddResidualBlock(cost, loss, pose.rotation.coeffs().data(), pose.translation.data(),
                               point->second.data());
      ++num_residuals;
    }
  }
  return num_residuals;
}

void fix_gauge(const BundleAdjustmentOptions& options,
               ceres::Manifold* quaternions,
               Parameters& parameters,
               ceres::Problem& problem) {
  for (std::size_t i = 0; i < parameters.cameras_from_world.size(); ++i) {
    Rigid3& pose = parameters.cameras_from_world[i];
    double* rotation = pose.rotation.coeffs().data();
    if (!problem.HasParameterBlock(rotation)) {
      continue;
    }
    problem.SetManifold(rotation, quaternions);
    if (static_cast<int>(i) < options.num_fixed_keyframes) {
      problem.SetParameterBlockConstant(rotation);
      problem.SetParameterBlockConstant(pose.translation.data());
    }
  }
}

ceres::Solver::Options solver_options(const BundleAdjustmentOptions& options,
                                      Parameters& parameters,
                                      const ceres::Problem& problem) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.max_num_iterations = options.max_iterations;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  solver.function_tolerance = 1e-5;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (auto& [track_id, point] : parameters.points) {
    if (problem.HasParameterBlock(point.data())) {
      ordering->AddElementToGroup(point.data(), 0);
    }
  }
  for (Rigid3& pose : parameters.cameras_from_world) {
    if (problem.HasParameterBlock(pose.translation.data())) {
      ordering->AddElementToGroup(pose.rotation.coeffs().data(), 1);
      ordering->AddElementToGroup(pose.translation.data(), 1);
    }
  }
  solver.linear_solver_ordering = ordering;
  return solver;
}

void write_back(const Parameters& parameters, LocalMap& map) {
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    const Rigid3& pose = parameters.cameras_from_world[i];
    map.keyframes[i].world_from_camera = Rigid3(pose.rotation, pose.translation).inverse();
  }
  for (const auto& [track_id, point] : parameters.points) {
    map.landmarks[track_id] = point;
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
  Parameters parameters = collect(map, options);
  ceres::CauchyLoss loss(options.loss_scale_px);
  ceres::EigenQuaternionManifold quaternions;
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  report.num_residuals = add_residuals(map, camera, &loss, parameters, problem);
  if (report.num_residuals == 0) {
    return report;
  }
  fix_gauge(options, &quaternions, parameters, problem);
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options(options, parameters, problem), &problem, &summary);
  report.num_iterations = static_cast<int>(summary.iterations.size());
  report.initial_cost = summary.initial_cost;
  report.final_cost = summary.final_cost;
  report.is_usable = summary.IsSolutionUsable();
  if (report.is_usable) {
    write_back(parameters, map);
  }
  return report;
}

}  // namespace stemvo
