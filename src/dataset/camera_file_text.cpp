// SPDX-License-Identifier: MIT
#include <algorithm>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "dataset/camera_file.hpp"

namespace stemvo::dataset {

std::string camera_file_text(const CameraFile& file) {
  const Camera& camera = file.camera;
  constexpr const char* kModels[] = {"none", "radial-tangential", "equidistant"};
  const auto model = static_cast<std::size_t>(camera.distortion);
  constexpr std::size_t kNumCoefficients[] = {0, 5, 4};
  const std::span<const double> all = camera.distortion_coefficients;
  const bool has_more = std::ranges::any_of(all.subspan(5), [](double k) { return k != 0.0; });
  const auto coefficients = all.first(has_more ? all.size() : kNumCoefficients[model]);
  std::string text = fmt::format(
      "image_width: {}\nimage_height: {}\ncamera_model: pinhole\n"
      "intrinsics: [{:.4f}, {:.4f}, {:.4f}, {:.4f}]  # fx, fy, cx, cy\n"
      "distortion_model: {}\ndistortion_coefficients: [{:.6f}]\n",
      camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px,
      kModels[model], fmt::join(coefficients, ", "));
  if (file.body_from_camera) {
    const Matrix34d matrix = file.body_from_camera->matrix();
    const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows = matrix;
    text += fmt::format("T_BS: [{:.9f}]\n", fmt::join(rows.data(), rows.data() + 12, ", "));
  }
  if (file.rate_hz) {
    text += fmt::format("rate_hz: {}\n", *file.rate_hz);
  }
  if (file.camera_height_m) {
    text += fmt::format("camera_height: {}\n", *file.camera_height_m);
  }
  return text;
}

}  // namespace stemvo::dataset
