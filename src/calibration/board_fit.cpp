// SPDX-License-Identifier: MIT
#include "calibration/board_fit.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>

#include "geometry/median.hpp"

namespace stemvo {
namespace {

constexpr std::size_t kMinViews = 3;

/// The camera by the views that are used, which get their poses and errors.
Expected<BoardFit> fit_once(std::vector<BoardView*> views, const cv::Size& size, bool has_k3) {
  std::vector<std::vector<cv::Point3f>> boards;
  std::vector<std::vector<cv::Point2f>> images;
  for (const BoardView* view : views) {
    boards.push_back(view->points.on_board);
    images.push_back(view->points.in_image);
  }
  cv::Mat1d k;
  cv::Mat1d lens;
  cv::Mat1d sigmas;
  cv::Mat1d errors_px;
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  BoardFit fit;
  try {
    fit.error_px = cv::calibrateCamera(
        boards, images, size, k, lens, rotations, translations, sigmas, cv::noArray(), errors_px,
        cv::CALIB_USE_LU | (has_k3 ? 0 : cv::CALIB_FIX_K3),
        {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-12});
  } catch (const cv::Exception&) {
    return fail("expected views that tell a camera, found none; tilt the board");
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    views[i]->camera_from_board_r = cv::Vec3d(rotations[i]);
    views[i]->camera_from_board_t = cv::Vec3d(translations[i]);
    views[i]->error_px = errors_px(static_cast<int>(i));
  }
  fit.camera = {k(0, 0), k(1, 1), k(0, 2), k(1, 2), size.width, size.height};
  fit.camera.distortion = Distortion::kRadialTangential;
  std::copy_n(lens.begin(), 5, fit.camera.distortion_coefficients.begin());
  const auto& d = fit.camera.distortion_coefficients;
  const double values[] = {k(0, 0), k(1, 1), k(0, 2), k(1, 2), d[0], d[1], d[2], d[3], d[4]};
  constexpr const char* kNames[] = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"};
  for (int i = 0; i < (has_k3 ? 9 : 8); ++i) {
    fit.numbers.push_back({kNames[i], values[i], sigmas(i)});
  }
  return fit;
}

/// The worst of the views, where it is none of the others' kind.
BoardView* find_odd(const std::vector<BoardView*>& views) {
  constexpr double kMaxRatio = 3.0;
  constexpr double kMaxError_px = 0.25;
  std::vector<double> errors_px;
  std::ranges::transform(views, std::back_inserter(errors_px), &BoardView::error_px);
  BoardView* const worst = *std::ranges::max_element(views, {}, &BoardView::error_px);
  const double limit_px = std::max(kMaxError_px, kMaxRatio * median(errors_px));
  return views.size() > kMinViews && worst->error_px > limit_px ? worst : nullptr;
}

/// No camera sees a board that was named wrong. Error: this one is.
Expected<BoardFit> check_fit(const BoardFit& fit, const cv::Size& size) {
  constexpr double kMaxError = 0.003;  // of the image's width
  const bool is_finite = std::ranges::all_of(fit.numbers, [](const FittedNumber& number) {
    return std::isfinite(number.value) && std::isfinite(number.sigma);
  });
  if (!is_finite || !(fit.error_px <= kMaxError * size.width)) {
    return fail(fmt::format(
        "expected corners within {:.1f} px of where a camera sees the board's, found {:.1f} px: "
        "another board than --board says (an aprilgrid's gap is in metres), or a fisheye lens",
        kMaxError * size.width, fit.error_px));
  }
  return fit;
}

}  // namespace

Expected<BoardFit> fit_camera(std::vector<BoardView>& views, const cv::Size& size) {
  std::vector<BoardView*> used;
  std::ranges::transform(views, std::back_inserter(used), [](BoardView& view) { return &view; });
  if (used.size() < kMinViews) {
    return fail(
        fmt::format("expected at least {} pictures with the board, found {}; --board "
                    "counts a chessboard's inner corners",
                    kMinViews, used.size()));
  }
  constexpr double kMinSigmas = 3.0;
  for (bool has_k3 = true;;) {
    const auto fit = fit_once(used, size, has_k3);
    BoardView* const odd = fit ? find_odd(used) : nullptr;
    if (odd != nullptr) {
      odd->is_used = false;
      std::erase(used, odd);
    } else if (fit && has_k3 &&
               !(std::abs(fit->numbers.back().value) > kMinSigmas * fit->numbers.back().sigma)) {
      has_k3 = false;
    } else {
      return fit ? check_fit(*fit, size) : fit;
    }
  }
}

}  // namespace stemvo
