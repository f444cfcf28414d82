// SPDX-License-Identifier: MIT
#include "synth/sensor.hpp"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "synth/basics.hpp"

namespace stemvo::synth {
namespace {

constexpr float kCornerLoss = 0.12F;
constexpr float kReadNoise = 1.3F;     // gray levels
constexpr float kPhotonNoise = 0.06F;  // times the square root of the level

/// Roughly normal, deviation 1: the sum of four uniform numbers of 16 bits each.
float gaussian(std::uint64_t bits) {
  const auto part = [&](int shift) { return static_cast<float>((bits >> shift) & 0xffffU); };
  constexpr float kMean = 4.0F * 32767.5F;
  constexpr float kDeviation = 37837.2F;  // sqrt(4 * 65536^2 / 12)
  return (part(0) + part(16) + part(32) + part(48) - kMean) / kDeviation;
}

}  // namespace

cv::Mat expose(const cv::Mat& light, float exposure, std::uint64_t seed) {
  cv::Mat blurred;
  const cv::Matx13f spread(0.08F, 0.84F, 0.08F);  // variance 0.16 px^2
  cv::sepFilter2D(light, blurred, CV_32F, spread, spread, {-1, -1}, 0.0, cv::BORDER_REPLICATE);
  cv::Mat rgb(light.size(), CV_8UC3);
  const float cx = 0.5F * static_cast<float>(light.cols - 1);
  const float cy = 0.5F * static_cast<float>(light.rows - 1);
  const float corner2 = std::max(cx * cx + cy * cy, 1.0F);
  for (int y = 0; y < light.rows; ++y) {
    const auto* from = blurred.ptr<cv::Vec3f>(y);
    auto* to = rgb.ptr<cv::Vec3b>(y);
    const float dy = static_cast<float>(y) - cy;
    for (int x = 0; x < light.cols; ++x) {
      const float dx = static_cast<float>(x) - cx;
      const float gain = exposure * 255.0F * (1.0F - kCornerLoss * (dx * dx + dy * dy) / corner2);
      const std::uint64_t pixel =
          seed ^ (static_cast<std::uint64_t>(y) << 32) ^ (static_cast<std::uint64_t>(x) << 2);
      for (int c = 0; c < 3; ++c) {
        const float level = std::max(0.0F, gain * from[x][c]);
        const float noise = (kReadNoise + kPhotonNoise * std::sqrt(level)) *
                            gaussian(mix(pixel + static_cast<std::uint64_t>(c)));
        to[x][c] = cv::saturate_cast<uchar>(level + noise);
      }
    }
  }
  return rgb;
}

}  // namespace stemvo::synth
