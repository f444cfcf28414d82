// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration/board.hpp"
#include "geometry/degrees.hpp"
#include "geometry/median.hpp"
#include "odometry/check_frame.hpp"
#include "report/frame_image.hpp"

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

/// The board's normal, in the camera's axes.
cv::Vec3d normal_of(const BoardView& view) {
  cv::Matx33d rotation;
  cv::Rodrigues(view.camera_from_board_r, rotation);
  return {rotation(0, 2), rotation(1, 2), rotation(2, 2)};
}

/// The largest angle between two of the boards' normals, about: rad.
double spread_of_tilts(const std::vector<BoardView*>& views) {
  Eigen::AlignedBox3d box;
  for (const BoardView* view : views) {
    box.extend(Eigen::Vector3d(normal_of(*view).val));
  }
  return box.diagonal().norm();
}

/// No camera sees a board that was named wrong; boards that are all parallel tell none, whatever
/// the sigmas of what was fitted. Error: these do not.
Expected<BoardFit> check_fit(const BoardFit& fit,
                             const cv::Size& size,
                             const std::vector<BoardView*>& views) {
  constexpr double kMaxError = 0.003;  // of the image's width
  constexpr double kMinTilts_rad = 0.1;
  constexpr double kMaxRatio = 1.5;  // of pixels' sides
  const bool is_finite =
      std::isfinite(fit.error_px) && std::ranges::all_of(fit.numbers, [](const auto& number) {
        return std::isfinite(number.value) && std::isfinite(number.sigma);
      });
  if (fit.error_px > kMaxError * size.width) {
    return fail(fmt::format(
        "expected corners within {:.1f} px of where a camera sees the board's, found {:.1f} px: "
        "another board than --board says (an aprilgrid's gap is in metres), or a fisheye lens",
        kMaxError * size.width, fit.error_px));
  }
  const double ratio = fit.camera.fx_px / fit.camera.fy_px;
  const Status camera = check_camera(fit.camera);
  const double tilts_rad = spread_of_tilts(views);
  if (!is_finite || !(tilts_rad > kMinTilts_rad) || std::max(ratio, 1.0 / ratio) > kMaxRatio ||
      !camera) {
    return fail(
        fmt::format("expected boards of different tilts, by 20 to 45 degrees, found ones "
                    "that tell no camera: tilts differ by {:.1f} degrees, fx {:.4g}, fy "
                    "{:.4g}{}",
                    kDegPerRad * tilts_rad, fit.camera.fx_px, fit.camera.fy_px,
                    camera ? "" : ", " + camera.error().message));
  }
  return fit;
}

constexpr int kColumns = 9;  ///< of cells; three to a part of the image
constexpr int kRows = 6;     ///< two to a part

/// Not 0 where there are corners.
cv::Mat1b covered_cells(const std::vector<BoardView>& views, const cv::Size& size) {
  cv::Mat1b cells(kRows, kColumns, std::uint8_t{0});
  for (const BoardView& view : views) {
    for (const cv::Point2f& corner : view.points.in_image) {
      const int x = std::clamp(static_cast<int>(corner.x * kColumns / size.width), 0, kColumns - 1);
      const int y = std::clamp(static_cast<int>(corner.y * kRows / size.height), 0, kRows - 1);
      cells(y, x) |= view.is_used ? 1 : 0;
    }
  }
  return cells;
}

/// Parts of the image, of nine, less than half of which have corners.
std::vector<std::string> empty_parts(const cv::Mat1b& cells) {
  constexpr const char* kAcross[] = {"left", "middle", "right"};
  constexpr const char* kDown[] = {"upper", "middle", "lower"};
  std::vector<std::string> parts;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      if (cv::countNonZero(cells(cv::Rect(3 * column, 2 * row, 3, 2))) < 3) {
        parts.push_back(
            row == 1 && column == 1 ? "middle" : fmt::format("{} {}", kDown[row], kAcross[column]));
      }
    }
  }
  return parts;
}

/// Bounds of what the views show the board as.
struct Spread {
  cv::Vec4d tilts;       ///< sines of the most, with the left, right, upper, lower side nearer
  double largest = 0.0;  ///< share of the image's width or height that the board takes
  double nearest_m = std::numeric_limits<double>::infinity();
  double farthest_m = 0.0;
};

