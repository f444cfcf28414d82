// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include <opencv2/core.hpp>

namespace stemvo::synth {

/// What lens and chip do to light: a point spread of 0.4 px, corners 12 % darker, noise of about
/// 1.8 gray levels per channel, 8 bits. `light` is CV_32FC3, RGB, 1 = white; the result is BGR.
[[nodiscard]] cv::Mat expose(const cv::Mat& light, std::uint64_t seed);

}  // namespace stemvo::synth
