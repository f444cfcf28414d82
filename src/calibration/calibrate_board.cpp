// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <ranges>

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration/board.hpp"
#include "calibration/calibrate.hpp"
#include "dataset/camera_file.hpp"
#include "dataset/frame_files.hpp"
#include "dataset/listing.hpp"
#include "dataset/video_stream.hpp"
#include "io/image_file.hpp"
#include "report/frame_image.hpp"
#include "text/text_file.hpp"
#include "text/text_table.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

/// Most corners of it are elsewhere in every view so far.
bool differs(const BoardPoints& points, const cv::Size& size, const std::vector<BoardView>& views) {
  constexpr double kMinShift = 0.04;  // of the image's width
  return std::ranges::none_of(views, [&](const BoardView& view) {
    const auto& others = view.points.in_image;
    const std::size_t count = std::min(others.size(), points.in_image.size());
    double sum_px = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      sum_px += cv::norm(others[i] - points.in_image[i]);
    }
    return sum_px < kMinShift * size.width * static_cast<double>(count);
  });
}

/// Adds the view of a picture, if the board is in it. `must_differ`: from the views so far.
Status add_view(const Board& board,
                const std::string& name,
                const cv::Mat& gray,
                bool must_differ,
                BoardReport& report) {
  ++report.num_pictures;
  STEMVO_TRY_GET(BoardPoints points, find_board(board, gray));
  if (!points.in_image.empty() && (!must_differ || differs(points, gray.size(), report.views))) {
    report.views.push_back({name, std::move(points)});
  }
  return {};
}

/// The part of the error that a corner shares with the next one, as noise does not: what no camera
/// explains that is the same in all views.
double shared_error_px(const std::vector<BoardView>& views, const Camera& camera) {
  const cv::Matx33d k(camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1);
  double sum_px2 = 0.0;
  double count = 0.0;
  for (const BoardView& view : views | std::views::filter(&BoardView::is_used)) {
    cv::Mat off;
    cv::projectPoints(view.points.on_board, view.camera_from_board_r, view.camera_from_board_t, k,
                      camera.distortion_coefficients, off);
    off -= cv::Mat(view.points.in_image);
    sum_px2 += off.rowRange(1, off.rows).dot(off.rowRange(0, off.rows - 1));
    count += off.rows;
  }
  return std::sqrt(std::max(0.0, sum_px2 / count));
}

/// The size that most pictures have.
Expected<cv::Size> look_at_images(const BoardRequest& request,
                                  const RunProgress& progress,
                                  BoardReport& report) {
  const fs::path inside = request.pictures / "images";
  STEMVO_TRY_GET(const auto listing,
                 dataset::list_images(is_folder(inside) ? inside : request.pictures));
  FrameSource frames;
  frames.files = listing.files;
  STEMVO_TRY_GET(const auto kind, dataset::vote_on_images(frames));
  report.warnings = frames.warnings;
  add_line(report.warnings, listing.warning);
  for (std::size_t i = 0; i < frames.files.size() && !report.interrupted; ++i) {
    const auto image = io::read_image(frames.files[i], false, kind.size, kind.levels);
    if (image) {
      STEMVO_TRY(
          add_view(request.board, frames.files[i].filename().string(), *image, false, report));
    } else {
      report.warnings.push_back(image.error().message);
    }
    report.interrupted = progress && !progress(i + 1, frames.files.size());
  }
  return kind.size;
}

Expected<cv::Size> look_at_video(const BoardRequest& request,
                                 const RunProgress& progress,
                                 BoardReport& report) {
  STEMVO_TRY_GET(const auto stream, dataset::VideoStream::open(request.pictures, {}));
  add_line(report.warnings, dataset::warn_of_turn(*stream, request.pictures.string()));
  constexpr std::size_t kMaxLooks = 300;
  constexpr std::size_t kUsualStep = 5;
  const std::size_t num_frames = stream->expected_frames();
  const std::size_t step = num_frames > 0 ? num_frames / kMaxLooks + 1 : kUsualStep;
  for (std::size_t i = 0; !report.interrupted; ++i) {
    STEMVO_TRY_GET(const cv::Mat image, stream->read(i));
    if (image.empty()) {
      break;
    }
    if (i % step == 0) {
      cv::Mat gray;
      cv::cvtColor(image, gray, cv::COLOR_RGB2GRAY);
      STEMVO_TRY(add_view(request.board, fmt::format("frame {}", i), gray, true, report));
    }
    report.interrupted = progress && !progress(i + 1, std::max(num_frames, i + 2));
  }
  return stream->decoder().size;
}

