// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/imgproc.hpp>

#include "stem/stem.hpp"

namespace stemvo {
namespace {

// Enough for percentiles to a hundredth of the range, few enough to cost nothing.
constexpr int kSamplesWanted = 20000;
// Share of the larger limit's magnitude: below it, the spread is rounding.
constexpr double kLeastContrast = 1e-5;
constexpr double kMiddleGray = 128.0;
// Share of the limits' distance: the next frame's limits nearly always lie no further away.
constexpr double kMargin = 0.1;
// The same: KITTI's scenes seem to change the light by up to 0.07 where only the camera moves.
constexpr double kLightChange = 0.08;
// The same: channels without low frequencies, whose squares spread less, do not show the light.
constexpr double kLeastSpread = 0.08;
// The same: beyond it the light has changed, and the old limits would cut off or hide the image.
constexpr double kJump = 0.2;

// light_change() goes by these.
constexpr int kSquare_px = 16;  // of the channel
constexpr Eigen::Index kLeastValues = 12;
constexpr int kIterations = 12;
// Shares of the spread of the values before: residuals below do not weigh more; values that agree.
constexpr double kLeastResidual = 0.01;
constexpr double kAgrees = 0.25;
constexpr double kLeastShare = 0.6;  // of the values, that agree
constexpr double kLeastGain = 0.25;  // and its inverse: beyond, one of the frames is dark

/// Finite values on a grid of the channel, the same pixels in every frame.
std::vector<float> sample(const cv::Mat& values) {
  const int step = std::max(
      1, static_cast<int>(std::sqrt(static_cast<double>(values.total()) / kSamplesWanted)));
  std::vector<float> samples;
  samples.reserve(values.total() / static_cast<std::size_t>(step * step) + values.total() / 100);
  for (int row = step / 2; row < values.rows; row += step) {
    const float* const pixels = values.ptr<float>(row);
    for (int col = step / 2; col < values.cols; col += step) {
      if (std::isfinite(pixels[col])) {
        samples.push_back(pixels[col]);
      }
    }
  }
  return samples;
}

/// `samples` is reordered. Fast where few of them lie on the percentile's side of `bound`.
double percentile(std::vector<float>& samples, double percent, double bound) {
  const double last = static_cast<double>(samples.size() - 1);
  const auto rank = static_cast<std::ptrdiff_t>(std::lround(last * percent / 100.0));
  const auto at = samples.begin() + std::clamp<std::ptrdiff_t>(rank, 0, std::ssize(samples) - 1);
  const auto split =
      std::partition(samples.begin(), samples.end(), [&](float value) { return value < bound; });
  if (at < split) {
    std::nth_element(samples.begin(), at, split);
  } else {
    std::nth_element(split, at, samples.end());
  }
  return *at;
}

/// Image pixel u of a resizing by `factor` lies at channel pixel (u + 0.5) / factor - 0.5.
PixelMap resized(const PixelMap& map, double factor) {
  PixelMap result;
  result.scale = map.scale / factor;
  result.offset_px = map.offset_px + (0.5 / factor - 0.5) * map.scale;
  return result;
}

/// Values of a channel before and after a change of light or exposure: after = gain before + bias.
struct LightChange {
  double gain = 1.0;
  double bias = 0.0;
};

/// A channel as few values, each the mean of so large a square that what moves between two frames
/// hardly changes it. Squares of whole pixels are several times as fast as others; what they leave
/// at the right and below is not looked at.
cv::Mat light_values(const cv::Mat& channel) {
  const cv::Size size = channel.size() / kSquare_px;
  cv::Mat values;
  if (!size.empty()) {
    cv::resize(channel({{}, size * kSquare_px}), values, size, 0.0, 0.0, cv::INTER_AREA);
  }
  return values;
}

/// The change that most of the image agrees with, from the light_values() of two frames that follow
/// each other; what moves on its own may be up to a third of them. Nothing: too few agree, or the
/// values before spread (root mean square about the mean) by no more than `least_spread`.
std::optional<LightChange> light_change(const cv::Mat& before,
                                        const cv::Mat& after,
                                        double least_spread) {
  using Values = Eigen::Map<const Eigen::ArrayXf>;
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

/// Input pixels per pixel of the image made from a channel of `sampling_px`.
int image_sampling_px(TrackingResolution resolution, int sampling_px) {
  if (resolution == TrackingResolution::kNative) {
    return sampling_px;
  }
  if (resolution == TrackingResolution::kHalf) {
    return sampling_px == 1 || sampling_px % 2 == 0 ? 2 : sampling_px;
  }
  return 1;
}

}  // namespace

bool ContrastNormalization::follow_light(const cv::Mat& values) {
  const cv::Mat before = std::exchange(light_values_, light_values(values));
  if (!limits_.are_known) {
    return false;
  }
  const double range = limits_.high - limits_.low;
  const auto light = light_change(before, light_values_, kLeastSpread * range);
  if (!light) {
    return false;
  }
  const double low = light->gain * limits_.low + light->bias;
  const double high = light->gain * limits_.high + light->bias;
  if (std::max(std::abs(low - limits_.low), std::abs(high - limits_.high)) > kLightChange * range) {
    limits_.low = low;
    limits_.high = high;
  }
  return true;
}

ChannelImage ContrastNormalization::apply(const Channel& channel) {
  const bool light_is_known = follow_light(channel.values);
  std::vector<float> samples = sample(channel.values);
  if (!samples.empty()) {
    const double margin = kMargin * (limits_.high - limits_.low);
    const double low = percentile(samples, options_.contrast_low_percent, limits_.low + margin);
    const double high = percentile(samples, options_.contrast_high_percent, limits_.high - margin);
    if (high - low > kLeastContrast * std::max({std::abs(low), std::abs(high), 1e-20})) {
      const double change = std::max(std::abs(low - limits_.low), std::abs(high - limits_.high));
      const bool has_jumped = !light_is_known && change > kJump * (limits_.high - limits_.low);
      const double memory = limits_.are_known && !has_jumped ? options_.contrast_memory : 0.0;
      limits_.low = memory * limits_.low + (1.0 - memory) * low;
      limits_.high = memory * limits_.high + (1.0 - memory) * high;
      limits_.are_known = true;
    }
  }
  const double gain = limits_.are_known ? 255.0 / (limits_.high - limits_.low) : 0.0;
  const double bias = limits_.are_known ? -gain * limits_.low : kMiddleGray;

  const int sampling = static_cast<int>(std::lround(channel.map.scale.x()));
  const int wanted = image_sampling_px(options_.tracking_resolution, sampling);
  // Floats first: as fast as resizing 8 bits (0.46 against 0.52 ms for a frame of KITTI at sampling
  // 2), and rounded once, not twice (0.29 against 0.56 gray values rms).
  const cv::Mat* values = &channel.values;
  if (wanted < sampling) {
    const int factor = sampling / wanted;
    cv::resize(channel.values, resized_, {}, factor, factor, cv::INTER_CUBIC);
    values = &resized_;
  } else if (wanted > sampling) {  // an odd last row or column is left out
    const cv::Size size = channel.values.size() / 2;
    constexpr float kKernel[] = {0.25F, 0.5F, 0.25F};
    const cv::Mat1f kernel(1, 3, const_cast<float*>(kKernel));
    cv::sepFilter2D(channel.values, smooth_, CV_32F, kernel, kernel);
    cv::resize(smooth_({0, 0, 2 * size.width, 2 * size.height}), resized_, size, 0.0, 0.0,
               cv::INTER_AREA);
    values = &resized_;
  }
  ChannelImage image;
  values->convertTo(image.pixels, CV_8U, gain, bias);
  image.map = resized(channel.map, static_cast<double>(sampling) / wanted);
  return image;
}

TrackingResolution choose_tracking_resolution(TrackingResolution asked,
                                              FeatureMethod method,
                                              const Camera& camera) {
  constexpr double kLongFocal_px = 500.0;
  if (asked != TrackingResolution::kAuto) {
    return asked;
  }
  if (method != FeatureMethod::kPatch && method != FeatureMethod::kKlt) {
    return TrackingResolution::kInput;
  }
  return camera.mean_focal_px() >= kLongFocal_px ? TrackingResolution::kHalf
                                                 : TrackingResolution::kInputZoomed;
}

}  // namespace stemvo
