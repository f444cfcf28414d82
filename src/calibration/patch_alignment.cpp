// SPDX-License-Identifier: MIT
#include "calibration/patch_alignment.hpp"

#include <cmath>

#include <Eigen/Dense>

namespace stemvo::calibration {
namespace {

constexpr int kHalf = 6;  ///< of the window, pixels
constexpr int kSide = 2 * kHalf + 1;
constexpr double kMinDeviation = 3.0;  ///< gray values: less is no texture
constexpr int kMaxIterations = 20;
constexpr double kConverged_px = 0.005;
constexpr double kMaxShift_px = 2.0;  ///< from the start
constexpr double kMaxRms = 0.35;      ///< of the residual, in standard deviations of the patch

/// Bilinear values at uv + linear * (x, y) over the square of this half width, rows first; false
/// where it leaves the image.
bool sample(const cv::Mat& image, const PatchPose& pose, int half, Eigen::VectorXd& values) {
  const int side = 2 * half + 1;
  values.resize(static_cast<Eigen::Index>(side) * side);
  Eigen::Index i = 0;
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x, ++i) {
      const Eigen::Vector2d uv = pose.uv + pose.linear * Eigen::Vector2d(x, y);
      if (!(uv.x() >= 0.0 && uv.y() >= 0.0 && uv.x() < image.cols - 1 && uv.y() < image.rows - 1)) {
        return false;
      }
      const int left = static_cast<int>(uv.x());
      const int above = static_cast<int>(uv.y());
      const double a = uv.x() - left;
      const double b = uv.y() - above;
      const unsigned char* top = image.ptr<unsigned char>(above) + left;
      const unsigned char* bottom = image.ptr<unsigned char>(above + 1) + left;
      values[i] = (1.0 - b) * ((1.0 - a) * top[0] + a * top[1]) +
                  b * ((1.0 - a) * bottom[0] + a * bottom[1]);
    }
  }
  return true;
}

/// To mean 0 and deviation 1, which takes gain and offset of the image out. The deviation before;
/// nullopt: no texture.
std::optional<double> normalize(const Eigen::VectorXd& weights, Eigen::VectorXd& values) {
  values.array() -= weights.dot(values);
  const double deviation = std::sqrt((weights.array() * values.array().square()).sum());
  values /= deviation;
  return deviation > kMinDeviation ? std::optional(deviation) : std::nullopt;
}

}  // namespace

std::optional<Patch> Patch::cut(const cv::Mat& image, const Eigen::Vector2d& uv) {
  Eigen::VectorXd wide;  // one pixel more on each side, for the gradients
  if (!sample(image, {uv, Eigen::Matrix2d::Identity()}, kHalf + 1, wide)) {
    return std::nullopt;
  }
  const auto at = [&](int x, int y) { return wide[(y + kHalf + 1) * (kSide + 2) + x + kHalf + 1]; };
  Patch patch;
  patch.values_.resize(kSide * kSide);
  patch.weights_.resize(kSide * kSide);
  patch.steepest_.resize(kSide * kSide, kNumParameters);
  constexpr double kSigma = 0.6 * kHalf;
  for (int y = -kHalf, i = 0; y <= kHalf; ++y) {
    for (int x = -kHalf; x <= kHalf; ++x, ++i) {
      patch.values_[i] = at(x, y);
      patch.weights_[i] = std::exp(-0.5 * (x * x + y * y) / (kSigma * kSigma));
    }
  }
  patch.weights_ /= patch.weights_.sum();
  const std::optional<double> deviation = normalize(patch.weights_, patch.values_);
  if (!deviation) {
    return std::nullopt;
  }
  for (int y = -kHalf, i = 0; y <= kHalf; ++y) {
    for (int x = -kHalf; x <= kHalf; ++x, ++i) {
      const double gx = 0.5 * (at(x + 1, y) - at(x - 1, y)) / *deviation;
      const double gy = 0.5 * (at(x, y + 1) - at(x, y - 1)) / *deviation;
      patch.steepest_.row(i) << gx * x, gx * y, gy * x, gy * y, gx, gy, patch.values_[i], 1.0;
    }
  }
  const decltype(inverse_) normal =
      patch.steepest_.transpose() * patch.weights_.asDiagonal() * patch.steepest_;
  const Eigen::FullPivLU<decltype(inverse_)> factors(normal);
  if (!factors.isInvertible()) {
    return std::nullopt;
  }
  patch.inverse_ = factors.inverse();
  patch.steepest_ = patch.weights_.asDiagonal() * patch.steepest_;
  return patch;
}

std::optional<PatchPose> Patch::find(const cv::Mat& image, const PatchPose& start) const {
  PatchPose pose = start;
  Eigen::VectorXd seen;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    if (!sample(image, pose, kHalf, seen) || !normalize(weights_, seen)) {
      return std::nullopt;
    }
    const Eigen::VectorXd residual = seen - values_;
    const Eigen::Matrix<double, kNumParameters, 1> step =
        inverse_ * (steepest_.transpose() * residual);
    // The patch moved by the step looks like the image: the map goes on by its inverse.
    Eigen::Matrix2d linear;
    linear << 1.0 + step[0], step[1], step[2], 1.0 + step[3];
    if (!(std::abs(linear.determinant()) > 0.1)) {
      return std::nullopt;
    }
    const Eigen::Matrix2d back = linear.inverse();
    const Eigen::Vector2d shift = -back * step.segment<2>(4);
    pose.uv += pose.linear * shift;
    pose.linear = pose.linear * back;
    if (!((pose.uv - start.uv).norm() <= kMaxShift_px)) {
      return std::nullopt;
    }
    if (shift.norm() < kConverged_px) {
      const double rms = std::sqrt((weights_.array() * residual.array().square()).sum());
      return rms <= kMaxRms ? std::optional(pose) : std::nullopt;
    }
  }
  return std::nullopt;
}

}  // namespace stemvo::calibration
