// SPDX-License-Identifier: MIT
#include "mapping/adjustment_errors.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <map>
#include <utility>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

namespace stemvo {
namespace {

/// Least depth of a point that is scaled to the length of its ray in the anchor.
constexpr double kNearest = 1e-3;
constexpr double kBehindSigmas = 100.0;

using Matrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using Matrix26 = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;

/// d exp(w) x = -[exp(w) x]_x * this * dw.
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-5) {
    return Eigen::Matrix3d::Identity() + 0.5 * skew(w);
  }
  const Eigen::Vector3d axis = w / angle;
  const double sine = std::sin(angle) / angle;
  return sine * Eigen::Matrix3d::Identity() + (1.0 - sine) * axis * axis.transpose() +
         (1.0 - std::cos(angle)) / angle * skew(axis);
}

/// Behind, a corner is off by a constant: its pull ends, the solver's step does not fail.
bool behind(double* residuals, double** jacobians) {
  residuals[0] = residuals[1] = kBehindSigmas;
  constexpr int kSizes[] = {3, 6, 6};
  for (int i = 0; jacobians != nullptr && i < 3; ++i) {
    if (jacobians[i] != nullptr) {
      std::fill_n(jacobians[i], 2 * kSizes[i], 0.0);
    }
  }
  return true;
}

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Rows = Eigen::SparseMatrix<double, Eigen::RowMajor>;

/// All residuals around the solution, under their losses.
struct Linearized {
  std::vector<double> residuals;
  Rows jacobian;
};

Linearized linearize(ceres::Problem& problem,
                     const std::vector<double*>& free,
                     const std::vector<ClusteredResidual>& residuals) {
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = free;
  std::ranges::transform(residuals, std::back_inserter(options.residual_blocks),
                         &ClusteredResidual::block);
  Linearized at;
  ceres::CRSMatrix crs;
  problem.Evaluate(options, nullptr, &at.residuals, nullptr, &crs);
  at.jacobian = Eigen::Map<const Rows>(crs.num_rows, crs.num_cols, std::ssize(crs.values),
                                       crs.rows.data(), crs.cols.data(), crs.values.data());
  return at;
}

/// The moves of a block by each cluster's errors, squared and summed up.
Matrix6 sandwich(const ceres::Problem& problem,
                 const Linearized& at,
                 const std::vector<ClusteredResidual>& residuals,
                 const Eigen::MatrixXd& inverse_columns) {
  std::map<int, Eigen::Matrix<double, 6, 1>> moved;
  Matrix6 covariance = Matrix6::Zero();
  const Eigen::MatrixXd influence = at.jacobian * inverse_columns;  // of a residual of 1
  Eigen::Index row = 0;
  for (const ClusteredResidual& residual : residuals) {
    const int size = problem.GetCostFunctionForResidualBlock(residual.block)->num_residuals();
    const auto rows = influence.middleRows(row, size);
    if (residual.cluster < 0) {
      covariance += rows.transpose() * rows;
    } else {
      const Eigen::Map<const Eigen::VectorXd> errors(&at.residuals[static_cast<std::size_t>(row)],
                                                     size);
      auto& sum =
          moved.try_emplace(residual.cluster, decltype(moved)::mapped_type::Zero()).first->second;
      sum += rows.transpose() * errors;
    }
    row += size;
  }
  const auto num = static_cast<double>(moved.size());
  for (const auto& [cluster, sum] : moved) {
    covariance += num / std::max(num - 1.0, 1.0) * sum * sum.transpose();
  }
  return covariance;
}

}  // namespace

bool triangulate(const std::vector<AdjustedPose>& poses,
                 const MapTrack& track,
                 const std::vector<Eigen::Vector2d>& rays,
                 AdjustedPoint& point) {
  point.map_from_anchor = poses[slot(track.front().keyframe)].camera_from_map().inverse();
  point.at = {rays.front().x(), rays.front().y(), 0.0};
  double a = 0.0;
  double b = 0.0;
  std::vector<std::pair<double, double>> depths;
  for (std::size_t i = 0; i < track.size(); ++i) {
    const Rigid3 camera_from_anchor =
        poses[slot(track[i].keyframe)].camera_from_map() * point.map_from_anchor;
    const Eigen::Vector3d at_infinity = camera_from_anchor.rotation * rays.front().homogeneous();
    const Eigen::Vector3d& t = camera_from_anchor.translation;
    const Eigen::Vector2d by_inverse_depth = t.head<2>() - rays[i] * t.z();
    const Eigen::Vector2d off = at_infinity.head<2>() - rays[i] * at_infinity.z();
    a += by_inverse_depth.squaredNorm();
    b -= by_inverse_depth.dot(off);
    depths.emplace_back(at_infinity.z(), t.z());
  }
  point.at[2] = a > 0.0 ? b / a : 0.0;
  return std::ranges::all_of(
      depths, [&](const auto& depth) { return depth.first + depth.second * point.at[2] > 0.05; });
}

