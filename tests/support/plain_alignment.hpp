// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>

#include <Eigen/Core>
#include <Eigen/QR>

#include "features/patch_kernels.hpp"

/// The computation of features/patch_alignment.cpp once more, to be read, not to be fast: double
/// precision, nothing prepared, each step solved by QR, and the same bounds of the iterations.
/// Complex numbers are points and similarities.
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

/// By x and by y.
inline Eigen::MatrixXd gradient(const BorderedImage& image, Complex at, Weight weight) {
  Eigen::MatrixXd columns(64, 2);
  columns << samples(image, at + 1.0, 1.0, weight) - samples(image, at - 1.0, 1.0, weight),
      samples(image, at + Complex(0, 1), 1.0, weight) -
          samples(image, at - Complex(0, 1), 1.0, weight);
  return 0.5 * columns;
}

/// The least-squares solution.
inline Eigen::MatrixXd solve(const Eigen::MatrixXd& columns, const Eigen::MatrixXd& right) {
  return columns.colPivHouseholderQr().solve(right);
}

/// A translation of what is at `from` in one image; from `at` in the other.
inline Complex align_coarse(const BorderedImage& before,
                            Complex from,
                            const BorderedImage& after,
                            Complex at) {
  const Eigen::VectorXd value = samples(before, from, 1.0, linear_weight);
  const Eigen::MatrixXd columns = gradient(before, from, linear_weight);
  for (int i = 0; i < 12; ++i) {
    const Eigen::VectorXd step = solve(columns, samples(after, at, 1.0, linear_weight) - value);
    at -= Complex(step[0], step[1]);
    if (step.norm() < 0.1) {
      break;
    }
  }
  return at;
}

struct PlainMatch {
  Complex at;
  Complex turn = 1.0;
  double correlation = 0.0;
};

/// A translation until a step is at most 0.1 px, then a similarity; gain and bias projected out.
inline PlainMatch align_fine(const BorderedImage& before,
                             Complex from,
                             const BorderedImage& after,
                             Complex at) {
  const Eigen::VectorXd raw = samples(before, from, 1.0, cubic_weight);
  const Eigen::VectorXd value = raw.array() - raw.mean();
  Eigen::MatrixXd columns(64, 4);
  columns.leftCols(2) = gradient(before, from, cubic_weight);
  for (Eigen::Index k = 0; k < 64; ++k) {
    const Complex by(columns(k, 0), columns(k, 1));
    const Complex by_turn = std::conj(by) * offset(k);
    columns.row(k).tail(2) << by_turn.real(), -by_turn.imag();
  }
  Eigen::MatrixXd illumination(64, 2);
  illumination << Eigen::VectorXd::Ones(64), value;
  columns -= illumination * solve(illumination, columns);

  PlainMatch match{at};
  Eigen::Index num_unknowns = 2;
  for (int i = 0; i < 8; ++i) {
    const Eigen::VectorXd sampled = samples(after, match.at, match.turn, cubic_weight);
    const Eigen::VectorXd centred = sampled.array() - sampled.mean();
    const double gain = value.dot(sampled) / value.squaredNorm();
    match.correlation = value.dot(centred) / (value.norm() * centred.norm());
    Eigen::VectorXd step = Eigen::VectorXd::Zero(4);
    step.head(num_unknowns) = solve(columns.leftCols(num_unknowns), sampled / gain);
    match.turn /= Complex(1.0 + step[2], step[3]);
    const Complex moved = match.turn * Complex(step[0], step[1]);
    match.at -= moved;
    if (num_unknowns == 4 && std::abs(moved) < 0.03) {
      break;
    }
    num_unknowns = std::abs(moved) > 0.1 ? num_unknowns : 4;
  }
  return match;
}

/// From one image to another, a level of half the size first.
inline PlainMatch align(const BorderedImage* before,
                        Complex from,
                        const BorderedImage* after,
                        Complex at) {
  at = 2.0 * align_coarse(before[1], 0.5 * from, after[1], 0.5 * at);
  return align_fine(before[0], from, after[0], at);
}

}  // namespace stemvo::test
