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

/// Share of the light that reaches a pixel through the lens.
class Vignette {
 public:
  explicit Vignette(const cv::Size& size)
      : cx_(0.5F * static_cast<float>(size.width - 1)),
        cy_(0.5F * static_cast<float>(size.height - 1)),
        corner2_(std::max(cx_ * cx_ + cy_ * cy_, 1.0F)) {}

  [[nodiscard]] float at(int x, int y) const {
    const float dx = static_cast<float>(x) - cx_;
    const float dy = static_cast<float>(y) - cy_;
    return 1.0F - kCornerLoss * (dx * dx + dy * dy) / corner2_;
  }

 private:
  float cx_;
  float cy_;
  float corner2_;
};

/// Draws of noise for the channels of a pixel begin with this.
std::uint64_t pixel_key(std::uint64_t seed, int x, int y) {
  return seed ^ (static_cast<std::uint64_t>(y) << 32) ^ (static_cast<std::uint64_t>(x) << 2);
}

}  // namespace

cv::Mat expose(const cv::Mat& light, float exposure, std::uint64_t seed) {
  cv::Mat blurred;
  const cv::Matx13f spread(0.08F, 0.84F, 0.08F);  // variance 0.16 px^2
  cv::sepFilter2D(light, blurred, CV_32F, spread, spread, {-1, -1}, 0.0, cv::BORDER_REPLICATE);
  cv::Mat rgb(light.size(), CV_8UC3);
  const Vignette vignette(light.size());
  for (int y = 0; y < light.rows; ++y) {
    const auto* from = blurred.ptr<cv::Vec3f>(y);
    auto* to = rgb.ptr<cv::Vec3b>(y);
    for (int x = 0; x < light.cols; ++x) {
      const float gain = exposure * 255.0F * vignette.at(x, y);
      const std::uint64_t pixel = pixel_key(seed, x, y);
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

cv::Mat expose_chip(const cv::Mat& light, float exposure, std::uint64_t seed) {
  constexpr float kDarker = 0.65F;  // as bright a mean as without the response curve
  cv::Mat spread;
  cv::GaussianBlur(light, spread, {}, chip::kSpread_px, 0.0, cv::BORDER_REPLICATE);
  cv::Mat rgb(light.size(), CV_8UC3);
  const Vignette vignette(light.size());
  const float electrons_of_white = chip::kFullWell / exposure;
  for (int y = 0; y < light.rows; ++y) {
    const auto* from = spread.ptr<cv::Vec3f>(y);
    auto* to = rgb.ptr<cv::Vec3b>(y);
    for (int x = 0; x < light.cols; ++x) {
      const float gain = kDarker * exposure * vignette.at(x, y);
      const std::uint64_t pixel = pixel_key(seed, x, y);
      for (int c = 0; c < 3; ++c) {
        const float electrons = electrons_of_white * std::max(0.0F, gain * from[x][c]);
        const float noise = std::sqrt(electrons + chip::kRead * chip::kRead) *
                            gaussian(mix(pixel + static_cast<std::uint64_t>(c)));
        const float read = std::max(0.0F, (electrons + noise) / electrons_of_white);
        to[x][c] = cv::saturate_cast<uchar>(255.0F * chip::response(read));
      }
    }
  }
  return rgb;
}

}  // namespace stemvo::synth
