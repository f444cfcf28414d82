// SPDX-License-Identifier: MIT
#pragma once

#include <opencv2/core.hpp>

#include "stem/channel.hpp"
#include "stemvo/camera.hpp"

namespace stemvo {

/// The part of an image below the horizon, made comparable between frames: band-passed, divided by
/// the local contrast, with its gradient.
struct RoadImage {
  struct Level {
    Camera camera;  ///< in pixels of this level, whole image
    int first_row = 0;
    cv::Mat values;  ///< CV_32FC4: value, d/du, d/dv, 1 where hidden; row 0 is `first_row`
    [[nodiscard]] bool hides(int u, int v) const {
      return values.at<cv::Vec4f>(v - first_row, u)[3] > 0.0F;
    }
  };
  cv::Mat pixels;  ///< CV_8U, the image itself
  cv::Mat mask;    ///< CV_8U of its size, 0: hidden; empty: nothing is
  PixelMap map;    ///< to input pixels
  Level full;      ///< without values where too little is below the horizon
};

/// The channel that shows the road, whatever the points are tracked on: the derivative along y, as
/// asphalt shows little but lines across. Gray or RGB of 8 bits and the camera's size; at half of
/// it for long focal lengths.
[[nodiscard]] Channel road_channel(const cv::Mat& image, const Camera& camera);

/// False: gray values below the horizon spread so little that the steps between levels look like a
/// road's texture.
[[nodiscard]] bool shows_texture(const cv::Mat& image, const Camera& camera);

/// `mask`: as RoadImage has it.
[[nodiscard]] RoadImage make_road_image(const ChannelImage& image,
                                        const Camera& camera,
                                        const cv::Mat& mask = {});

/// At half the size; without values as above.
[[nodiscard]] RoadImage::Level make_half_level(const RoadImage& road);

/// The same image (pixels are shared), by a camera that is known better.
[[nodiscard]] RoadImage seen_by(const RoadImage& road, const Camera& camera);

}  // namespace stemvo
