// SPDX-License-Identifier: MIT
#include "calibration/patch_alignment.hpp"

#include <cmath>

#include <Eigen/Dense>

namespace stemvo::calibration {
namespace {

/// Gray values: less is no texture.
constexpr double kMinDeviation = 3.0;

/// Bilinear; false outside.
bool sample(const cv::Mat& picture, double u, double v, double& value) {
  if (!(u >= 0.0) || !(v >= 0.0) || !(u < picture.cols - 1) || !(v < picture.rows - 1)) {
    return false;
  }
  const int x = static_cast<int>(u);
  const int y = static_cast<int>(v);
  const double a = u - x;
  const double b = v - y;
  const unsigned char* top = picture.ptr<unsigned char>(y) + x;
  const unsigned char* bottom = picture.ptr<unsigned char>(y + 1) + x;
  value =
      (1.0 - b) * ((1.0 - a) * top[0] + a * top[1]) + b * ((1.0 - a) * bottom[0] + a * bottom[1]);
  return true;
}

/// Values at place + linear * (x, y) over the square of this half width, rows first.
bool sample_square(const cv::Mat& picture,
                   const PatchPlace& place,
                   int half,
                   Eigen::VectorXd& values) {
  const int side = 2 * half + 1;
  values.resize(static_cast<Eigen::Index>(side) * side);
  Eigen::Index i = 0;
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x, ++i) {
      const Eigen::Vector2d uv = place.uv + place.linear * Eigen::Vector2d(x, y);
      if (!sample(picture, uv.x(), uv.y(), values[i])) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace

std::optional<Patch> Patch::cut(const cv::Mat& picture,
                                const Eigen::Vector2d& uv,
                                const PatchOptions& options) {
  Patch patch(options);
  const int half = options.half_window;
  const int side = 2 * half + 1;
  Eigen::VectorXd wide;  // one pixel more on each side, for the gradients
  if (!sample_square(picture, {uv, Eigen::Matrix2d::Identity()}, half + 1, wide)) {
    return std::nullopt;
  }
  const auto at = [&](int x, int y) { return wide[(y + half + 1) * (side + 2) + x + half + 1]; };
  const Eigen::Index num_pixels = static_cast<Eigen::Index>(side) * side;
  patch.values_.resize(num_pixels);
  patch.weights_.resize(num_pixels);
  patch.steepest_.resize(num_pixels, kNumParameters);
  const double sigma = 0.6 * half;
  Eigen::Index i = 0;
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x, ++i) {
      patch.values_[i] = at(x, y);
      patch.weights_[i] = std::exp(-0.5 * (x * x + y * y) / (sigma * sigma));
    }
  }
  patch.weights_ /= patch.weights_.sum();
  const double mean = patch.weights_.dot(patch.values_);
  patch.values_.array() -= mean;
  const double deviation =
      std::sqrt((patch.weights_.array() * patch.values_.array().square()).sum());
  if (!(deviation > kMinDeviation)) {
    return std::nullopt;
  }
  patch.values_ /= deviation;
  i = 0;
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x, ++i) {
      const double gx = 0.5 * (at(x + 1, y) - at(x - 1, y)) / deviation;
      const double gy = 0.5 * (at(x, y + 1) - at(x, y - 1)) / deviation;
      patch.steepest_.row(i) << gx * x, gx * y, gy * x, gy * y, gx, gy, patch.values_[i], 1.0;
    }
  }
  const Normal normal = patch.steepest_.transpose() * patch.weights_.asDiagonal() * patch.steepest_;
  const Eigen::FullPivLU<Normal> factors(normal);
  if (!factors.isInvertible()) {
    return std::nullopt;
  }
  patch.inverse_ = factors.inverse();
  patch.steepest_ = patch.weights_.asDiagonal() * patch.steepest_;
  return patch;
}

std::optional<PatchPlace> Patch::find(const cv::Mat& picture, const PatchPlace& start) const {
  PatchPlace place = start;
  Eigen::VectorXd seen;
  for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
    if (!sample_square(picture, place, options_.half_window, seen)) {
      return std::nullopt;
    }
    // Gain and offset of the picture are taken out, so that both have mean 0 and deviation 1.
    seen.array() -= weights_.dot(seen);
    const double deviation = std::sqrt((weights_.array() * seen.array().square()).sum());
    if (!(deviation > kMinDeviation)) {
      return std::nullopt;
    }
    const Eigen::VectorXd residual = seen / deviation - values_;
    const Eigen::Matrix<double, kNumParameters, 1> step =
        inverse_ * (steepest_.transpose() * residual);
    // The patch moved by the step looks like the picture: the map goes on by its inverse.
    Eigen::Matrix2d linear;
    linear << 1.0 + step[0], step[1], step[2], 1.0 + step[3];
    if (!(std::abs(linear.determinant()) > 0.1)) {
      return std::nullopt;
    }
    const Eigen::Matrix2d back = linear.inverse();
    const Eigen::Vector2d shift = -back * step.segment<2>(4);
    place.uv += place.linear * shift;
    place.linear = place.linear * back;
    if (!((place.uv - start.uv).norm() <= options_.max_shift_px)) {
      return std::nullopt;
    }
    if (shift.norm() < options_.converged_px) {
      const double rms = std::sqrt((weights_.array() * residual.array().square()).sum());
      return rms <= options_.max_rms ? std::optional(place) : std::nullopt;
    }
  }
  return std::nullopt;
}

}  // namespace stemvo::calibration
