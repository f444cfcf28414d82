// SPDX-License-Identifier: MIT
#include "stem/light_change.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <opencv2/imgproc.hpp>

namespace stemvo {
namespace {

constexpr int kSquare_px = 16;  // of the channel
constexpr Eigen::Index kLeastValues = 12;
constexpr int kIterations = 12;
// Of the spread of the values before: residuals below do not weigh more, and those that agree.
constexpr double kLeastResidual = 0.01;
constexpr double kAgrees = 0.25;
constexpr double kLeastShare = 0.6;  // of the values, that agree
constexpr double kLeastGain = 0.25;  // and its inverse: beyond, one of the frames is dark

using Values = Eigen::Map<const Eigen::ArrayXf>;

}  // namespace

cv::Mat light_values(const cv::Mat& channel) {
  const cv::Size size(std::max(1, channel.cols / kSquare_px),
                      std::max(1, channel.rows / kSquare_px));
  cv::Mat values;
  cv::resize(channel, values, size, 0.0, 0.0, cv::INTER_AREA);
  return values;
}

std::optional<LightChange> light_change(const cv::Mat& before,
                                        const cv::Mat& after,
                                        double least_spread) {
  const auto num = static_cast<Eigen::Index>(before.total());
  if (before.size() != after.size() || num < kLeastValues) {
    return std::nullopt;
  }
  const Eigen::ArrayXd x = Values(before.ptr<float>(), num).cast<double>();
  const Eigen::ArrayXd y = Values(after.ptr<float>(), num).cast<double>();
  const double spread = std::sqrt((x - x.mean()).square().mean());
  if (!(spread > least_spread && y.isFinite().all())) {
    return std::nullopt;
  }
  LightChange light;
  Eigen::ArrayXd residual = Eigen::ArrayXd::Zero(num);
  // Weights make the squares the least absolute residuals: what moves has little say.
  for (int i = 0; i < kIterations; ++i) {
    const Eigen::ArrayXd weight = (residual.abs() + kLeastResidual * spread).inverse();
    const double x_mean = (weight * x).sum() / weight.sum();
    const double y_mean = (weight * y).sum() / weight.sum();
    const Eigen::ArrayXd from_mean = x - x_mean;
    light.gain = (weight * from_mean * (y - y_mean)).sum() / (weight * from_mean.square()).sum();
    light.bias = y_mean - light.gain * x_mean;
    residual = y - light.gain * x - light.bias;
  }
  const auto agreeing = (residual.abs() < kAgrees * spread * std::max(1.0, light.gain)).count();
  const bool is_agreed = static_cast<double>(agreeing) >= kLeastShare * static_cast<double>(num) &&
                         light.gain > kLeastGain && light.gain < 1.0 / kLeastGain;
  return is_agreed ? std::optional(light) : std::nullopt;
}

}  // namespace stemvo
