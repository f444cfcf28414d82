// SPDX-License-Identifier: MIT
#pragma once

#include <complex>

#include "features/patch_alignment.hpp"
#include "support/test.hpp"

/// How an image is sampled, to be read, not to be fast. Complex numbers are points and
/// similarities.
namespace stemvo::test {

using Complex = std::complex<double>;

/// Keys's cubic convolution (1981); the parameter of Catmull and Rom.
inline double cubic_weight(double distance) {
  constexpr double kA = -0.5;
  const double t = std::abs(distance);
  if (t < 1.0) {
    return (kA + 2.0) * t * t * t - (kA + 3.0) * t * t + 1.0;
  }
  return t < 2.0 ? kA * (t * t * t - 5.0 * t * t + 8.0 * t - 4.0) : 0.0;
}

inline double linear_weight(double distance) { return std::max(0.0, 1.0 - std::abs(distance)); }

using Weight = double (*)(double distance);

/// The image between its pixels, by the 4x4 of them around.
inline double sample(const BorderedImage& image, Complex at, Weight weight) {
  double sum = 0.0;
  const auto column = static_cast<int>(std::floor(at.real()));
  const auto row = static_cast<int>(std::floor(at.imag()));
  for (int j = row - 1; j <= row + 2; ++j) {
    for (int i = column - 1; i <= column + 2; ++i) {
      sum += weight(at.real() - i) * weight(at.imag() - j) * image.origin[j * image.stride + i];
    }
  }
  return sum;
}

/// Pixel k of a patch, from its centre.
inline Complex offset(Eigen::Index k) {
  return {static_cast<double>(k % 8) - 3.5, static_cast<double>(k / 8) - 3.5};
}

/// At at + turn * offset(k), k from 0 to 63.
inline Eigen::VectorXd samples(const BorderedImage& image,
                               Complex at,
                               Complex turn,
                               Weight weight) {
  return Eigen::VectorXd::NullaryExpr(
      64, [&](Eigen::Index k) { return sample(image, at + turn * offset(k), weight); });
}

}  // namespace stemvo::test
