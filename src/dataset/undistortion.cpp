// SPDX-License-Identifier: MIT
#include "dataset/undistortion.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/imgproc.hpp>

namespace stemvo::dataset {
namespace {

constexpr double kMinScale = 0.8;
constexpr double kMaxScale = 2.0;
constexpr int kNumHalvings = 30;  // of the interval between them

Camera scaled(Camera camera, double scale) {
  camera.fx_px *= scale;
  camera.fy_px *= scale;
  return camera;
}

/// Where the lens' picture shows a pixel of the view.
Eigen::Vector2d source_of(const Lens& lens, const Camera& view, double u, double v) {
  const Eigen::Vector2d xy = distort(lens, view.normalize({u, v}));
  return lens.camera.project({xy.x(), xy.y(), 1.0});
}

/// Of all pixels: those of the rim say it.
bool lies_inside(const Lens& lens, const Camera& view) {
  const double right = view.width_px - 1;
  const double bottom = view.height_px - 1;
  const auto is_inside = [&](double u, double v) {
    const Eigen::Vector2d uv = source_of(lens, view, u, v);
    return uv.x() >= 0.0 && uv.x() <= right && uv.y() >= 0.0 && uv.y() <= bottom;
  };
  double radius = 0.0;
  for (const double u : {0.0, right}) {
    for (const double v : {0.0, bottom}) {
      radius = std::max(radius, view.normalize({u, v}).norm());
    }
  }
  if (!is_one_to_one(lens, radius)) {
    return false;
  }
  for (int u = 0; u < view.width_px; ++u) {
    if (!is_inside(u, 0.0) || !is_inside(u, bottom)) {
      return false;
    }
  }
  for (int v = 0; v < view.height_px; ++v) {
    if (!is_inside(0.0, v) || !is_inside(right, v)) {
      return false;
    }
  }
  return true;
}

/// The smallest scale of the focal lengths whose view lies inside.
Expected<double> find_scale(const Lens& lens) {
  if (!lies_inside(lens, scaled(lens.camera, kMaxScale))) {
    return fail(
        fmt::format("expected distortion_coefficients that leave half of the picture "
                    "usable, found [{}]",
                    fmt::join(lens.coefficients, ", ")));
  }
  if (lies_inside(lens, scaled(lens.camera, kMinScale))) {
    return kMinScale;
  }
  double low = kMinScale;
  double high = kMaxScale;
  for (int i = 0; i < kNumHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (lies_inside(lens, scaled(lens.camera, middle)) ? high : low) = middle;
  }
  return high;
}

bool is_undistorted(const Lens& lens) {
  return lens.distortion != Distortion::kEquidistant &&
         std::all_of(lens.coefficients.begin(), lens.coefficients.end(),
                     [](double coefficient) { return coefficient == 0.0; });
}

}  // namespace

Expected<Undistortion> Undistortion::create(const Lens& lens) {
  Undistortion result;
  result.camera_ = lens.camera;
  if (is_undistorted(lens)) {
    return result;
  }
  const Expected<double> scale = find_scale(lens);
  if (!scale) {
    return scale.error();
  }
  result.camera_ = scaled(lens.camera, *scale);
  cv::Mat map(lens.camera.height_px, lens.camera.width_px, CV_32FC2);
  for (int v = 0; v < map.rows; ++v) {
    for (int u = 0; u < map.cols; ++u) {
      const Eigen::Vector2d uv = source_of(lens, result.camera_, u, v);
      map.at<cv::Vec2f>(v, u) = {static_cast<float>(uv.x()), static_cast<float>(uv.y())};
    }
  }
  cv::convertMaps(map, cv::noArray(), result.map_, result.map_fraction_, CV_16SC2);
  return result;
}

cv::Mat Undistortion::apply(const cv::Mat& picture) const {
  if (map_.empty()) {
    return picture;
  }
  // Cubic takes five times as long, and the path is no better for it.
  cv::Mat result;
  cv::remap(picture, result, map_, map_fraction_, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return result;
}

}  // namespace stemvo::dataset