Spread spread_of(const std::vector<BoardView>& views, const cv::Size& size) {
  Spread spread;
  for (const BoardView& view : views) {
    if (!view.is_used) {
      continue;
    }
    cv::Vec3d normal = normal_of(view);
    normal *= normal[2] < 0.0 ? -1.0 : 1.0;  // away from the camera
    const double tilts[] = {-normal[0], normal[0], -normal[1], normal[1]};
    for (int i = 0; i < 4; ++i) {
      spread.tilts[i] = std::max(spread.tilts[i], tilts[i]);
    }
    const cv::Rect2f box = cv::boundingRect(view.points.in_image);
    spread.largest = std::max(
        {spread.largest, double{box.width} / size.width, double{box.height} / size.height});
    spread.nearest_m = std::min(spread.nearest_m, view.camera_from_board_t[2]);
    spread.farthest_m = std::max(spread.farthest_m, view.camera_from_board_t[2]);
  }
  return spread;
}

}  // namespace

Expected<BoardFit> fit_camera(std::vector<BoardView>& views, const cv::Size& size) {
  std::vector<BoardView*> used;
  std::ranges::transform(views, std::back_inserter(used), [](BoardView& view) { return &view; });
  if (used.size() < kMinViews) {
    return fail(
        fmt::format("expected at least {} pictures with the board, found {}; is it as "
                    "--board says (a chessboard's inner corners, a ChArUco's dictionary)?",
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
      return fit ? check_fit(*fit, size, used) : fit;
    }
  }
}

std::vector<std::string> missing_views(const std::vector<BoardView>& views, const cv::Size& size) {
  constexpr std::ptrdiff_t kEnoughViews = 12;
  constexpr double kMinTilt = 0.3;  // sine: 17 degrees
  constexpr double kMinShare = 0.5;
  constexpr double kMinRatio = 1.4;
  std::vector<std::string> missing;
  const std::vector<std::string> parts = empty_parts(covered_cells(views, size));
  if (!parts.empty()) {
    missing.push_back(fmt::format("the board in the {} of the image", fmt::join(parts, ", ")));
  }
  const Spread spread = spread_of(views, size);
  constexpr const char* kSides[] = {"left", "right", "upper", "lower"};
  for (int i = 0; i < 4; ++i) {
    if (spread.tilts[i] < kMinTilt) {
      missing.push_back(fmt::format("its {} side nearer, tilted by 20 to 45 degrees", kSides[i]));
    }
  }
  if (spread.largest < kMinShare) {
    missing.emplace_back("from nearer, so that it fills half of the image");
  }
  if (spread.farthest_m < kMinRatio * spread.nearest_m) {
    missing.emplace_back("from farther away, half again as far as the nearest");
  }
  const auto num_used = std::ranges::count_if(views, &BoardView::is_used);
  if (num_used < kEnoughViews) {
    missing.push_back(fmt::format("{} views more", kEnoughViews - num_used));
  }
  return missing;
}

cv::Mat draw_coverage(const std::vector<BoardView>& views, const cv::Size& size) {
  constexpr double kWidth_px = 960.0;
  const double scale = kWidth_px / size.width;
  cv::Mat image(cvRound(scale * size.height), cvRound(kWidth_px), CV_8UC3, cv::Scalar::all(255));
  const cv::Mat1b cells = covered_cells(views, size);
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const cv::Point from(image.cols * column / kColumns, image.rows * row / kRows);
      const cv::Point to(image.cols * (column + 1) / kColumns, image.rows * (row + 1) / kRows);
      if (cells(row, column) == 0) {
        cv::rectangle(image, from, to, cv::Scalar(250, 205, 200), cv::FILLED);
      }
      cv::rectangle(image, from, to, cv::Scalar::all(225));
    }
  }
  for (const BoardView& view : views) {
    for (const cv::Point2f& corner : view.points.in_image) {
      cv::circle(image, cv::Point2d(corner) * scale, 3,
                 view.is_used ? cv::Scalar(20, 90, 150) : cv::Scalar::all(150),
                 view.is_used ? cv::FILLED : 1, cv::LINE_AA);
    }
  }
  return draw_under_caption(image, "corners; hollow: of views left out", "red: no corners yet");
}

}  // namespace stemvo
