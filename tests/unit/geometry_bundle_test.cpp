// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <gtest/gtest.h>

#include "geometry/bundle.hpp"
#include "geometry/normal_equations.hpp"
#include "support/synthetic_drive_tracks.hpp"

namespace stemvo {
namespace {

using testing::DriveTracks;

/// A drive as it is measured, poses and points pushed away from the truth.
Bundle bundle_of(const DriveTracks& drive, double push) {
  Bundle bundle;
  bundle.camera = drive.camera;
  for (int i = 0; i < drive.num_frames(); ++i) {
    const Rigid3 off(so3_exp(push * Eigen::Vector3d(0.001, -0.002, 0.001)),
                     push * Eigen::Vector3d(0.01, -0.02, 0.03));
    bundle.camera_from_world.push_back((i < 2 ? drive.pose(i) : drive.pose(i) * off).inverse());
  }
  for (std::size_t id = 0; id < drive.points.size(); ++id) {
    std::vector<Bundle::Observation> seen;
    for (int i = 0; i < drive.num_frames(); ++i) {
      const auto& frame = drive.observations[static_cast<std::size_t>(i)];
      if (const auto found = frame.find(static_cast<int>(id)); found != frame.end()) {
        seen.push_back({i, static_cast<int>(bundle.points.size()), found->second});
      }
    }
    if (seen.size() >= 3) {
      bundle.points.push_back(drive.points[id] * (1.0 + 0.005 * push));
      bundle.observations.insert(bundle.observations.end(), seen.begin(), seen.end());
    }
  }
  return bundle;
}

struct ReprojectionError {
  const Camera& camera;
  Eigen::Vector2d uv;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* point, T* residual) const {
    T x[3];
    ceres::AngleAxisRotatePoint(rotation, point, x);
    for (int i = 0; i < 3; ++i) {
      x[i] += translation[i];
    }
    residual[0] = camera.fx_px * x[0] / x[2] + camera.cx_px - uv.x();
    residual[1] = camera.fy_px * x[1] / x[2] + camera.cy_px - uv.y();
    return true;
  }
};

/// Ceres's solution of the same problem; returns the sum of its loss, px^2.
double solve_by_ceres(Bundle& bundle, const BundleOptions& options) {
  ceres::Problem problem;
  std::vector<Eigen::Matrix<double, 6, 1>> poses;
  for (const Rigid3& pose : bundle.camera_from_world) {
    poses.emplace_back() << so3_log(pose.rotation), pose.translation;
  }
  auto* loss = new ceres::CauchyLoss(options.loss_scale_px);
  for (const Bundle::Observation& seen : bundle.observations) {
    double* pose = poses[static_cast<std::size_t>(seen.pose)].data();
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ReprojectionError, 2, 3, 3, 3>(
                                 new ReprojectionError{bundle.camera, seen.uv}),
                             loss, pose, pose + 3,
                             bundle.points[static_cast<std::size_t>(seen.point)].data());
  }
  for (int i = 0; i < options.num_fixed_poses; ++i) {
    problem.SetParameterBlockConstant(poses[static_cast<std::size_t>(i)].data());
    problem.SetParameterBlockConstant(poses[static_cast<std::size_t>(i)].data() + 3);
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.max_num_iterations = 200;
  solver.function_tolerance = 1e-14;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    bundle.camera_from_world[i] = Rigid3(so3_exp(poses[i].head<3>()), poses[i].tail<3>());
  }
  return 2.0 * summary.final_cost;
}

TEST(Bundle, EndsWhereCeresDoes) {
  const DriveTracks drive(8, 0.3, 5);
  BundleOptions options;
  options.max_iterations = 100;
  options.min_relative_decrease = 1e-14;
  Bundle ours = bundle_of(drive, 1.0);
  Bundle judge = ours;
  const BundleResult result = solve_bundle_adjustment(ours, options);
  ASSERT_TRUE(result.is_usable);
  const double cost = solve_by_ceres(judge, options);
  EXPECT_NEAR(result.cost, cost, 1e-6 * cost);
  for (std::size_t i = 0; i < ours.camera_from_world.size(); ++i) {
    const Rigid3& a = ours.camera_from_world[i];
    const Rigid3& b = judge.camera_from_world[i];
    EXPECT_LE((a.translation - b.translation).norm(), 1e-5) << i;
    EXPECT_LE(a.rotation.angularDistance(b.rotation), 1e-6) << i;
  }
}

