// SPDX-License-Identifier: MIT
#include "calibration/calibration_file.hpp"

#include <cmath>
#include <optional>
#include <string_view>
#include <system_error>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "stemvo/geometry/rigid3.hpp"
#include "text/text_file.hpp"

namespace stemvo::calibration {
namespace {

namespace fs = std::filesystem;

bool is_projection_name(std::string_view word) {
  const auto is_one_of = [&word](std::string_view start) {
    return word.size() == start.size() + 2 && word.starts_with(start) &&
           word[start.size()] >= '0' && word[start.size()] <= '3' && word.ends_with(':');
  };
  return is_one_of("P") || is_one_of("P_rect_0");
}

/// The 3x4 matrix of a projection row, row-major; nullopt: another line.
std::optional<Matrix34d> parse_row(const std::vector<std::string_view>& words) {
  if (words.size() != 13 || !is_projection_name(words.front())) {
    return std::nullopt;
  }
  Matrix34d projection;
  for (int i = 0; i < 12; ++i) {
    const auto number = parse_finite(words[static_cast<std::size_t>(i) + 1], "");
    if (!number) {
      return std::nullopt;
    }
    projection(i / 4, i % 4) = *number;
  }
  return projection;
}

bool has_intrinsics(const Matrix34d& projection, const Camera& camera) {
  return (projection.leftCols<3>() - camera.matrix()).cwiseAbs().maxCoeff() <=
         1e-6 * camera.mean_focal_px();
}

fs::path beside(const fs::path& file) { return fs::path(file.string() + ".unfinished"); }

}  // namespace

Expected<std::string> rewrite_calibration(const fs::path& file,
                                          const Camera& given,
                                          const Camera& refined) {
  const Expected<std::vector<std::string>> lines = read_lines(file);
  if (!lines) {
    return lines.error();
  }
  std::string text;
  for (const std::string& line : *lines) {
    const std::vector<std::string_view> words = split_words(line);
    std::optional<Matrix34d> row = parse_row(words);
    if (!row || !has_intrinsics(*row, given)) {
      text += line + "\n";
      continue;
    }
    const Eigen::Vector3d offset_m = given.matrix().inverse() * row->col(3);
    row->leftCols<3>() = refined.matrix();
    row->col(3) = refined.matrix() * offset_m;
    text += words.front();
    for (int i = 0; i < 12; ++i) {
      text += fmt::format(" {:.12e}", (*row)(i / 4, i % 4));
    }
    text += "\n";
  }
  return text;
}

Status check_can_write(const fs::path& file) {
  std::error_code code;
  if (fs::is_directory(file, code)) {
    return fail(fmt::format("{}: expected a file to write, found a folder", file.string()));
  }
  const Status status = write_text_file(beside(file), "");
  fs::remove(beside(file), code);
  return status ? status
                : fail(fmt::format("{}: expected a file that can be written, found: {}",
                                   file.string(), status.error().message));
}

Status replace_file(const fs::path& file, const std::string& text) {
  std::error_code code;
  if (const Status status = write_text_file(beside(file), text); !status) {
    fs::remove(beside(file), code);
    return status;
  }
  fs::rename(beside(file), file, code);
  if (code) {
    const std::string found = code.message();
    fs::remove(beside(file), code);
    return fail(
        fmt::format("{}: expected a file that can be written, found: {}", file.string(), found));
  }
  return {};
}

}  // namespace stemvo::calibration
