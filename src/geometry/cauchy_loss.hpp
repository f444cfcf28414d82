// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>

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

}  // namespace stemvo
