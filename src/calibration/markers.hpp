// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <vector>

#include <opencv2/core.hpp>

namespace stemvo {

/// A square marker in an image: its corners from its own upper left on, clockwise.
struct Marker {
  int id = 0;
  std::array<cv::Point2f, 4> corners;
};

/// The only symbol of src/marker_module, which few need: OpenCV's contributed modules. False: no
/// such dictionary.
extern "C" using FindMarkers =
    bool(const cv::Mat& gray, const char* dictionary, std::vector<Marker>& markers);
inline constexpr const char* kFindMarkers = "stemvo_find_markers";

}  // namespace stemvo