std::string file_text(const BoardRequest& request, const BoardReport& report) {
  const auto num_used = std::ranges::count_if(report.views, &BoardView::is_used);
  std::string text = fmt::format(
      "# {} views of the board {}: error {:.3f} px (root mean square)\n# sigma:", num_used,
      one_line(request.board_text), report.fit.error_px);
  for (const FittedNumber& number : report.fit.numbers) {
    text += fmt::format(" {} {:.2g}", number.name, number.sigma);
  }
  dataset::CameraFile file;
  file.camera = report.fit.camera;
  return text + "\n" + dataset::camera_file_text(file);
}

}  // namespace

Expected<BoardReport> calibrate_board(const BoardRequest& request, const RunProgress& progress) {
  STEMVO_TRY(check_can_write(request.out_file));
  const auto look = is_file(request.pictures) && !dataset::is_image_file(request.pictures)
                        ? look_at_video
                        : look_at_images;
  BoardReport report;
  STEMVO_TRY_GET(const cv::Size size, look(request, progress, report));
  if (report.interrupted) {
    return report;
  }
  auto fit = fit_camera(report.views, size);
  if (!fit) {
    return fail(fmt::format("{}: {} (in {} pictures)", request.pictures.string(),
                            fit.error().message, report.num_pictures));
  }
  report.fit = *std::move(fit);
  constexpr double kMaxSigma = 0.02;
  if (const FittedNumber& fx = report.fit.numbers.front(); fx.sigma > kMaxSigma * fx.value) {
    report.warnings.push_back(fmt::format("fx is known to {:.0f} % only: the views hardly tell it",
                                          100.0 * fx.sigma / fx.value));
  }
  constexpr double kMaxShared = 2e-4;  // of the image's width
  if (const double px = shared_error_px(report.views, report.fit.camera);
      px > kMaxShared * size.width) {
    report.warnings.push_back(fmt::format(
        "corners err alike by {:.2f} px, as no noise does: pictures of one zoom, a flat board?",
        px));
  }
  report.missing = missing_views(report.views, size);
  (report.coverage_file = request.out_file).replace_extension() += "_coverage.png";
  STEMVO_TRY(write_text_file(request.out_file, file_text(request, report)));
  STEMVO_TRY(write_image(report.coverage_file, draw_coverage(report.views, size)));
  return report;
}

std::string format_board_table(const BoardReport& report) {
  TextTable table("lrr");
  table.add({"", "value", "sigma"});
  table.rule();
  for (const FittedNumber& number : report.fit.numbers) {
    const int digits = number.name.starts_with('f') || number.name.starts_with('c') ? 2 : 5;
    table.add({number.name, fmt::format("{:.{}f}", number.value, digits),
               fmt::format("{:.{}f}", number.sigma, digits)});
  }
  const auto num_used = std::ranges::count_if(report.views, &BoardView::is_used);
  std::string text =
      table.str() + fmt::format("{} pictures, {} with the board, {} used: error {:.3f} px\n",
                                report.num_pictures, report.views.size(), num_used,
                                report.fit.error_px);
  for (const BoardView& view : report.views) {
    if (!view.is_used) {
      text += fmt::format("left out: {}, whose error is {:.2f} px (blurred, bent or wrong)\n",
                          view.name, view.error_px);
    }
  }
  text += report.missing.empty() ? "the views suffice\n" : "photograph next:\n";
  for (const std::string& one : report.missing) {
    text += "  " + one + "\n";
  }
  return text;
}

}  // namespace stemvo