constexpr int kCamera = NormalEquations::kCamera;

std::vector<Reprojection> reprojections_of(const Bundle& bundle) {
  std::vector<Reprojection> at;
  for (const Bundle::Observation& seen : bundle.observations) {
    const Rigid3& pose = bundle.camera_from_world[static_cast<std::size_t>(seen.pose)];
    at.emplace_back(bundle, seen, pose.rotation_matrix());
  }
  return at;
}

/// Errors where the unknowns move: the camera's five, the free poses' six, the points' three.
Eigen::VectorXd errors_at(Bundle bundle, const Eigen::VectorXd& x, int num_fixed) {
  bundle.camera.cx_px += x[0];
  bundle.camera.cy_px += x[1];
  bundle.camera.fx_px *= 1.0 + x[2];
  bundle.camera.fy_px *= 1.0 + x[2];
  bundle.radial += x.segment<2>(3);
  int row = kCamera;
  for (std::size_t i = static_cast<std::size_t>(num_fixed); i < bundle.camera_from_world.size();
       ++i, row += 6) {
    Rigid3& pose = bundle.camera_from_world[i];
    const Eigen::Quaterniond turn = so3_exp(x.segment<3>(row));
    pose = Rigid3(turn * pose.rotation, turn * pose.translation + x.segment<3>(row + 3));
  }
  for (Eigen::Vector3d& point : bundle.points) {
    point += x.segment<3>(row);
    row += 3;
  }
  Eigen::VectorXd errors(2 * std::ssize(bundle.observations));
  row = 0;
  for (const Reprojection& at : reprojections_of(bundle)) {
    errors.segment<2>(row) = at.error;
    row += 2;
  }
  return errors;
}

/// The normal equations of all unknowns, by differences; the gradient is the last column.
Eigen::MatrixXd normal_equations(const Bundle& bundle, double weight, int num_fixed) {
  const int num_poses = static_cast<int>(bundle.camera_from_world.size()) - num_fixed;
  const Eigen::Index size = kCamera + 6 * num_poses + 3 * std::ssize(bundle.points);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(size);
  Eigen::MatrixXd jacobian(2 * std::ssize(bundle.observations), size + 1);
  for (Eigen::Index i = 0; i < size; ++i) {
    constexpr double kStep = 1e-6;
    const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(size, i);
    jacobian.col(i) =
        (errors_at(bundle, step, num_fixed) - errors_at(bundle, -step, num_fixed)) / (2.0 * kStep);
  }
  jacobian.col(size) = errors_at(bundle, zero, num_fixed);
  return weight * jacobian.transpose() * jacobian;
}

/// With the points eliminated.
Eigen::MatrixXd reduced(const Eigen::MatrixXd& all, Eigen::Index size, double damping) {
  const Eigen::Index num_points = all.rows() - 1 - size;
  Eigen::MatrixXd points = all.block(size, size, num_points, num_points);
  points.diagonal() *= 1.0 + damping;
  const Eigen::MatrixXd mixed = all.block(0, size, size, num_points);
  Eigen::MatrixXd result(size, size + 1);
  result.leftCols(size) =
      all.topLeftCorner(size, size) - mixed * points.ldlt().solve(mixed.transpose());
  result.col(size) = all.col(all.cols() - 1).head(size) -
                     mixed * points.ldlt().solve(all.col(all.cols() - 1).segment(size, num_points));
  return result;
}

