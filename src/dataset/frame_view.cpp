// SPDX-License-Identifier: MIT
#include "dataset/frame_view.hpp"

#include <cmath>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace stemvo::dataset {
namespace {

constexpr double kMaxPixels = 1.5e6;      ///< of a frame that is worked on as it is
constexpr double kWorkingPixels = 1.1e6;  ///< at most, of one that is not
constexpr double kStep = 0.5;             ///< between the divisors that are tried

double divisor_of(double num_pixels) {
  double divisor = 1.0;
  while (num_pixels > kMaxPixels && num_pixels / (divisor * divisor) > kWorkingPixels) {
    divisor += kStep;
  }
  return divisor;
}

}  // namespace

Lens working_lens(Lens lens) {
  Camera& camera = lens.camera;
  const double divisor = divisor_of(static_cast<double>(camera.width_px) * camera.height_px);
  if (divisor == 1.0) {
    return lens;
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
  return lens;
}

Expected<FrameView> FrameView::create(const Lens& lens, const std::filesystem::path& camera_file) {
  auto undistortion = Undistortion::create(working_lens(lens));
  if (!undistortion) {
    return fail(fmt::format("{}: {}", camera_file.string(), undistortion.error().message));
  }
  return FrameView(cv::Size(lens.camera.width_px, lens.camera.height_px), *std::move(undistortion));
}

cv::Mat FrameView::apply(const cv::Mat& image) const {
  const cv::Size size(camera().width_px, camera().height_px);
  if (size == full_size_) {
    return undistortion_.apply(image);
  }
  cv::Mat small;
  cv::resize(image, small, size, 0.0, 0.0, cv::INTER_AREA);
  return undistortion_.apply(small);
}

cv::Mat FrameView::apply_to_mask(const cv::Mat& mask) const {
  return mask.empty() ? mask : cv::Mat(apply(mask) == 255);
}

}  // namespace stemvo::dataset
