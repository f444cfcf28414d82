// SPDX-License-Identifier: MIT
#include "calibration/information.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>

namespace stemvo::calibration {
namespace {

/// Of the trace: keeps directions that nothing is known of (a landmark without parallax)
/// invertible.
constexpr double kDamping = 1e-12;

template <typename Matrix>
Matrix damped(const Matrix& hessian) {
  Matrix result = hessian;
  result.diagonal().array() += kDamping * hessian.trace() + std::numeric_limits<double>::min();
  return result;
}

/// J^T J and J^T r without the landmarks.
struct Reduced {
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
};

/// Two rows per observation; columns of the landmark and of everything behind the landmarks.
struct Rows {
  Eigen::MatrixXd landmark;
  Eigen::MatrixXd rest;
  Eigen::VectorXd residual;
};

Rows rows_of(const ceres::CRSMatrix& jacobian,
             const std::vector<double>& residuals,
             int first_row,
             int num_rows,
             int landmark_column,
             int rest_column) {
  Rows rows{Eigen::MatrixXd::Zero(num_rows, 3),
            Eigen::MatrixXd::Zero(num_rows, jacobian.num_cols - rest_column),
            Eigen::VectorXd::Zero(num_rows)};
  for (int i = 0; i < num_rows; ++i) {
    const auto row = static_cast<std::size_t>(first_row + i);
    rows.residual[i] = residuals[row];
    for (int at = jacobian.rows[row]; at < jacobian.rows[row + 1]; ++at) {
      const int column = jacobian.cols[static_cast<std::size_t>(at)];
      const double value = jacobian.values[static_cast<std::size_t>(at)];
      if (column >= rest_column) {
        rows.rest(i, column - rest_column) = value;
      } else {
        rows.landmark(i, column - landmark_column) = value;
      }
    }
  }
  return rows;
}

}  // namespace

SegmentInformation eliminate(const Segment& segment,
                             const std::vector<double>& residuals,
                             const ceres::CRSMatrix& jacobian) {
  const int rest_column = 3 * static_cast<int>(segment.landmarks.size());
  const int num_rest = jacobian.num_cols - rest_column;
  Reduced all{Eigen::MatrixXd::Zero(num_rest, num_rest), Eigen::VectorXd::Zero(num_rest)};
  int row = 0;
  for (std::size_t i = 0; i < segment.landmarks.size(); ++i) {
    const int num_rows = 2 * static_cast<int>(segment.landmarks[i].observations.size());
    const Rows rows =
        rows_of(jacobian, residuals, row, num_rows, 3 * static_cast<int>(i), rest_column);
    const Eigen::Matrix3d point =
        damped<Eigen::Matrix3d>(rows.landmark.transpose() * rows.landmark);
    const Eigen::MatrixXd mixed = rows.landmark.transpose() * rows.rest;
    const Eigen::MatrixXd solved = point.ldlt().solve(mixed);
    all.hessian += rows.rest.transpose() * rows.rest - mixed.transpose() * solved;
    all.gradient += rows.rest.transpose() * rows.residual -
                    solved.transpose() * (rows.landmark.transpose() * rows.residual);
    row += num_rows;
  }
  const int num_poses = num_rest - kNumShared;
  const Eigen::MatrixXd poses =
      damped<Eigen::MatrixXd>(all.hessian.topLeftCorner(num_poses, num_poses));
  const Eigen::MatrixXd mixed = all.hessian.topRightCorner(num_poses, kNumShared);
  const Eigen::MatrixXd solved = poses.ldlt().solve(mixed);
  SegmentInformation information;
  information.hessian =
      all.hessian.bottomRightCorner<kNumShared, kNumShared>() - mixed.transpose() * solved;
  information.gradient =
      all.gradient.tail<kNumShared>() - solved.transpose() * all.gradient.head(num_poses);
  return information;
}

SharedVector standard_deviations(const std::vector<SegmentInformation>& segments,
                                 const SharedMask& is_free,
                                 double residual_variance_px2) {
  std::vector<int> free;
  for (int i = 0; i < kNumShared; ++i) {
    if (is_free[static_cast<std::size_t>(i)]) {
      free.push_back(i);
    }
  }
  SharedVector result = SharedVector::Zero();
  if (free.empty()) {
    return result;
  }
  const auto n = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(n, n);
  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(n, n);
  for (const SegmentInformation& segment : segments) {
    hessian += segment.hessian(free, free);
    const Eigen::VectorXd gradient = segment.gradient(free);
    scatter += gradient * gradient.transpose();
  }
  // The numbers differ in size: they are brought to unit information before the test of rank.
  const Eigen::VectorXd unit = hessian.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::FullPivLU<Eigen::MatrixXd> factors(unit.asDiagonal() * hessian * unit.asDiagonal());
  if (!unit.allFinite() || !hessian.allFinite() || !factors.isInvertible()) {
    for (const int i : free) {
      result[i] = std::numeric_limits<double>::infinity();
    }
    return result;
  }
  const Eigen::MatrixXd inverse = unit.asDiagonal() * factors.inverse() * unit.asDiagonal();
  const auto num_segments = static_cast<double>(segments.size());
  const double few = num_segments / std::max(1.0, num_segments - static_cast<double>(n));
  const Eigen::MatrixXd clustered = few * inverse * scatter * inverse;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double variance = std::max(residual_variance_px2 * inverse(i, i), clustered(i, i));
    result[free[static_cast<std::size_t>(i)]] = std::sqrt(std::max(0.0, variance));
  }
  return result;
}

}  // namespace stemvo::calibration