/// As above, of the equations: rows and columns up to the diagonal, then the gradient.
Eigen::MatrixXd reduced(const NormalEquations& equations) {
  const int size = kCamera + 6 * equations.num_free_poses();
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(size, size + 1);
  const auto put = [&](const NormalEquations::Column& column, int num_rows, int row, int col) {
    for (int r = 0; r < num_rows; ++r) {
      result(row + r, col) = column[r];
    }
  };
  put(equations.camera.gradient, kCamera, 0, size);
  for (int c = 0; c < kCamera; ++c) {
    put(equations.camera.with_camera[static_cast<std::size_t>(c)], kCamera, 0, c);
  }
  for (int j = 0; j < equations.num_free_poses(); ++j) {
    const NormalEquations::Pose& pose = equations.poses[static_cast<std::size_t>(j)];
    put(pose.gradient, 6, kCamera + 6 * j, size);
    for (std::size_t c = 0; c < 6; ++c) {
      const int col = kCamera + 6 * j + static_cast<int>(c);
      put(pose.with_camera[c], kCamera, 0, col);
      for (int i = 0; i <= j; ++i) {
        put(equations.H_pp[equations.index_of(i, j)][c], 6, kCamera + 6 * i, col);
      }
    }
  }
  return result;
}

TEST(NormalEquations, AreTheNormalEquationsWithoutThePoints) {
  constexpr double kDamping = 1e-3;
  constexpr double kWeight = 0.5;
  constexpr int kFixed = 2;
  Bundle bundle = bundle_of(DriveTracks(6, 0.3, 8), 1.0);
  bundle.radial = Eigen::Vector2d(0.01, -0.003);
  bundle.points.resize(40);
  std::erase_if(bundle.observations, [](const auto& seen) { return seen.point >= 40; });
  const Eigen::MatrixXd all = normal_equations(bundle, kWeight, kFixed);
  std::vector<Reprojection> at = reprojections_of(bundle);
  for (Reprojection& one : at) {
    one.weight = kWeight;
  }
  NormalEquations equations(bundle, kFixed, /*has_camera=*/true);
  ASSERT_EQ(equations.num_free_poses(), 4);
  equations.add_up(bundle, at, kDamping);
  const Eigen::MatrixXd found = reduced(equations);
  const Eigen::MatrixXd expected = reduced(all, found.rows(), kDamping);
  for (Eigen::Index col = 0; col < found.cols(); ++col) {
    const Eigen::Index last = std::min(col, found.rows() - 1);
    const double squares = all.diagonal()[col < found.rows() ? col : all.rows() - 1];
    for (Eigen::Index row = 0; row <= last; ++row) {
      EXPECT_NEAR(found(row, col), expected(row, col), 1e-7 * std::sqrt(all(row, row) * squares))
          << row << ", " << col;
    }
  }
}

TEST(Bundle, ATenthOfTheStepsIsNearlyAsGood) {
  const DriveTracks drive(8, 0.3, 6);
  BundleOptions options;
  Bundle few = bundle_of(drive, 1.0);
  Bundle many = few;
  const double cost_of_few = solve_bundle_adjustment(few, options).cost;
  options.max_iterations = 100;
  options.min_relative_decrease = 1e-12;
  EXPECT_LE(cost_of_few, 1.01 * solve_bundle_adjustment(many, options).cost);
}

TEST(Bundle, APointBehindAPoseIsRefusedAndNothingChanges) {
  const DriveTracks drive(6, 0.0, 7);
  Bundle bundle = bundle_of(drive, 1.0);
  bundle.points[3].z() = -20.0;
  const Bundle before = bundle;
  EXPECT_FALSE(solve_bundle_adjustment(bundle, {}).is_usable);
  EXPECT_EQ(bundle.points[0], before.points[0]);
  EXPECT_EQ(bundle.camera_from_world[4].translation, before.camera_from_world[4].translation);
}

TEST(Bundle, ObservationsOutOfOrderAreRefused) {
  const DriveTracks drive(6, 0.0, 7);
  Bundle bundle = bundle_of(drive, 1.0);
  std::swap(bundle.observations[0], bundle.observations[1]);
  EXPECT_ANY_THROW(solve_bundle_adjustment(bundle, {}));
}

TEST(IntrinsicsDelta, ItsPartsMakeItUp) {
  IntrinsicsDelta total;
  IntrinsicsDelta first;
  total << 3.0, -2.0, 0.1, 0.01, -0.004;
  first << 1.0, 4.0, -0.05, 0.002, 0.001;
  const IntrinsicsDelta rest = difference(total, first);
  EXPECT_LT((compose(first, rest) - total).norm(), 1e-12);
  EXPECT_NEAR((1.0 + first[2]) * (1.0 + rest[2]), 1.1, 1e-12);
}

