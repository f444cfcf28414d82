// SPDX-License-Identifier: MIT
#include "calibration/lens.hpp"

#include <cmath>
#include <vector>

#include <Eigen/QR>

#include "geometry/distortion.hpp"

namespace stemvo {
namespace {

/// A ray on the plane z = 1, and the pixel of the frame that shows it.
struct SeenRay {
  Eigen::Vector2d xy;
  Eigen::Vector2d uv;
};

/// IntrinsicsDelta, and the third and fourth coefficient of the lens: a centre that moves under a
/// strong lens looks like tangential distortion.
using LensDelta = Eigen::Matrix<double, 7, 1>;

Camera changed(Camera camera, const LensDelta& by) {
  camera.cx_px += by[0];
  camera.cy_px += by[1];
  camera.fx_px *= 1.0 + by[2];
  camera.fy_px *= 1.0 + by[2];
  camera.distortion_coefficients[0] += by[3];
  camera.distortion_coefficients[1] += by[4];
  camera.distortion_coefficients[2] += by[5];
  camera.distortion_coefficients[3] += by[6];
  return camera;
}

/// All over the view.
std::vector<SeenRay> seen_rays(const Camera& lens,
                               const Camera& view,
                               const IntrinsicsDelta& change) {
  LensDelta of_view = LensDelta::Zero();
  of_view.head<5>() = change;
  Camera truth = changed(view, of_view);
  truth.distortion = Distortion::kRadialTangential;
  truth.distortion_coefficients = {change[3], change[4]};
  std::vector<SeenRay> rays;
  constexpr int kSteps = 20;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Eigen::Vector2d xy = truth.normalize(
          {view.width_px * i / double{kSteps}, view.height_px * j / double{kSteps}});
      rays.push_back(
          {xy, source_pixel(lens, view, truth.project(distort(truth, xy).homogeneous()))});
    }
  }
  return rays;
}

Eigen::VectorXd errors_of(const Camera& lens, const std::vector<SeenRay>& rays) {
  Eigen::VectorXd errors(2 * std::ssize(rays));
  Eigen::Index row = 0;
  for (const SeenRay& ray : rays) {
    errors.segment<2>(row) = lens.project(distort(lens, ray.xy).homogeneous()) - ray.uv;
    row += 2;
  }
  return errors;
}

}  // namespace

Camera refined_lens(const Camera& lens, const Camera& view, const IntrinsicsDelta& change) {
  const Camera working = working_camera(lens);
  const std::vector<SeenRay> rays = seen_rays(working, view, change);
  Camera fitted = working;
  if (fitted.distortion == Distortion::kNone) {
    fitted.distortion = Distortion::kRadialTangential;
  }
  constexpr int kIterations = 10;  // Gauss-Newton; the fit is all but linear
  for (int i = 0; i < kIterations; ++i) {
    const Eigen::VectorXd errors = errors_of(fitted, rays);
    Eigen::Matrix<double, Eigen::Dynamic, 7> jacobian(errors.size(), 7);
    constexpr double kStep = 1e-6;
    for (int c = 0; c < 7; ++c) {
      const Camera moved = changed(fitted, kStep * LensDelta::Unit(c));
      jacobian.col(c) = (errors_of(moved, rays) - errors) / kStep;
    }
    fitted = changed(fitted, -jacobian.colPivHouseholderQr().solve(errors));
  }
  const double size = static_cast<double>(lens.width_px) / working.width_px;
  Camera result = fitted;
  result.width_px = lens.width_px;
  result.height_px = lens.height_px;
  result.fx_px = lens.fx_px * fitted.fx_px / working.fx_px;
  result.fy_px = lens.fy_px * fitted.fy_px / working.fy_px;
  result.cx_px = lens.cx_px + size * (fitted.cx_px - working.cx_px);
  result.cy_px = lens.cy_px + size * (fitted.cy_px - working.cy_px);
  return result;
}

}  // namespace stemvo
