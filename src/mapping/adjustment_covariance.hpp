// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <Eigen/Core>
#include <ceres/ceres.h>

namespace stemvo::internal {

/// A residual block, and which others have errors like its own.
struct ClusteredResidual {
  ceres::ResidualBlockId block;
  int cluster = -1;  ///< -1: its errors are nobody's, with the sigmas it has
};

/// Covariances of blocks of six unknowns of a solved problem. Errors of one cluster may be alike in
/// any way, those of different ones are independent: what each cluster moves a block by is summed
/// up in squares (the sandwich estimator), and no less than independent errors would. Sigmas are
/// multiplied by `sigma_factor`. `free`: all that are not constant. Zero where there is no
/// solution.
[[nodiscard]] std::vector<Eigen::Matrix<double, 6, 6>> clustered_covariances(
    ceres::Problem& problem,
    const std::vector<double*>& free,
    const std::vector<ClusteredResidual>& residuals,
    const std::vector<double*>& asked,
    double sigma_factor);

}  // namespace stemvo::internal
