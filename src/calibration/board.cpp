// SPDX-License-Identifier: MIT
#include "calibration/board.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <regex>

#include <dlfcn.h>
#include <fmt/format.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration/markers.hpp"
#include "io/loaded_module.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo {
namespace {

constexpr const char* kForms =
    "COLUMNSxROWS:SQUARE_M (inner corners), charuco:COLUMNSxROWS:SQUARE_M:MARKER_M:DICTIONARY or "
    "aprilgrid:COLUMNSxROWS:TAG_M:GAP_M";

cv::Point3f on_board(double x_m, double y_m) {
  return {static_cast<float>(x_m), static_cast<float>(y_m), 0.0F};
}

/// Moves corners to parts of a pixel, by windows of `half_px` to either side.
void refine(const cv::Mat& gray, double half_px, int most_px, std::vector<cv::Point2f>& corners) {
  const int half = std::clamp(static_cast<int>(half_px), 2, most_px);
  cv::cornerSubPix(gray, corners, {half, half}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
}

/// The smallest distance between neighbours in a row or a column.
double smallest_cell(const std::vector<cv::Point2f>& corners, std::size_t columns) {
  double cell_px = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < corners.size(); ++i) {
    if (i % columns != 0) {
      cell_px = std::min(cell_px, cv::norm(corners[i] - corners[i - 1]));
    }
    if (i >= columns) {
      cell_px = std::min(cell_px, cv::norm(corners[i] - corners[i - columns]));
    }
  }
  return cell_px;
}

/// The window takes in as much of the four squares as it can: noise counts a third of what it does
/// in the detector's own.
BoardPoints find_chessboard(const Board& board, const cv::Mat& gray) {
  BoardPoints points;
  if (!cv::findChessboardCornersSB(gray, board.cells, points.in_image,
                                   cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY)) {
    return {};
  }
  for (int row = 0; row < board.cells.height; ++row) {
    for (int column = 0; column < board.cells.width; ++column) {
      points.on_board.push_back(on_board(column * board.cell_m, row * board.cell_m));
    }
  }
  constexpr double kShare = 0.4;
  const auto columns = static_cast<std::size_t>(board.cells.width);
  refine(gray, kShare * smallest_cell(points.in_image, columns), 16, points.in_image);
  return points;
}

/// The corners of markers by a layout that says where a marker's corner is on the board.
template <typename Layout>
BoardPoints corners_by(const std::vector<Marker>& markers, const Layout& layout) {
  BoardPoints points;
  for (const Marker& marker : markers) {
    for (int corner = 0; corner < 4; ++corner) {
      points.on_board.push_back(layout(marker.id, corner));
      points.in_image.push_back(marker.corners[static_cast<std::size_t>(corner)]);
    }
  }
  return points;
}

std::vector<cv::Point2f> flat(const std::vector<cv::Point3f>& points) {
  std::vector<cv::Point2f> result;
  std::ranges::transform(points, std::back_inserter(result),
                         [](const cv::Point3f& p) { return cv::Point2f(p.x, p.y); });
  return result;
}

/// The root mean square of what a plane seen by a pinhole leaves, which is the lens' part where the
/// layout is right.
double misfit_px(const BoardPoints& points) {
  const cv::Mat image_from_board = cv::findHomography(flat(points.on_board), points.in_image);
  if (image_from_board.empty()) {
    return std::numeric_limits<double>::infinity();
  }
  std::vector<cv::Point2f> seen;
  cv::perspectiveTransform(flat(points.on_board), seen, image_from_board);
  return cv::norm(seen, points.in_image) / std::sqrt(static_cast<double>(seen.size()));
}

/// Corners of a tag in units of its sides, clockwise from the upper left.
constexpr int kCornerX[] = {0, 1, 1, 0};
constexpr int kCornerY[] = {0, 0, 1, 1};

/// Corners to parts of a pixel. Which window is within a marker's border and the margins around it
/// depends on the print: the one is taken that leaves the least.
BoardPoints refined(const cv::Mat& gray,
                    const std::vector<Marker>& markers,
                    const BoardPoints& points) {
  double side_px = std::numeric_limits<double>::infinity();
  for (const Marker& marker : markers) {
    side_px = std::min(side_px, std::sqrt(cv::contourArea(marker.corners)));
  }
  std::vector<BoardPoints> tried;
  for (const double share : {0.1, 0.15, 0.2}) {
    refine(gray, share * side_px, 8, tried.emplace_back(points).in_image);
  }
  return *std::ranges::min_element(tried, {}, misfit_px);
}

BoardPoints find_grid(const Board& board, const std::vector<Marker>& markers) {
  const int columns = board.cells.width;
  const double step_m = board.cell_m + board.other_m;
  std::vector<BoardPoints> layouts;
  for (const bool is_upwards : {false, true}) {
    for (int turn = 0; turn < 4; ++turn) {
      layouts.push_back(corners_by(markers, [&](int id, int corner) {
        const int row = is_upwards ? board.cells.height - 1 - id / columns : id / columns;
        const int turned = (corner + turn) % 4;
        return on_board((id % columns) * step_m + kCornerX[turned] * board.cell_m,
                        row * step_m + kCornerY[turned] * board.cell_m);
      }));
    }
  }
  const BoardPoints& best = *std::ranges::min_element(layouts, {}, misfit_px);
  return std::isfinite(misfit_px(best)) ? best : BoardPoints();
}

/// The markers are on the squares of one colour, by their numbers; `parity` says which.
BoardPoints charuco_markers(const Board& board, const std::vector<Marker>& markers, int parity) {
  std::vector<cv::Point> squares;
  for (int y = 0; y < board.cells.height; ++y) {
    for (int x = (y + parity) % 2; x < board.cells.width; x += 2) {
      squares.emplace_back(x, y);
    }
  }
  const double margin_m = 0.5 * (board.cell_m - board.other_m);
  return corners_by(markers, [&](int id, int corner) {
    const cv::Point& square = squares[static_cast<std::size_t>(id) % squares.size()];
    return on_board(square.x * board.cell_m + margin_m + kCornerX[corner] * board.other_m,
                    square.y * board.cell_m + margin_m + kCornerY[corner] * board.other_m);
  });
}

/// Corners of the squares, each where the two markers that touch it say; both must be seen.
BoardPoints find_charuco(const Board& board, const std::vector<Marker>& markers) {
  const BoardPoints choices[] = {charuco_markers(board, markers, 1),
                                 charuco_markers(board, markers, 0)};
  const BoardPoints& known = *std::ranges::min_element(choices, {}, misfit_px);
  BoardPoints points;
  for (int y = 1; y < board.cells.height; ++y) {
    for (int x = 1; x < board.cells.width; ++x) {
      const cv::Point3f corner = on_board(x * board.cell_m, y * board.cell_m);
      BoardPoints around;
      for (std::size_t i = 0; i < known.on_board.size(); ++i) {
        const cv::Point3f off = known.on_board[i] - corner;
        if (std::max(std::abs(off.x), std::abs(off.y)) < board.cell_m) {
          around.on_board.push_back(known.on_board[i]);
          around.in_image.push_back(known.in_image[i]);
        }
      }
      const cv::Mat local = around.on_board.size() == 8
                                ? cv::findHomography(flat(around.on_board), around.in_image)
                                : cv::Mat();
      if (!local.empty()) {
        std::vector<cv::Point2f> seen;
        cv::perspectiveTransform(flat({corner}), seen, local);
        points.on_board.push_back(corner);
        points.in_image.push_back(seen.front());
      }
    }
  }
  return points;
}

/// Corners on the image. Others are of markers that are none, and newer OpenCV throws at them.
BoardPoints on_image(const BoardPoints& points, const cv::Size& size) {
  const cv::Rect2f image({}, cv::Size2f(size - cv::Size(1, 1)));
  BoardPoints kept;
  for (std::size_t i = 0; i < points.in_image.size(); ++i) {
    if (image.contains(points.in_image[i])) {
      kept.on_board.push_back(points.on_board[i]);
      kept.in_image.push_back(points.in_image[i]);
    }
  }
  return kept;
}

/// The module does not name OpenCV's library, so that the package does not ask for it.
Expected<FindMarkers*> load_markers() {
  if (::dlopen(STEMVO_MARKER_LIBRARY, RTLD_NOW | RTLD_GLOBAL) == nullptr) {
    return fail(fmt::format(
        "{}: expected OpenCV's library that finds markers (Debian: libopencv-contrib4xx or "
        "libopencv-objdetect4xx), found none: {}",
        STEMVO_MARKER_LIBRARY, ::dlerror()));
  }
  return io::load_symbol("libstemvo_markers.so", kFindMarkers, "finds markers")
      .map([](void* symbol) { return reinterpret_cast<FindMarkers*>(symbol); });
}

/// Finds markers of one of OpenCV's dictionaries, with black borders one or two bits wide. Errors:
/// the module or OpenCV's library is not there; no such dictionary.
Expected<std::vector<Marker>> find_markers(const cv::Mat& gray, const std::string& dictionary) {
  static const Expected<FindMarkers*> loaded = load_markers();
  STEMVO_TRY_GET(FindMarkers* const find, loaded);
  std::vector<Marker> markers;
  if (!find(gray, dictionary.c_str(), markers)) {
    return fail(fmt::format(
        "--board: expected a dictionary from DICT_4X4_50 to DICT_APRILTAG_36h11, found '{}'",
        dictionary));
  }
  return markers;
}

}  // namespace

