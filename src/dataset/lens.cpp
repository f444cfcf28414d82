// SPDX-License-Identifier: MIT
#include "dataset/lens.hpp"

#include <cmath>

namespace stemvo::dataset {
namespace {

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

}  // namespace stemvo::dataset
