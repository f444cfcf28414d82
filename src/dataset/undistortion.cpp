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

/// Distance from the centre, without the tangential part, which is small and moves all around.
double distorted_radius(const Lens& lens, double radius) {
  const auto& [k1, k2, k3, k4, k5] = lens.coefficients;
  switch (lens.distortion) {
    case Distortion::kRadialTangential: {
      const double square = radius * radius;
      return radius * (1.0 + square * (k1 + square * (k2 + square * k5)));
    }
    case Distortion::kEquidistant: {
      const double angle = std::atan(radius);
      const double square = angle * angle;
      return angle * (1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4))));
    }
    case Distortion::kNone:
      break;
  }
  return radius;
}

/// Whether the lens shows things farther out farther out, from the centre up to this distance on
/// the plane z = 1. Polynomials turn around somewhere; there they show other things a second time.
bool is_one_to_one(const Lens& lens, double radius) {
  constexpr int kNumSteps = 256;
  double last = 0.0;
  for (int i = 1; i <= kNumSteps; ++i) {
    const double next = distorted_radius(lens, radius * i / kNumSteps);
    if (!(next > last)) {
      return false;
    }
    last = next;
  }
  return true;
}

Camera scaled(Camera camera, double scale) {
  camera.fx_px *= scale;
  camera.fy_px *= scale;
  return camera;
}

/// Where the lens' image shows a pixel of the view.
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
        fmt::format("expected distortion_coefficients that leave half of the image "
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

Eigen::Vector2d distort(const Lens& lens, const Eigen::Vector2d& xy) {
  const double radius = xy.norm();
  if (!(radius > 0.0)) {
    return xy;
  }
  Eigen::Vector2d result = distorted_radius(lens, radius) / radius * xy;
  if (lens.distortion == Distortion::kRadialTangential) {
    const double p1 = lens.coefficients[2];
    const double p2 = lens.coefficients[3];
    const double xx = xy.x() * xy.x();
    const double yy = xy.y() * xy.y();
    const double two_xy = 2.0 * xy.x() * xy.y();
    result.x() += p1 * two_xy + p2 * (3.0 * xx + yy);
    result.y() += p2 * two_xy + p1 * (xx + 3.0 * yy);
  }
  return result;
}

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

cv::Mat Undistortion::apply(const cv::Mat& image) const {
  if (map_.empty()) {
    return image;
  }
  // Cubic takes five times as long, and the path is no better for it.
  cv::Mat result;
  cv::remap(image, result, map_, map_fraction_, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return result;
}

}  // namespace stemvo::dataset
