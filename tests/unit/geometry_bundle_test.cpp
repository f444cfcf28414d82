// SPDX-License-Identifier: MIT
#include <ceres/ceres.h>
#include <ceres/normal_prior.h>
#include <ceres/rotation.h>

#include "geometry/bundle.hpp"
#include "support/synthetic_drive_tracks.hpp"
#include "support/test.hpp"

namespace stemvo {
namespace {

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

/// `camera`: the change of cx, cy, focal lengths, k1, k2.
struct ReprojectionError {
  const Camera& given;
  Eigen::Vector2d uv;

  template <typename T>
  bool operator()(
      const T* rotation, const T* translation, const T* point, const T* camera, T* residual) const {
    T x[3];
    ceres::AngleAxisRotatePoint(rotation, point, x);
    const T u = (x[0] + translation[0]) / (x[2] + translation[2]);
    const T v = (x[1] + translation[1]) / (x[2] + translation[2]);
    const T r_sq = u * u + v * v;
    const T stretch = (1.0 + camera[2]) * (1.0 + r_sq * (camera[3] + r_sq * camera[4]));
    residual[0] = given.fx_px * stretch * u + given.cx_px + camera[0] - uv.x();
    residual[1] = given.fy_px * stretch * v + given.cy_px + camera[1] - uv.y();
    return true;
  }
};

/// Ceres's solution of the same problem; returns the sum of its loss, px^2, and the camera's
/// change.
std::pair<double, IntrinsicsDelta> solve_by_ceres(Bundle& bundle, const BundleOptions& options) {
  ceres::Problem problem;
  std::vector<Eigen::Matrix<double, 6, 1>> poses;
  for (const Rigid3& pose : bundle.camera_from_world) {
    poses.emplace_back() << so3_log(pose.rotation), pose.translation;
  }
  IntrinsicsDelta camera = IntrinsicsDelta::Zero();
  auto* loss = new ceres::CauchyLoss(options.loss_scale_px);
  for (const Bundle::Observation& seen : bundle.observations) {
    double* pose = poses[static_cast<std::size_t>(seen.pose)].data();
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ReprojectionError, 2, 3, 3, 3, 5>(
                                 new ReprojectionError{bundle.camera, seen.uv}),
                             loss, pose, pose + 3,
                             bundle.points[static_cast<std::size_t>(seen.point)].data(),
                             camera.data());
  }
  for (int i = 0; i < options.num_fixed_poses; ++i) {
    problem.SetParameterBlockConstant(poses[static_cast<std::size_t>(i)].data());
    problem.SetParameterBlockConstant(poses[static_cast<std::size_t>(i)].data() + 3);
  }
  if (options.camera) {
    const CameraInformation root = options.camera->information.llt().matrixU();
    problem.AddResidualBlock(new ceres::NormalPrior(root, options.camera->mean), nullptr,
                             camera.data());
  } else {
    problem.SetParameterBlockConstant(camera.data());
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
  return {2.0 * summary.final_cost, camera};
}

CameraPrior weak_prior() {
  constexpr double kNoise_px = 0.3;
  IntrinsicsDelta sigma;
  sigma << 10.0, 10.0, 0.003, 0.01, 0.005;
  return {IntrinsicsDelta::Zero(),
          (kNoise_px * sigma.cwiseInverse()).cwiseAbs2().asDiagonal().toDenseMatrix()};
}

TEST(Bundle, EndsWhereCeresDoes) {
  for (const auto& prior : {std::optional<CameraPrior>(), std::optional(weak_prior())}) {
    const DriveTracks drive(8, 0.3, 5);
    BundleOptions options{.max_iterations = 200, .min_relative_decrease = 1e-14, .camera = prior};
    Bundle ours = bundle_of(drive, 1.0);
    Bundle judge = ours;
    const BundleResult result = solve_bundle_adjustment(ours, options);
    ASSERT_TRUE(result.is_usable);
    const auto [cost, change] = solve_by_ceres(judge, options);
    EXPECT_NEAR(result.cost, cost, 1e-6 * cost);
    EXPECT_LE((result.camera_change - change).norm(), 1e-4);
    for (std::size_t i = 0; i < ours.camera_from_world.size(); ++i) {
      const Rigid3& a = ours.camera_from_world[i];
      const Rigid3& b = judge.camera_from_world[i];
      EXPECT_LE((a.translation - b.translation).norm(), 1e-5) << i;
      EXPECT_LE(a.rotation.angularDistance(b.rotation), 1e-6) << i;
    }
  }
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

}  // namespace
}  // namespace stemvo
