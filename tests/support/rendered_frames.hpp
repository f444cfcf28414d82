// SPDX-License-Identifier: MIT
#pragma once

#include "stemvo/camera.hpp"
#include "support/test.hpp"
#include "synth/renderer.hpp"

namespace stemvo::testing {

inline Camera kitti_camera(double scale) {
  return {718.856 * scale,
          718.856 * scale,
          607.1928 * scale,
          185.2157 * scale,
          static_cast<int>(1241 * scale),
          static_cast<int>(376 * scale)};
}

inline cv::Mat gray_of(const synth::RenderedFrame& frame) {
  cv::Mat gray;
  cv::cvtColor(frame.rgb, gray, cv::COLOR_RGB2GRAY);
  return gray;
}

/// Where the pixels of frame a are in frame b, by depth and poses; outside where they are hidden.
inline cv::Mat predict(const synth::RenderedFrame& a,
                       const synth::RenderedFrame& b,
                       const Rigid3& b_from_a,
                       const Camera& camera) {
  cv::Mat map(a.depth_m.size(), CV_32FC2);
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      const double z = std::min(static_cast<double>(a.depth_m.at<float>(y, x)), 1e7);
      const Eigen::Vector2d ray = camera.normalize({x, y});
      const Eigen::Vector3d in_b = b_from_a * Eigen::Vector3d(ray.x() * z, ray.y() * z, z);
      const Eigen::Vector2d to = camera.project(in_b);
      const cv::Point at(static_cast<int>(std::lround(to.x())),
                         static_cast<int>(std::lround(to.y())));
      const bool inside = in_b.z() > 0.2 && cv::Rect({0, 0}, map.size()).contains(at);
      const double seen = inside ? static_cast<double>(b.depth_m.at<float>(at)) : 0.0;
      const bool visible = inside && std::abs(std::min(seen, 1e7) / in_b.z() - 1.0) < 0.05;
      map.at<cv::Vec2f>(y, x) =
          visible ? cv::Vec2f(static_cast<float>(to.x()), static_cast<float>(to.y()))
                  : cv::Vec2f(-100.0F, -100.0F);
    }
  }
  return map;
}

inline Camera hand_camera() { return {585.0, 585.0, 320.0, 240.0, 640, 480}; }

}  // namespace stemvo::testing
