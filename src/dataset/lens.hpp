// SPDX-License-Identifier: MIT
#pragma once

#include <array>

#include <Eigen/Core>

#include "stemvo/geometry/camera.hpp"

namespace stemvo::dataset {

enum class Distortion {
  kNone,
  kRadialTangential,  ///< OpenCV's k1 k2 p1 p2 k3
  kEquidistant,       ///< OpenCV's fisheye k1 k2 k3 k4
};

/// A camera as it comes out of the box.
struct Lens {
  Camera camera;
  Distortion distortion = Distortion::kNone;
  std::array<double, 5> coefficients = {};  ///< those a model does not have are 0
};

/// Where the lens shows what a pinhole camera of focal length 1 sees at `xy`: both on the plane
/// z = 1. OpenCV's formulas.
[[nodiscard]] Eigen::Vector2d distort(const Lens& lens, const Eigen::Vector2d& xy);

/// Whether the lens shows things farther out farther out, from the centre up to this distance on
/// the plane z = 1. Polynomials turn around somewhere; there they show other things a second time.
[[nodiscard]] bool is_one_to_one(const Lens& lens, double radius);

}  // namespace stemvo::dataset
