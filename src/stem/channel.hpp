// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "geometry/radial_lens.hpp"

namespace stemvo {

/// Map from pixels of a channel (or of an image made from it) to pixels of the input frame, per
/// axis: input = scale * channel + offset. A k-wide filter with stride s and padding p has scale s
/// and offset (k - 1) / 2 - p.
struct PixelMap {
  Eigen::Vector2d scale = Eigen::Vector2d::Ones();
  Eigen::Vector2d offset_px = Eigen::Vector2d::Zero();
  RadialLens lens = {};  ///< the input frame's, taken out of its pixels

  [[nodiscard]] Eigen::Vector2d to_input(const Eigen::Vector2d& channel_uv) const {
    return lens.undistort(scale.cwiseProduct(channel_uv) + offset_px);
  }
  [[nodiscard]] Eigen::Vector2d from_input(const Eigen::Vector2d& input_uv) const {
    return (lens.distort(input_uv) - offset_px).cwiseQuotient(scale);
  }
};

/// One filter's dense response to one frame.
struct Channel {
  cv::Mat values;  ///< CV_32F, one channel
  PixelMap map;
};

/// The image that points are tracked on: a channel normalized to 8 bits, at its own or the input's
/// size.
struct ChannelImage {
  cv::Mat pixels;  ///< CV_8U
  PixelMap map;    ///< from `pixels` to input pixels
};

}  // namespace stemvo
