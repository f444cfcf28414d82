// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace stemvo {

/// Cauchy loss rho(r^2) = s^2 log(1 + r^2 / s^2) and its sum. One logarithm serves many terms: the
/// sum of logarithms is the logarithm of the product.
class CauchyLoss {
 public:
  explicit CauchyLoss(double scale) : squared_scale_(scale * scale) {}

  /// Adds a term; returns rho'(r^2), its weight in the normal equations.
  double add(double squared_residual) {
    const double argument = 1.0 + squared_residual / squared_scale_;
    product_ *= argument;
    if (!(product_ < 1e150)) {
      log_sum_ += std::log(product_ / argument) + std::log(argument);
      product_ = 1.0;
    }
    return 1.0 / argument;
  }
  [[nodiscard]] double sum() const { return squared_scale_ * (log_sum_ + std::log(product_)); }

 private:
  double squared_scale_;
  double product_ = 1.0;
  double log_sum_ = 0.0;
};

/// Second-order model of a cost around a state; the constant factor 1/2 is left out.
template <int N>
struct QuadraticModel {
  Eigen::Matrix<double, N, N> hessian = Eigen::Matrix<double, N, N>::Zero();
  Eigen::Matrix<double, N, 1> gradient = Eigen::Matrix<double, N, 1>::Zero();
  double cost = 0.0;
};

/// Levenberg-Marquardt with Marquardt's scaling. A step is taken only if the cost falls, so the
/// cost never rises and a state that gives NaN is never entered. Returns the last cost.
/// linearize(state) -> QuadraticModel<N>; retract(state, step) -> state.
template <int N, typename State, typename Linearize, typename Retract>
double minimize(State& state,
                const Linearize& linearize,
                const Retract& retract,
                int max_iterations,
                double step_tolerance) {
  QuadraticModel<N> current = linearize(state);
  double damping = 1e-4;
  for (int iteration = 0; iteration < max_iterations && damping < 1e8; ++iteration) {
    Eigen::Matrix<double, N, N> damped = current.hessian;
    // A direction that no residual depends on still needs a positive pivot.
    const double floor = 1e-12 * damped.diagonal().maxCoeff();
    damped.diagonal() += damping * damped.diagonal().cwiseMax(floor);
    const Eigen::Matrix<double, N, 1> step = damped.ldlt().solve(-current.gradient);
    const double expected_decrease = -step.dot(current.gradient);
    if (!step.allFinite() || step.norm() < step_tolerance ||
        !(expected_decrease > 1e-14 * current.cost)) {
      break;
    }
    const State trial_state = retract(state, step);
    const QuadraticModel<N> trial = linearize(trial_state);
    if (trial.cost < current.cost) {
      state = trial_state;
      current = trial;
      damping = std::max(0.1 * damping, 1e-12);
    } else {
      damping *= 10.0;
    }
  }
  return current.cost;
}

}  // namespace stemvo
