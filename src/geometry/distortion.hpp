// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>

#include "stemvo/camera.hpp"
#include "stemvo/error.hpp"

namespace stemvo {

[[nodiscard]] bool is_distorted(const Camera& camera);

/// Where the lens shows what a camera without distortion sees at `xy`: both on the plane z = 1.
/// OpenCV's formulas.
[[nodiscard]] Eigen::Vector2d distort(const Camera& camera, const Eigen::Vector2d& xy);

/// The pixel of the camera that shows what pixel `uv` of a view without distortion does.
[[nodiscard]] Eigen::Vector2d source_pixel(const Camera& camera,
                                           const Camera& view,
                                           const Eigen::Vector2d& uv);

/// The camera whose image is as large as frames are worked on: of more than 1.5 megapixels, sides
/// and intrinsics divided by 1.5, 2, 2.5, .. until 1.1 are left; 4K becomes 1280x720.
[[nodiscard]] Camera working_camera(Camera camera);

/// The view without distortion that is made of a camera's images. Size and principal point stay;
/// both focal lengths are scaled alike, to the widest view all of whose pixels come from inside the
/// image: black edges would give corners that stand still on the screen, and unequal scales would
/// stretch the image. The view is not widened by more than 1 / 0.8, which keeps resolution in the
/// middle; beyond that a wide lens loses its rim. Error: coefficients under which no such view of
/// half the width is left.
[[nodiscard]] Expected<Camera> undistorted_camera(const Camera& camera);

}  // namespace stemvo
