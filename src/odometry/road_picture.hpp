// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "stemvo/geometry/camera.hpp"
#include "stemvo/stem/channel.hpp"

namespace stemvo {

/// The part of a picture below the horizon, made comparable between frames: band-passed, divided by
/// the local contrast, with its gradient. Level 1 has half the size of level 0.
struct RoadPicture {
  struct Level {
    Camera camera;  ///< in pixels of this level, whole picture
    int first_row = 0;
    cv::Mat values;  ///< CV_32FC4: value, d/du, d/dv, local contrast; row 0 is `first_row`
  };
  cv::Mat pixels;      ///< CV_8U, the picture itself
  Camera camera;       ///< in its pixels
  double scale = 1.0;  ///< input pixels per pixel of it
  std::vector<Level> levels;
};

[[nodiscard]] RoadPicture make_road_picture(const ChannelImage& image, const Camera& camera);

}  // namespace stemvo
