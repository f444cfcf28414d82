// SPDX-License-Identifier: MIT
#pragma once

#include "support/test.hpp"

namespace stemvo::testing {

/// Central differences of a function R^N -> R^M at x; the error is about step^2.
template <int M, int N, typename Function>
Eigen::Matrix<double, M, N> numeric_jacobian(const Function& function,
                                             const Eigen::Matrix<double, N, 1>& x,
                                             double step = 1e-6) {
  Eigen::Matrix<double, M, N> jacobian;
  for (int i = 0; i < N; ++i) {
    Eigen::Matrix<double, N, 1> forward = x;
    Eigen::Matrix<double, N, 1> backward = x;
    forward(i) += step;
    backward(i) -= step;
    const Eigen::Matrix<double, M, 1> difference = function(forward) - function(backward);
    jacobian.col(i) = difference / (2.0 * step);
  }
  return jacobian;
}

}  // namespace stemvo::testing
