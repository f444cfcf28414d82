// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include <opencv2/core.hpp>

namespace stemvo::synth {

/// Lens and chip do to light (CV_32FC3, where 1 is white): a point spread of 0.4 px, corners 12 %
/// darker, noise of about 1.8 gray levels per channel, 8 bits. CV_8UC3, RGB.
[[nodiscard]] cv::Mat expose(const cv::Mat& light, float exposure, std::uint64_t seed);

namespace chip {
inline constexpr double kFill = 0.8;         ///< side of a pixel's sensitive square, in pixels
inline constexpr double kSpread_px = 0.6;    ///< deviation of the lens' point spread
inline constexpr float kFullWell = 8000.0F;  ///< electrons of a white pixel at exposure 1
inline constexpr float kRead = 12.0F;        ///< electrons, deviation

/// The curve from linear light to the written value, both 0 to 1: highlights are compressed.
[[nodiscard]] constexpr float response(float light) {
  constexpr float kKnee = 0.7F;
  return (1.0F + kKnee) * light / (light + kKnee);
}
}  // namespace chip

/// The same by a small camera's chip: its point spread, photon and read noise (more of both the
/// higher the gain), response curve.
[[nodiscard]] cv::Mat expose_chip(const cv::Mat& light, float exposure, std::uint64_t seed);

}  // namespace stemvo::synth