/// Turns tell the camera: planted changes are found within their sigmas, and those are small.
TEST(Bundle, FindsAPlantedCamera) {
  std::vector<Rigid3> path(1);
  for (int i = 1; i < 14; ++i) {
    const double turn = i % 4 < 2 ? 0.06 : -0.05;
    path.push_back(path.back() * Rigid3(so3_exp({0.01 * (i % 3 - 1), turn, 0.0}), {0.1, 0.0, 0.8}));
  }
  DriveTracks drive(path, DriveTracks(2, 0.0, 8).points, 0.1, 8);
  Bundle bundle = bundle_of(drive, 0.3);
  bundle.camera.cx_px += 3.0;
  bundle.camera.cy_px -= 2.0;
  const Camera given = bundle.camera;
  BundleOptions options;
  options.num_fixed_poses = 1;
  options.max_iterations = 50;
  options.min_relative_decrease = 1e-8;
  IntrinsicsDelta sigma;
  sigma << 10.0, 10.0, 0.003, 0.01, 0.005;
  constexpr double kNoiseSq = 0.01;
  options.camera =
      CameraPrior{IntrinsicsDelta::Zero(),
                  kNoiseSq * sigma.cwiseAbs2().cwiseInverse().asDiagonal().toDenseMatrix()};
  Bundle soon = bundle;
  const BundleResult result = solve_bundle_adjustment(bundle, options);
  ASSERT_TRUE(result.is_usable);
  options.max_iterations = 6;  // enough, though the data hardly pull at the camera
  ASSERT_TRUE(solve_bundle_adjustment(soon, options).is_usable);
  EXPECT_NEAR(soon.camera.cx_px, bundle.camera.cx_px, 0.005);
  EXPECT_NEAR(soon.camera.cy_px, bundle.camera.cy_px, 0.005);
  EXPECT_NEAR(given.cx_px + result.camera_change[0], bundle.camera.cx_px, 1e-9);
  EXPECT_NEAR(given.fx_px * (1.0 + result.camera_change[2]), bundle.camera.fx_px, 1e-9);
  EXPECT_NEAR(bundle.camera.cx_px, drive.camera.cx_px, 0.3);
  EXPECT_NEAR(bundle.camera.cy_px, drive.camera.cy_px, 0.3);
  const CameraInformation information =
      (result.information + options.camera->information) / kNoiseSq;
  const IntrinsicsDelta found_sigma = information.inverse().diagonal().cwiseSqrt();
  EXPECT_LE(found_sigma[0], 0.3);
  EXPECT_LE(std::abs(bundle.camera.cx_px - drive.camera.cx_px), 4.0 * found_sigma[0]);
  EXPECT_LE(std::abs(bundle.camera.cy_px - drive.camera.cy_px), 4.0 * found_sigma[1]);
}

TEST(Bundle, FixedPointsStayAndHoldTheScale) {
  const DriveTracks drive(6, 0.0, 12);
  Bundle bundle = bundle_of(drive, 0.0);
  bundle.num_fixed_points = 100;
  const std::vector<Eigen::Vector3d> truth = bundle.points;
  for (std::size_t i = 100; i < bundle.points.size(); ++i) {
    bundle.points[i] *= 1.02;
  }
  for (Rigid3& pose : bundle.camera_from_world) {
    pose.translation *= 1.02;  // the first one is at the origin
  }
  EXPECT_TRUE(solve_bundle_adjustment(
                  bundle, {.num_fixed_poses = 1, .max_iterations = 30, .min_relative_decrease = 0})
                  .is_usable);
  for (std::size_t i = 0; i < 100; ++i) {
    EXPECT_EQ(bundle.points[i], truth[i]);
  }
  const Eigen::Vector3d end = bundle.camera_from_world.back().translation;
  EXPECT_NEAR(end.norm(), drive.pose(5).translation.norm(), 1e-3);
}

}  // namespace
}  // namespace stemvo
