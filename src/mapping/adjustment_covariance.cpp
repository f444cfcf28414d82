// SPDX-License-Identifier: MIT
#include "mapping/adjustment_covariance.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <map>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

namespace stemvo::internal {
namespace {

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

}  // namespace stemvo::internal
