// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include <opencv2/core.hpp>

namespace stemvo::synth {

/// Lens and chip do to light (CV_32FC3, where 1 is white): a point spread of 0.4 px, corners 12 %
/// darker, noise of about 1.8 gray levels per channel, 8 bits. CV_8UC3, RGB.
[[nodiscard]] cv::Mat expose(const cv::Mat& light, float exposure, std::uint64_t seed);

}  // namespace stemvo::synth
