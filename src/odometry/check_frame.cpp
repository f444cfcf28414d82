// SPDX-License-Identifier: MIT
#include "odometry/check_frame.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/imgproc.hpp>

#include "geometry/degrees.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

Status check_pixels(const char* name, const cv::Mat& pixels, int type, const Camera& camera) {
  const cv::Size size(camera.width_px, camera.height_px);
  if (pixels.size() != size || pixels.type() != type) {
    return fail(fmt::format("{}: expected {}x{} pixels of {}, found {}x{} of {}", name, size.width,
                            size.height, cv::typeToString(type), pixels.cols, pixels.rows,
                            cv::typeToString(pixels.type())));
  }
  return {};
}

Status check_rotation(const std::optional<Eigen::Quaterniond>& rotation) {
  constexpr double kMaxOff = 0.01;  // single precision and a few products are within
  if (rotation && !(std::abs(rotation->norm() - 1.0) < kMaxOff)) {
    return fail(fmt::format("prev_from_cur: expected a quaternion of length 1, found one of {}",
                            rotation->norm()));
  }
  return {};
}

double view_deg_of(const Camera& camera) {
  return 2.0 * kDegPerRad *
         std::atan(0.5 * std::max(camera.width_px / camera.fx_px, camera.height_px / camera.fy_px));
}

/// The principal point in halves of the image's sides: (1, 1) is the middle.
Eigen::Vector2d center_of(const Camera& camera) {
  return {2.0 * camera.cx_px / camera.width_px, 2.0 * camera.cy_px / camera.height_px};
}

/// How much larger images the centre is the middle of, if over `least` and alike in both; else 1.
double told_scale(const Camera& camera, double least) {
  const Eigen::Vector2d center = center_of(camera);
  const double scale = std::sqrt(center.prod());
  const double log_scale = std::abs(std::log(scale));
  const bool is_told =
      log_scale > std::log(least) && std::abs(std::log(center.x() / center.y())) < 0.5 * log_scale;
  return is_told && scale < 100.0 ? scale : 1.0;
}

Status check_center(const Camera& camera, const std::string& owner) {
  const Eigen::Vector2d center = center_of(camera);
  const double scale = told_scale(camera, 1.25);
  const bool is_inside = center.minCoeff() > 0.0 && center.maxCoeff() < 2.0;
  if (is_inside && scale == 1.0) {
    return {};
  }
  const std::string hint =
      scale != 1.0 ? fmt::format(": a calibration of images about {:.2g} times as large?", scale)
                   : "";
  return fail(
      fmt::format("{}: expected a principal point {} images of {}x{} pixels, found ({}, {}){}",
                  owner, is_inside ? "near the middle of" : "inside", camera.width_px,
                  camera.height_px, camera.cx_px, camera.cy_px, hint));
}

}  // namespace

// Written so that NaN fails.
Status check_camera(const Camera& camera, const std::string& owner) {
  const auto is_side = [](int pixels) { return pixels > 0 && pixels <= kMaxImageSide_px; };
  if (!is_side(camera.width_px) || !is_side(camera.height_px)) {
    return fail(fmt::format("{}: expected a size of 1 to {} pixels a side, found {}x{}", owner,
                            kMaxImageSide_px, camera.width_px, camera.height_px));
  }
  if (!(camera.fx_px > 0.0 && camera.fy_px > 0.0 && std::isfinite(camera.fx_px) &&
        std::isfinite(camera.fy_px))) {
    return fail(fmt::format("{}: expected focal lengths above 0 px, found {} and {}", owner,
                            camera.fx_px, camera.fy_px));
  }
  if (!(view_deg_of(camera) <= 170.0)) {
    return fail(fmt::format(
        "{}: expected a field of view of at most 170 degrees, found {:.4g}, for focal lengths are "
        "{} and {} pixels{}",
        owner, view_deg_of(camera), camera.fx_px, camera.fy_px,
        camera.fx_px < 10.0 ? "; those relative to the image's size are to be multiplied by it"
                            : ""));
  }
  STEMVO_TRY(check_center(camera, owner));
  const auto& k = camera.distortion_coefficients;
  const auto num = static_cast<std::size_t>(camera.distortion == Distortion::kNone          ? 0
                                            : camera.distortion == Distortion::kEquidistant ? 4
                                                                                            : 12);
  if (!std::ranges::all_of(k, [](double value) { return std::isfinite(value); }) ||
      std::any_of(k.begin() + num, k.end(), [](double value) { return value != 0.0; })) {
    return fail(fmt::format(
        "{}: expected finite distortion coefficients, 0 beyond the {} of its model, found [{}]",
        owner, num, fmt::join(k, ", ")));
  }
  return {};
}

