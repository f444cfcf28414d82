// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "stemvo/error.hpp"

namespace stemvo {

/// A square marker in an image: its corners from its own upper left on, clockwise.
struct Marker {
  int id = 0;
  std::array<cv::Point2f, 4> corners;
};

/// Finds markers of one of OpenCV's dictionaries, with black borders one or two bits wide. What
/// does it is src/marker_module, loaded when it is asked for: few need OpenCV's contributed
/// modules. Errors: the module or OpenCV's library is not there; no such dictionary.
[[nodiscard]] Expected<std::vector<Marker>> find_markers(const cv::Mat& gray,
                                                         const std::string& dictionary);

/// The module's only symbol. False: no such dictionary.
extern "C" using FindMarkers =
    bool(const cv::Mat& gray, const char* dictionary, std::vector<Marker>& markers);
inline constexpr const char* kFindMarkers = "stemvo_find_markers";

}  // namespace stemvo
