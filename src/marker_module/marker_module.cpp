// SPDX-License-Identifier: MIT
// Loaded by calibration/board.cpp; the only source that calls OpenCV's finder of markers.
#include <algorithm>
#include <iterator>
#include <string_view>

#include <opencv2/core/version.hpp>
#if CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR < 7
#include <opencv2/aruco.hpp>
#else
#include <opencv2/objdetect/aruco_detector.hpp>
#endif

#include "calibration/markers.hpp"

namespace stemvo {
namespace {

using Corners = std::vector<std::vector<cv::Point2f>>;

/// By OpenCV's number of the dictionary.
constexpr std::string_view kDictionaries[] = {
    "DICT_4X4_50",         "DICT_4X4_100",       "DICT_4X4_250",       "DICT_4X4_1000",
    "DICT_5X5_50",         "DICT_5X5_100",       "DICT_5X5_250",       "DICT_5X5_1000",
    "DICT_6X6_50",         "DICT_6X6_100",       "DICT_6X6_250",       "DICT_6X6_1000",
    "DICT_7X7_50",         "DICT_7X7_100",       "DICT_7X7_250",       "DICT_7X7_1000",
    "DICT_ARUCO_ORIGINAL", "DICT_APRILTAG_16h5", "DICT_APRILTAG_25h9", "DICT_APRILTAG_36h10",
    "DICT_APRILTAG_36h11"};

void find(
    const cv::Mat& gray, int dictionary, int border, Corners& corners, std::vector<int>& ids) {
#if CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR < 7
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->markerBorderBits = border;
  cv::aruco::detectMarkers(gray, cv::aruco::getPredefinedDictionary(dictionary), corners, ids,
                           parameters);
#else
  cv::aruco::DetectorParameters parameters;
  parameters.markerBorderBits = border;
  const cv::aruco::ArucoDetector detector(cv::aruco::getPredefinedDictionary(dictionary),
                                          parameters);
  detector.detectMarkers(gray, corners, ids);
#endif
}

}  // namespace

extern "C" __attribute__((visibility("default"))) bool stemvo_find_markers(
    const cv::Mat& gray, const char* dictionary, std::vector<Marker>& markers) {
  const auto* const known = std::ranges::find(kDictionaries, std::string_view(dictionary));
  if (known == std::end(kDictionaries)) {
    return false;
  }
  markers.clear();
  for (const int border : {1, 2}) {  // Kalibr's tags have two
    Corners corners;
    std::vector<int> ids;
    find(gray, static_cast<int>(known - std::begin(kDictionaries)), border, corners, ids);
    if (ids.size() > markers.size()) {
      markers.resize(ids.size());
      for (std::size_t i = 0; i < ids.size(); ++i) {
        markers[i].id = ids[i];
        std::ranges::copy(corners[i], markers[i].corners.begin());
      }
    }
  }
  return true;
}

}  // namespace stemvo
