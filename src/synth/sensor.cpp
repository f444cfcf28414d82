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

/// An image of `level(light, gain, noise)`: `gain` is the share of the light that reaches the pixel
/// through the lens, `noise` is normal.
template <typename Level>
cv::Mat read_out(const cv::Mat& light, std::uint64_t seed, const Level& level) {
  const cv::Point2f centre(0.5F * static_cast<float>(light.cols - 1),
                           0.5F * static_cast<float>(light.rows - 1));
  const float corner2 = std::max(centre.dot(centre), 1.0F);
  cv::Mat rgb(light.size(), CV_8UC3);
  rgb.forEach<cv::Vec3b>([&](cv::Vec3b& to, const int* at) {
    const cv::Point2f off = cv::Point2f(cv::Point(at[1], at[0])) - centre;
    const float gain = 1.0F - kCornerLoss * off.dot(off) / corner2;
    const std::uint64_t pixel =
        seed ^ (static_cast<std::uint64_t>(at[0]) << 32) ^ (static_cast<std::uint64_t>(at[1]) << 2);
    for (int c = 0; c < 3; ++c) {
      const float noise = gaussian(mix(pixel + static_cast<std::uint64_t>(c)));
      to[c] = cv::saturate_cast<uchar>(level(light.at<cv::Vec3f>(at)[c], gain, noise));
    }
  });
  return rgb;
}

}  // namespace

cv::Mat expose(const cv::Mat& light, float exposure, std::uint64_t seed) {
  cv::Mat blurred;
  const cv::Matx13f spread(0.08F, 0.84F, 0.08F);  // variance 0.16 px^2
  cv::sepFilter2D(light, blurred, CV_32F, spread, spread, {-1, -1}, 0.0, cv::BORDER_REPLICATE);
  return read_out(blurred, seed, [exposure](float value, float gain, float noise) {
    const float level = std::max(0.0F, exposure * 255.0F * gain * value);
    return level + (kReadNoise + kPhotonNoise * std::sqrt(level)) * noise;
  });
}

cv::Mat expose_chip(const cv::Mat& light, float exposure, std::uint64_t seed) {
  constexpr float kDarker = 0.65F;  // as bright a mean as without the response curve
  cv::Mat spread;
  cv::GaussianBlur(light, spread, {}, chip::kSpread_px, 0.0, cv::BORDER_REPLICATE);
  const float electrons_of_white = chip::kFullWell / exposure;
  return read_out(spread, seed, [=](float value, float gain, float noise) {
    const float electrons = electrons_of_white * std::max(0.0F, kDarker * exposure * gain * value);
    const float read = electrons + std::sqrt(electrons + chip::kRead * chip::kRead) * noise;
    return 255.0F * chip::response(std::max(0.0F, read / electrons_of_white));
  });
}

}  // namespace stemvo::synth
