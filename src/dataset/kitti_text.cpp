// SPDX-License-Identifier: MIT
#include "dataset/kitti_text.hpp"

#include <array>
#include <cmath>

#include <fmt/format.h>

#include "text/text_file.hpp"

namespace stemvo::dataset {
namespace {

constexpr std::size_t kNumbersPerRow = 12;

Expected<Camera> parse_projection(const std::vector<std::string_view>& words,
                                  const std::string& where) {
  if (words.size() != kNumbersPerRow + 1) {
    return fail(fmt::format("{}: expected {} with {} numbers, found {}", where, words.front(),
                            kNumbersPerRow, words.size() - 1));
  }
  std::array<double, kNumbersPerRow> p{};
  for (std::size_t i = 0; i < kNumbersPerRow; ++i) {
    const auto number = parse_finite(words[i + 1], where);
    if (!number) {
      return fail(number.error().message);
    }
    p[i] = *number;
  }
  if (!(p[0] > 0.0) || !(p[5] > 0.0)) {
    return fail(
        fmt::format("{}: expected positive focal lengths, found {} and {}", where, p[0], p[5]));
  }
  // Anything but [f 0 c . | 0 f c . | 0 0 1 .] is not a rectified pinhole camera.
  constexpr double kTolerance = 1e-6;
  const bool is_pinhole = std::abs(p[1]) <= kTolerance * p[0] &&
                          std::abs(p[4]) <= kTolerance * p[5] && std::abs(p[8]) <= kTolerance &&
                          std::abs(p[9]) <= kTolerance && std::abs(p[10] - 1.0) <= kTolerance;
  if (!is_pinhole) {
    return fail(
        fmt::format("{}: expected a pinhole camera [f 0 c; 0 f c; 0 0 1], found [{} {} {}; "
                    "{} {} {}; {} {} {}]",
                    where, p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]));
  }
  Camera camera;
  camera.fx_px = p[0];
  camera.fy_px = p[5];
  camera.cx_px = p[2];
  camera.cy_px = p[6];
  return camera;
}

}  // namespace

Expected<Camera> read_kitti_camera(const std::filesystem::path& file, int index) {
  const auto lines = read_lines(file);
  if (!lines) {
    return fail(lines.error().message);
  }
  const std::string odometry_name = fmt::format("P{}:", index);
  const std::string raw_name = fmt::format("P_rect_0{}:", index);
  for (std::size_t i = 0; i < lines->size(); ++i) {
    const auto words = split_words((*lines)[i]);
    if (!words.empty() && (words.front() == odometry_name || words.front() == raw_name)) {
      return parse_projection(words, at_line(file, i + 1));
    }
  }
  return fail(fmt::format("{}: expected a row '{}' for image_{}, found none in {} lines",
                          file.string(), odometry_name, index, lines->size()));
}

Expected<std::vector<double>> read_kitti_times(const std::filesystem::path& file,
                                               std::size_t num_expected) {
  const auto lines = read_lines(file);
  if (!lines) {
    return fail(lines.error().message);
  }
  std::vector<double> times_s;
  for (std::size_t i = 0; i < lines->size(); ++i) {
    const auto words = split_words((*lines)[i]);
    if (words.empty()) {
      continue;
    }
    const std::string where = at_line(file, i + 1);
    if (words.size() != 1) {
      return fail(
          fmt::format("{}: expected one time in seconds, found {} words", where, words.size()));
    }
    const auto time_s = parse_finite(words.front(), where);
    if (!time_s) {
      return fail(time_s.error().message);
    }
    if (!times_s.empty() && !(*time_s > times_s.back())) {
      return fail(fmt::format("{}: expected a time after {} s, found {} s", where, times_s.back(),
                              *time_s));
    }
    times_s.push_back(*time_s);
  }
  if (times_s.size() < num_expected) {
    return fail(fmt::format("{}: expected a time for each of {} images, found {} times",
                            file.string(), num_expected, times_s.size()));
  }
  return times_s;
}

}  // namespace stemvo::dataset
