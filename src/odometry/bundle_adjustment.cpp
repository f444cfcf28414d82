// SPDX-License-Identifier: MIT
#include "odometry/bundle_adjustment.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include <ceres/ceres.h>

#include "geometry/median.hpp"

namespace stemvo {
namespace {

/// exp(w) and the left Jacobian J of SO(3), exp(w + d) = exp(J d) exp(w) for small d (Solà,
/// Deray, Atchuthan: A micro Lie theory, 2018, eqs. 134 and 145).
struct RotationChange {
  explicit RotationChange(const Eigen::Vector3d& w) {
    const double angle_sq = w.squaredNorm();
    const double angle = std::sqrt(angle_sq);
    const bool is_small = angle_sq < 1e-8;  // the next terms of the series are below 1e-10
    const double a = is_small ? 1.0 - angle_sq / 6.0 : std::sin(angle) / angle;
    const double b = is_small ? 0.5 - angle_sq / 24.0 : (1.0 - std::cos(angle)) / angle_sq;
    const double c = is_small ? 1.0 / 6.0 - angle_sq / 120.0 : (1.0 - a) / angle_sq;
    const Eigen::Matrix3d hat = skew(w);
    const Eigen::Matrix3d hat_sq = hat * hat;
    rotation = Eigen::Matrix3d::Identity() + a * hat + b * hat_sq;
    jacobian = Eigen::Matrix3d::Identity() + b * hat + c * hat_sq;
  }
  Eigen::Matrix3d rotation;
  Eigen::Matrix3d jacobian;
};

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
  bool is_in_front = true;    ///< of every keyframe that sees it
  bool moves_a_pose = false;  ///< seen from a keyframe that is not fixed
};

/// Everything the solver changes; the window takes it over only where it succeeds.
struct Unknowns {
  std::vector<PoseBlock> poses;
  std::vector<PointBlock> points;  ///< ordered by track id
};

/// Calls use(keyframe, observation, point) for every observation of a landmark; both lists are
/// ordered by track id.
template <typename Use>
void for_each_observation(const Window& window, std::vector<PointBlock>& points, const Use& use) {
  for (std::size_t i = 0; i < window.keyframes.size(); ++i) {
    auto point = points.begin();
    for (const TrackPoint& observation : window.keyframes[i].points) {
      while (point != points.end() && point->track_id < observation.track_id) {
        ++point;
      }
      if (point != points.end() && point->track_id == observation.track_id) {
        use(i, observation, *point);
      }
    }
  }
}

Unknowns read_unknowns(const Window& window, const BundleAdjustmentOptions& options) {
  Unknowns unknowns;
  for (const Keyframe& keyframe : window.keyframes) {
    unknowns.poses.emplace_back(keyframe.world_from_camera.inverse());
  }
  for (const auto& [track_id, point] : window.landmarks) {
    unknowns.points.push_back({track_id, point});
  }
  for_each_observation(
      window, unknowns.points, [&](std::size_t keyframe, const TrackPoint&, PointBlock& point) {
        const PoseBlock& pose = unknowns.poses[keyframe];
        const double depth = pose.rotation.row(2).dot(point.point) + pose.change[5];
        point.is_in_front = point.is_in_front && depth > ReprojectionCost::kMinDepth;
        point.moves_a_pose =
            point.moves_a_pose || static_cast<int>(keyframe) >= options.num_fixed_keyframes;
        ++point.num_observations;
      });
  std::erase_if(unknowns.points, [&](const PointBlock& point) {  // the solver must start somewhere
    return point.num_observations < options.min_observations || !point.is_in_front ||
           !point.moves_a_pose;
  });
  return unknowns;
}

/// Reprojection error before the solve, the newest keyframe's included.
double median_error_px(const Window& window, const Camera& camera, Unknowns& unknowns) {
  std::vector<double> errors;
  for_each_observation(
      window, unknowns.points,
      [&](std::size_t keyframe, const TrackPoint& observation, const PointBlock& point) {
        const PoseBlock& pose = unknowns.poses[keyframe];
        const Eigen::Vector3d x = pose.rotation * point.point + pose.change.tail<3>();
        errors.push_back((camera.project(x) - observation.uv).norm());
      });
  return median(std::move(errors));
}

/// Adds a residual per observation; every block's order is fixed, so the result is too. Returns the
/// costs, which must outlive the problem: it would keep a tree of those it had to free.
std::deque<ReprojectionCost> add_residuals(const Window& window,
                                           const Camera& camera,
                                           ceres::LossFunction* loss,
                                           Unknowns& unknowns,
                                           ceres::Problem& problem) {
  std::deque<ReprojectionCost> costs;
  for_each_observation(window, unknowns.points,
                       [&](std::size_t keyframe, const TrackPoint& observation, PointBlock& point) {
                         PoseBlock& pose = unknowns.poses[keyframe];
                         problem.AddResidualBlock(
                             &costs.emplace_back(camera, pose.rotation, observation.uv), loss,
                             pose.change.data(), point.point.data());
                       });
  return costs;
}

ceres::Solver::Options solver_options(const BundleAdjustmentOptions& options,
                                      Unknowns& unknowns,
                                      ceres::Problem& problem) {
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.max_num_iterations = options.max_iterations;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  // Tight turns need several times the steps of a straight road.
  solver.function_tolerance = 5e-3;
  // Turns, shifts and points are of like size here, and it would pass twice over the Jacobian.
  solver.jacobi_scaling = false;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (PointBlock& point : unknowns.points) {
    ordering->AddElementToGroup(point.point.data(), 0);
  }
  for (std::size_t i = 0; i < unknowns.poses.size(); ++i) {
    double* pose = unknowns.poses[i].change.data();
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

/// From the oldest keyframe to the last but one.
double length_of(const Window& window) {
  const Keyframe& last_but_one = *(window.keyframes.rbegin() + 1);
  return (last_but_one.world_from_camera.translation -
          window.keyframes.front().world_from_camera.translation)
      .norm();
}

void write_back(const Unknowns& unknowns, Window& window) {
  for (std::size_t i = 0; i < window.keyframes.size(); ++i) {
    window.keyframes[i].world_from_camera = unknowns.poses[i].camera_from_world().inverse();
  }
  for (const PointBlock& point : unknowns.points) {
    window.landmarks[point.track_id] = point.point;
  }
}

}  // namespace

bool ReprojectionCost::Evaluate(const double* const* parameters,
                                double* residuals,
                                double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> w(parameters[0]);
  const Eigen::Map<const Eigen::Vector3d> t(parameters[0] + 3);
  const Eigen::Map<const Eigen::Vector3d> point(parameters[1]);
  const RotationChange change(w);
  const Eigen::Vector3d turned = change.rotation * (rotation_ * point);
  const Eigen::Vector3d x = turned + t;
  if (!(x.z() > kMinDepth)) {
    return false;
  }
  const double inverse_z = 1.0 / x.z();
  const double u = x.x() * inverse_z;
  const double v = x.y() * inverse_z;
  residuals[0] = camera_.fx_px * u + camera_.cx_px - uv_.x();
  residuals[1] = camera_.fy_px * v + camera_.cy_px - uv_.y();
  if (jacobians == nullptr) {
    return true;
  }
  Eigen::Matrix<double, 2, 3> by_x;
  by_x << camera_.fx_px * inverse_z, 0.0, -camera_.fx_px * u * inverse_z,  //
      0.0, camera_.fy_px * inverse_z, -camera_.fy_px * v * inverse_z;
  if (jacobians[0] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> by_pose(jacobians[0]);
    by_pose.leftCols<3>() = -by_x * skew(turned) * change.jacobian;
    by_pose.rightCols<3>() = by_x;
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> by_point(jacobians[1]);
    by_point = by_x * change.rotation * rotation_;
  }
  return true;
}

bool refine_window(Window& window, const Camera& camera, const BundleAdjustmentOptions& options) {
  if (static_cast<int>(window.keyframes.size()) <= options.num_fixed_keyframes) {
    return false;
  }
  Unknowns unknowns = read_unknowns(window, options);
  ceres::CauchyLoss loss(std::max(options.loss_scale_px,
                                  options.loss_share * median_error_px(window, camera, unknowns)));
  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.disable_all_safety_checks = true;
  ceres::Problem problem(problem_options);
  const auto costs = add_residuals(window, camera, &loss, unknowns, problem);
  if (costs.empty()) {
    return false;
  }
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options(options, unknowns, problem), &problem, &summary);
  if (!summary.IsSolutionUsable()) {
    return false;
  }
  const double length = length_of(window);
  write_back(unknowns, window);
  const double refined_length = length_of(window);
  if (options.num_fixed_keyframes < 2 && length > 0.0 && refined_length > 0.0) {
    rescale(window, length / refined_length,
            window.keyframes.front().world_from_camera.translation);
  }
  return true;
}

}  // namespace stemvo
