// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include <opencv2/core.hpp>

namespace stemvo {

/// Values of a channel before and after a change of light or exposure: after = gain before + bias.
struct LightChange {
  double gain = 1.0;
  double bias = 0.0;
};

/// A channel as few values, each the mean of so large a square that what moves between two frames
/// hardly changes it.
[[nodiscard]] cv::Mat light_values(const cv::Mat& channel);

/// The change that most of the image agrees with, from the light_values() of two frames that follow
/// each other; what moves on its own may be up to a third of them. Nothing: too few agree, or the
/// values before spread (root mean square about the mean) by no more than `least_spread`.
[[nodiscard]] std::optional<LightChange> light_change(const cv::Mat& before,
                                                      const cv::Mat& after,
                                                      double least_spread);

}  // namespace stemvo