std::string doubt_of(const Camera& camera) {
  constexpr double kMaxOff = 0.15;
  constexpr double kMinView_deg = 10.0;
  constexpr double kMaxView_deg = 130.0;  // of a lens that is no fisheye
  const double view_deg = view_deg_of(camera);
  const bool is_large = view_deg > kMaxView_deg && camera.distortion != Distortion::kEquidistant;
  if (view_deg < kMinView_deg || is_large) {
    return fmt::format("a field of view of {:.1f} degrees is {}: is the focal length in pixels?",
                       view_deg, is_large ? "large for a lens that is no fisheye" : "small");
  }
  constexpr double kMaxRatio = 1.2;
  const double ratio = camera.fx_px / camera.fy_px;
  if (std::max(ratio, 1.0 / ratio) > kMaxRatio) {
    return fmt::format(
        "focal lengths of {:.1f} and {:.1f} pixels are far apart: were the images made smaller in "
        "one direction more than in the other?",
        camera.fx_px, camera.fy_px);
  }
  const double scale = told_scale(camera, 1.07);
  if (scale == 1.0 && (center_of(camera).array() - 1.0).abs().maxCoeff() <= kMaxOff) {
    return {};
  }
  return fmt::format(
      "the principal point ({:.1f}, {:.1f}) is far from the middle of images of {}x{} pixels: were "
      "they cut, or is the calibration of {}?",
      camera.cx_px, camera.cy_px, camera.width_px, camera.height_px,
      scale == 1.0 ? "another size" : fmt::format("images about {:.2g} times as large", scale));
}

Status check_time(const std::string& name,
                  double time_s,
                  std::optional<double> last_s,
                  const std::string& of_last) {
  constexpr double kMax_s = 1e11;  // 3,000 years: those since 1970 in another unit are above it
  const bool is_late = last_s && time_s <= *last_s;
  if (std::abs(time_s) <= kMax_s && !is_late) {
    return {};
  }
  return fail(fmt::format("{}: expected {}, found {} s", name,
                          is_late ? fmt::format("one after the last {}'s, {} s", of_last, *last_s)
                                  : fmt::format("a finite number of seconds up to {:g}", kMax_s),
                          time_s));
}

Status check_mask(const cv::Mat& mask, const Camera& camera) {
  return mask.empty() ? Status() : check_pixels("mask", mask, CV_8UC1, camera);
}

cv::Mat rgb_of(const cv::Mat& image, PixelOrder order) {
  cv::Mat rgb = image;
  if (order == PixelOrder::kBgr) {
    rgb = cv::Mat();  // of its own: the caller's pixels are not ours
    cv::cvtColor(image, rgb, cv::COLOR_BGR2RGB);
  }
  return rgb;
}

Status FrameCheck::admit(const cv::Mat& image,
                         PixelOrder order,
                         double time_s,
                         const FrameHints& hints) {
  const int type = order == PixelOrder::kGray ? CV_8UC1 : CV_8UC3;
  STEMVO_TRY(check_pixels("image", image, type, camera_));
  STEMVO_TRY(check_time("time", time_s, last_time_s_, "frame"));
  STEMVO_TRY(check_mask(hints.mask, camera_));
  STEMVO_TRY(check_rotation(hints.prev_from_cur));
  last_time_s_ = time_s;
  return {};
}

Status FrameCheck::check_none_admitted(const std::string& asked) const {
  return last_time_s_ ? Status(fail(asked + ": expected a call before the first frame, found one "
                                            "behind it"))
                      : Status();
}

}  // namespace stemvo
