// SPDX-License-Identifier: MIT
#include <cmath>
#include <optional>
#include <string_view>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "dataset/frame_files.hpp"
#include "stemvo/rigid3.hpp"
#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace {

/// Which camera's projection row a line is; nullopt: another line.
std::optional<int> camera_of(std::string_view line) {
  const std::string_view name = take_word(line);
  for (int i = 0; i < 4; ++i) {
    if (name == fmt::format("P{}:", i) || name == fmt::format("P_rect_0{}:", i)) {
      return i;
    }
  }
  return std::nullopt;
}

Expected<Matrix34d> parse_projection(std::string_view line) {
  return parse_numbers(line.substr(line.find(':') + 1), 12).map([](const auto& numbers) {
    return Matrix34d(
        Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(numbers.data()));
  });
}

/// Error: anything but [f 0 c . | 0 f c . | 0 0 1 .], which is a rectified pinhole camera.
Expected<Camera> to_camera(const Matrix34d& p) {
  if (!(p(0, 0) >= 1.0) || !(p(1, 1) >= 1.0)) {
    return fail(fmt::format("expected focal lengths of at least 1 pixel, found {} and {}", p(0, 0),
                            p(1, 1)));
  }
  constexpr double kTolerance = 1e-6;
  const bool is_pinhole =
      std::abs(p(0, 1)) <= kTolerance * p(0, 0) && std::abs(p(1, 0)) <= kTolerance * p(1, 1) &&
      (p.row(2).head<3>() - Eigen::RowVector3d::UnitZ()).cwiseAbs().maxCoeff() <= kTolerance;
  if (!is_pinhole) {
    return fail(fmt::format(
        "expected a pinhole camera [f 0 c; 0 f c; 0 0 1], found [{} {} {}; {} {} {}; "
        "{} {} {}]",
        p(0, 0), p(0, 1), p(0, 2), p(1, 0), p(1, 1), p(1, 2), p(2, 0), p(2, 1), p(2, 2)));
  }
  return Camera{p(0, 0), p(1, 1), p(0, 2), p(1, 2)};
}

}  // namespace

Expected<Camera> read_kitti_camera(const std::filesystem::path& file, int index) {
  STEMVO_TRY_GET(const auto lines, read_lines(file, kMaxSettings_MB));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (camera_of(lines[i]) == index) {
      const Expected<Camera> camera = parse_projection(lines[i]).and_then(to_camera);
      return camera ? camera : fail_at(file, i, camera.error());
    }
  }
  return fail(fmt::format("{}: expected a row 'P{}:' for image_{}, found none in {} lines",
                          file.string(), index, index, lines.size()));
}

Expected<std::string> replace_kitti_camera(const std::filesystem::path& file,
                                           const Camera& given,
                                           const Camera& refined) {
  STEMVO_TRY_GET(const auto lines, read_lines(file, kMaxSettings_MB));
  std::string text;
  for (const std::string& line : lines) {
    Expected<Matrix34d> row = parse_projection(line);
    const bool is_given =
        camera_of(line) && row &&
        (row->leftCols<3>() - given.matrix()).cwiseAbs().maxCoeff() <= 1e-6 * given.mean_focal_px();
    if (!is_given) {
      text += line + "\n";
      continue;
    }
    const Eigen::Vector3d offset_m = given.matrix().inverse() * row->col(3);
    row->leftCols<3>() = refined.matrix();
    row->col(3) = refined.matrix() * offset_m;
    text += split_words(line).front();
    for (int i = 0; i < 12; ++i) {
      text += fmt::format(" {:.12e}", (*row)(i / 4, i % 4));
    }
    text += '\n';
  }
  return text;
}

Expected<TimedRows<double>> read_kitti_times(const std::filesystem::path& file,
                                             std::size_t num_expected) {
  STEMVO_TRY_GET(const auto found, read_timed_rows(file, {1}, "a time"));
  TimedRows<double> times{.note = found.note};
  for (const TimedRow& row : found.rows) {
    times.rows.push_back(row.time_s);
  }
  if (times.rows.size() < num_expected) {
    return fail(fmt::format("{}: expected a time for each of {} images, found {} times",
                            file.string(), num_expected, times.rows.size()));
  }
  return times;
}

}  // namespace stemvo::dataset
