// SPDX-License-Identifier: MIT
#include "odometry/check_camera.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace stemvo {

// Written so that NaN fails.
Status check_camera(const Camera& camera) {
  const auto is_side = [](int pixels) { return pixels > 0 && pixels <= kMaxImageSide_px; };
  if (!is_side(camera.width_px) || !is_side(camera.height_px)) {
    return fail(fmt::format("camera: expected a size of 1 to {} pixels a side, found {}x{}",
                            kMaxImageSide_px, camera.width_px, camera.height_px));
  }
  if (!(camera.fx_px > 0.0 && camera.fy_px > 0.0 && std::isfinite(camera.fx_px) &&
        std::isfinite(camera.fy_px))) {
    return fail(fmt::format("camera: expected focal lengths above 0 px, found {} and {}",
                            camera.fx_px, camera.fy_px));
  }
  if (!std::isfinite(camera.cx_px) || !std::isfinite(camera.cy_px)) {
    return fail(fmt::format("camera: expected a finite principal point, found {}, {}", camera.cx_px,
                            camera.cy_px));
  }
  if (!std::ranges::all_of(camera.distortion_coefficients,
                           [](double value) { return std::isfinite(value); })) {
    return fail(fmt::format("camera: expected finite distortion coefficients, found [{}]",
                            fmt::join(camera.distortion_coefficients, ", ")));
  }
  return {};
}

}  // namespace stemvo
