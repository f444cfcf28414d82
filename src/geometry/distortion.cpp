// SPDX-License-Identifier: MIT
#include "geometry/distortion.hpp"

#include <algorithm>
#include <cmath>
#include <ranges>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace stemvo {
namespace {

constexpr double kMaxPixels = 1.5e6;      ///< of a frame that is worked on as it is
constexpr double kWorkingPixels = 1.1e6;  ///< at most, of one that is not
constexpr double kStep = 0.5;             ///< between the divisors that are tried

constexpr double kMinScale = 0.8;
constexpr double kMaxScale = 2.0;
constexpr int kNumHalvings = 30;  // of the interval between them

/// Distance from the centre, without the tangential part, which is small and moves all around.
double distorted_radius(const Camera& camera, double radius) {
  const auto& k = camera.distortion_coefficients;
  switch (camera.distortion) {
    case Distortion::kRadialTangential: {
      const double square = radius * radius;
      return radius * (1.0 + square * (k[0] + square * (k[1] + square * k[4]))) /
             (1.0 + square * (k[5] + square * (k[6] + square * k[7])));
    }
    case Distortion::kEquidistant: {
      const double angle = std::atan(radius);
      const double square = angle * angle;
      return angle * (1.0 + square * (k[0] + square * (k[1] + square * (k[2] + square * k[3]))));
    }
    case Distortion::kNone:
      break;
  }
  return radius;
}

/// Whether the lens shows things farther out farther out, from the centre up to this distance on
/// the plane z = 1. Polynomials turn around somewhere; there they show other things a second time.
bool is_one_to_one(const Camera& camera, double radius) {
  constexpr int kNumSteps = 256;
  double last = 0.0;
  for (int i = 1; i <= kNumSteps; ++i) {
    const double next = distorted_radius(camera, radius * i / kNumSteps);
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

/// Whether all pixels of the view come from inside the lens' image. Those of the rim decide.
bool lies_inside(const Camera& camera, const Camera& view) {
  const double right = view.width_px - 1;
  const double bottom = view.height_px - 1;
  const auto is_inside = [&](double u, double v) {
    const Eigen::Vector2d uv = source_pixel(camera, view, {u, v});
    return uv.x() >= 0.0 && uv.x() <= right && uv.y() >= 0.0 && uv.y() <= bottom;
  };
  double radius = 0.0;
  for (const double u : {0.0, right}) {
    for (const double v : {0.0, bottom}) {
      radius = std::max(radius, view.normalize({u, v}).norm());
    }
  }
  const auto is_column_inside = [&](int u) { return is_inside(u, 0.0) && is_inside(u, bottom); };
  const auto is_row_inside = [&](int v) { return is_inside(0.0, v) && is_inside(right, v); };
  return is_one_to_one(camera, radius) &&
         std::ranges::all_of(std::views::iota(0, view.width_px), is_column_inside) &&
         std::ranges::all_of(std::views::iota(0, view.height_px), is_row_inside);
}

/// The smallest scale of the focal lengths whose view lies inside.
Expected<double> find_scale(const Camera& camera, const Camera& view) {
  if (!lies_inside(camera, scaled(view, kMaxScale))) {
    return fail(
        fmt::format("expected distortion coefficients that leave half of the image "
                    "usable, found [{}]",
                    fmt::join(camera.distortion_coefficients, ", ")));
  }
  if (lies_inside(camera, scaled(view, kMinScale))) {
    return kMinScale;
  }
  double low = kMinScale;
  double high = kMaxScale;
  for (int i = 0; i < kNumHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (lies_inside(camera, scaled(view, middle)) ? high : low) = middle;
  }
  return high;
}

}  // namespace

bool is_distorted(const Camera& camera) {
  return camera.distortion == Distortion::kEquidistant ||
         (camera.distortion == Distortion::kRadialTangential &&
          std::ranges::any_of(camera.distortion_coefficients,
                              [](double coefficient) { return coefficient != 0.0; }));
}

Eigen::Vector2d distort(const Camera& camera, const Eigen::Vector2d& xy) {
  const double radius = xy.norm();
  if (!(radius > 0.0)) {
    return xy;
  }
  Eigen::Vector2d result = distorted_radius(camera, radius) / radius * xy;
  if (camera.distortion == Distortion::kRadialTangential) {
    const auto& k = camera.distortion_coefficients;
    const double p1 = k[2];
    const double p2 = k[3];
    const double square = radius * radius;
    const double xx = xy.x() * xy.x();
    const double yy = xy.y() * xy.y();
    const double two_xy = 2.0 * xy.x() * xy.y();
    result.x() += p1 * two_xy + p2 * (3.0 * xx + yy) + square * (k[8] + square * k[9]);
    result.y() += p2 * two_xy + p1 * (xx + 3.0 * yy) + square * (k[10] + square * k[11]);
  }
  return result;
}

Eigen::Vector2d source_pixel(const Camera& camera, const Camera& view, const Eigen::Vector2d& uv) {
  const Eigen::Vector2d xy = distort(camera, view.normalize(uv));
  return camera.project({xy.x(), xy.y(), 1.0});
}

Camera working_camera(Camera camera) {
  const double num_pixels = static_cast<double>(camera.width_px) * camera.height_px;
  if (num_pixels <= kMaxPixels) {
    return camera;
  }
  double divisor = 1.0;
  while (num_pixels / (divisor * divisor) > kWorkingPixels) {
    divisor += kStep;
  }
  const int width_px = std::max(1, static_cast<int>(std::lround(camera.width_px / divisor)));
  const int height_px = std::max(1, static_cast<int>(std::lround(camera.height_px / divisor)));
  const double x_scale = static_cast<double>(width_px) / camera.width_px;
  const double y_scale = static_cast<double>(height_px) / camera.height_px;
  camera.fx_px *= x_scale;
  camera.fy_px *= y_scale;
  camera.cx_px = x_scale * (camera.cx_px + 0.5) - 0.5;  // a pixel's centre is its coordinate
  camera.cy_px = y_scale * (camera.cy_px + 0.5) - 0.5;
  camera.width_px = width_px;
  camera.height_px = height_px;
  return camera;
}

Expected<Camera> undistorted_camera(const Camera& camera) {
  Camera view = camera;
  view.distortion = Distortion::kNone;
  view.distortion_coefficients = {};
  if (!is_distorted(camera)) {
    return view;
  }
  return find_scale(camera, view).map([&](double scale) { return scaled(view, scale); });
}

}  // namespace stemvo