Expected<Board> parse_board(const std::string& text) {
  static const std::regex kForm(
      "(charuco:|aprilgrid:)?([0-9]{1,3})x([0-9]{1,3})"
      ":([^:]{1,40})(?::([^:]{1,40}))?(?::([^:]{1,40}))?");
  std::smatch part;
  Board board;
  if (std::regex_match(text, part, kForm)) {
    const auto number = [&](std::size_t i) {
      return parse_numbers(part[i].str(), 1).value_or(std::vector{0.0}).front();
    };
    board.kind = part[1] == "charuco:"     ? Board::Kind::kCharuco
                 : part[1] == "aprilgrid:" ? Board::Kind::kAprilGrid
                                           : Board::Kind::kChessboard;
    board.cells = {std::stoi(part[2]), std::stoi(part[3])};
    board.cell_m = number(4);
    board.other_m = number(5);
    const bool is_usual = board.kind == Board::Kind::kAprilGrid && !part[6].matched;
    board.dictionary = is_usual ? "DICT_APRILTAG_36h11" : part[6].str();
  }
  const bool is_plain = board.kind == Board::Kind::kChessboard;
  const auto [fewer, more] = std::minmax({board.cells.width, board.cells.height});
  const bool is_sound = fewer >= (is_plain ? 3 : 2) && more <= 100 && board.cell_m > 0.0 &&
                        (is_plain ? !part[5].matched : board.other_m > 0.0) &&
                        (board.kind != Board::Kind::kCharuco ||
                         (board.other_m < board.cell_m && !board.dictionary.empty()));
  if (!is_sound) {
    return fail(fmt::format("--board: expected {}, found '{}'", kForms, one_line(text)));
  }
  return board;
}

Expected<BoardPoints> find_board(const Board& board, const cv::Mat& gray) {
  if (board.kind == Board::Kind::kChessboard) {
    return find_chessboard(board, gray);
  }
  STEMVO_TRY_GET(std::vector<Marker> markers, find_markers(gray, board.dictionary));
  const int num_cells = board.cells.area();
  const bool is_grid = board.kind == Board::Kind::kAprilGrid;
  std::erase_if(markers, [&](const Marker& marker) {
    return marker.id >= (is_grid ? num_cells : (num_cells + 1) / 2);
  });
  constexpr std::size_t kMinMarkers = 4;
  constexpr std::size_t kMinCorners = 8;
  if (markers.size() < kMinMarkers) {
    return BoardPoints();
  }
  const BoardPoints points =
      on_image(is_grid ? find_grid(board, markers) : find_charuco(board, markers), gray.size());
  return points.in_image.size() < kMinCorners ? BoardPoints() : refined(gray, markers, points);
}

}  // namespace stemvo
