// SPDX-License-Identifier: MIT
#include "odometry/frame_view.hpp"

#include <opencv2/imgproc.hpp>

#include "geometry/distortion.hpp"
#include "try.hpp"

namespace stemvo {

Expected<FrameView> FrameView::create(const Camera& camera) {
  const Camera working = working_camera(camera);
  FrameView view;
  view.full_size_ = {camera.width_px, camera.height_px};
  STEMVO_TRY_GET(view.camera_, undistorted_camera(working));
  if (!is_distorted(working)) {
    return view;
  }
  cv::Mat map(working.height_px, working.width_px, CV_32FC2);
  for (int v = 0; v < map.rows; ++v) {
    for (int u = 0; u < map.cols; ++u) {
      const Eigen::Vector2d uv = source_pixel(working, view.camera_, Eigen::Vector2d(u, v));
      map.at<cv::Vec2f>(v, u) = {static_cast<float>(uv.x()), static_cast<float>(uv.y())};
    }
  }
  cv::convertMaps(map, cv::noArray(), view.map_, view.map_fraction_, CV_16SC2);
  return view;
}

cv::Mat FrameView::apply(const cv::Mat& image) const {
  cv::Mat result = image;
  if (const cv::Size size(camera_.width_px, camera_.height_px); size != full_size_) {
    cv::resize(image, result, size, 0.0, 0.0, cv::INTER_AREA);
  }
  if (map_.empty()) {
    return result;
  }
  // Cubic takes five times as long, and the path is no better for it.
  cv::Mat straight;
  cv::remap(result, straight, map_, map_fraction_, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return straight;
}

}  // namespace stemvo