bool CornerError::Evaluate(double const* const* parameters,
                           double* residuals,
                           double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> at(parameters[0]);
  const Eigen::Vector3d w(parameters[1]);
  const double* change = parameters[2];
  const Eigen::Matrix3d rotation = so3_exp(w).toRotationMatrix() * pose_.rotation;
  const Eigen::Vector3d translation = pose_.translation + Eigen::Vector3d(parameters[1] + 3);
  const Eigen::Matrix3d by_ray = rotation * point_.map_from_anchor.rotation.toRotationMatrix();
  const Eigen::Vector3d by_inverse_depth =
      rotation * point_.map_from_anchor.translation + translation;
  const Eigen::Vector3d x = by_ray * Eigen::Vector3d(at[0], at[1], 1.0) + by_inverse_depth * at[2];
  if (!(x.z() > kNearest)) {
    return behind(residuals, jacobians);
  }
  const double u = x.x() / x.z();
  const double v = x.y() / x.z();
  const double r_sq = u * u + v * v;
  const double stretch = 1.0 + r_sq * (change[3] + r_sq * change[4]);
  const double fx = camera_.fx_px * (1.0 + change[2]) / sigma_px_;
  const double fy = camera_.fy_px * (1.0 + change[2]) / sigma_px_;
  residuals[0] = fx * u * stretch + (camera_.cx_px + change[0] - uv_.x()) / sigma_px_;
  residuals[1] = fy * v * stretch + (camera_.cy_px + change[1] - uv_.y()) / sigma_px_;
  if (jacobians == nullptr) {
    return true;
  }
  const double bend = 2.0 * (change[3] + 2.0 * r_sq * change[4]);
  Eigen::Matrix2d by_uv;
  by_uv << fx * (stretch + u * u * bend), fx * u * v * bend, fy * u * v * bend,
      fy * (stretch + v * v * bend);
  Matrix23 by_x;
  by_x << 1.0, 0.0, -u, 0.0, 1.0, -v;
  by_x = by_uv * by_x / x.z();
  if (jacobians[0] != nullptr) {
    Eigen::Map<Matrix23> by_point(jacobians[0]);
    by_point.leftCols<2>() = by_x * by_ray.leftCols<2>();
    by_point.col(2) = by_x * by_inverse_depth;
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<Matrix26> by_pose(jacobians[1]);
    by_pose.leftCols<3>() = -by_x * skew(x - translation * at[2]) * left_jacobian(w);
    by_pose.rightCols<3>() = by_x * at[2];
  }
  if (jacobians[2] != nullptr) {
    const double fx_u = camera_.fx_px * u / sigma_px_;
    const double fy_v = camera_.fy_px * v / sigma_px_;
    const double longer = 1.0 + change[2];
    Eigen::Map<Matrix26> by_camera(jacobians[2]);
    by_camera << 1.0 / sigma_px_, 0.0, fx_u * stretch, fx_u * longer * r_sq,
        fx_u * longer * r_sq * r_sq, 0.0, 0.0, 1.0 / sigma_px_, fy_v * stretch,
        fy_v * longer * r_sq, fy_v * longer * r_sq * r_sq, 0.0;
  }
  return true;
}

std::vector<Matrix6> clustered_covariances(ceres::Problem& problem,
                                           const std::vector<double*>& free,
                                           const std::vector<ClusteredResidual>& residuals,
                                           const std::vector<double*>& asked,
                                           double sigma_factor) {
  const Linearized at = linearize(problem, free, residuals);
  Eigen::SparseMatrix<double> information = at.jacobian.transpose() * at.jacobian;
  for (Eigen::Index i = 0; i < information.rows(); ++i) {
    information.coeffRef(i, i) *= 1.0 + 1e-12;  // what nothing holds has an inverse still
  }
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(information);
  std::map<const double*, Eigen::Index> begin;
  Eigen::Index column = 0;
  for (double* block : free) {
    begin[block] = column;
    column += problem.ParameterBlockSize(block);
  }
  std::vector<Matrix6> result;
  for (double* block : asked) {
    const auto found = begin.find(block);
    Matrix6& covariance = result.emplace_back(Matrix6::Zero());
    if (solver.info() != Eigen::Success || found == begin.end()) {
      continue;
    }
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(information.rows(), 6);
    columns.middleRows<6>(found->second).setIdentity();
    columns = solver.solve(columns);
    const Matrix6 independent = columns.middleRows<6>(found->second);
    const Matrix6 clustered = sandwich(problem, at, residuals, columns);
    const Eigen::Matrix<double, 6, 1> factor =
        sigma_factor *
        independent.diagonal().cwiseQuotient(clustered.diagonal()).cwiseMax(1.0).cwiseSqrt();
    covariance = factor.asDiagonal() * clustered * factor.asDiagonal();
  }
  return result;
}

}  // namespace stemvo
