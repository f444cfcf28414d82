// SPDX-License-Identifier: MIT
#include "evaluation/trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <ranges>
#include <regex>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "text/text_file.hpp"
#include "try.hpp"

namespace stemvo {
namespace fs = std::filesystem;

namespace {

/// Shorter steps have no direction: what is left of them is rounding.
constexpr double kNoStep_m = 1e-9;

enum class Format { kKitti, kTum, kEuroc };

std::string with_blanks(std::string_view line) {
  std::string text(line);
  std::ranges::replace(text, ',', ' ');
  return text;
}

bool is_blank(std::string_view line) { return take_word(line).empty(); }

/// The format of a first row whose numbers stand between commas. Nullopt: two formats' rows look
/// so, or none has its quaternion as a comment says.
std::optional<Format> format_of_commas(std::string_view row,
                                       bool says_nanoseconds,
                                       bool says_w_first) {
  constexpr double kNanoseconds = 1e12;  // as seconds, 30,000 years
  const std::vector<std::string_view> words = split_words(row);
  if (words.size() == 12) {
    return Format::kKitti;
  }
  const auto time = parse_numbers(words.empty() ? "" : words.front(), 1);
  const bool is_long = time && time->front() > kNanoseconds;
  if (words.size() == 8 && !says_nanoseconds) {
    return is_long == says_w_first ? std::optional(is_long ? Format::kEuroc : Format::kTum)
                                   : std::nullopt;
  }
  return Format::kEuroc;
}

/// Names that end with w, x, .. in this order ("qw qx ..", "orientation.w orientation.x ..", "w x
/// y z"), or are counted, whose first is w in most programs.
bool names_w_first(std::string_view comment) {
  static const std::regex kOrder(
      "(^|[^a-z0-9])(q0|q?w([^a-z0-9]+(qq?|[a-pr-z0-9][a-z0-9]|[a-z0-9]{3,})){0,2}[^a-z0-9]+q?x)"
      "([^a-z0-9]|$)",
      std::regex::icase);
  const std::string start(comment.substr(0, 1000));  // longer texts take std::regex all the stack
  return std::regex_search(start, kOrder);
}

/// Nullopt: the numbers may be of two formats, or a comment says another order.
std::optional<Format> format_of(std::string_view text) {
  bool has_comment = false;  // KITTI's have none
  bool says_nanoseconds = false;
  bool says_w_first = false;
  for (const std::string_view line : split_lines(text)) {
    std::string_view rest = line;
    const std::string_view first = take_word(rest);
    const bool is_comment = first.starts_with('#');
    has_comment = has_comment || is_comment;
    says_nanoseconds =
        says_nanoseconds || (is_comment && line.find("[ns]") != std::string_view::npos);
    says_w_first = says_w_first || (is_comment && names_w_first(line));
    if (!first.empty() && !is_comment) {
      const std::string_view row = line.substr(0, line.find('#'));
      if (row.find(',') != std::string_view::npos) {
        return format_of_commas(with_blanks(row), says_nanoseconds, says_w_first);
      }
      if (says_w_first && !says_nanoseconds) {
        return std::nullopt;
      }
      return has_comment || split_words(row).size() == 8 ? Format::kTum : Format::kKitti;
    }
  }
  return has_comment ? Format::kTum : Format::kKitti;
}

/// A row: the time in whatever unit, none of KITTI's.
struct TimedPose {
  double time = 0.0;
  Rigid3 pose;
};

/// Entries of R^T R, or the length of a quaternion, may differ this much from the exact ones.
constexpr double kRotationTolerance = 1e-3;

Expected<TimedPose> pose_from_quaternion_row(const std::vector<double>& n) {
  const Eigen::Quaterniond rotation(n[7], n[4], n[5], n[6]);
  if (!(std::abs(rotation.norm() - 1.0) <= kRotationTolerance)) {
    return fail(
        fmt::format("expected a quaternion of length 1 in the last four numbers, found {:.6g}",
                    rotation.norm()));
  }
  return TimedPose{n[0], Rigid3(rotation, Eigen::Vector3d(n[1], n[2], n[3]))};
}

/// EuRoC's rows have a quaternion that begins with w, and columns behind the pose (velocity,
/// biases), which are not read.
Expected<TimedPose> parse_row(Format format, std::string_view given) {
  // Fewer commas are those of decimals.
  const bool has_commas = format != Format::kKitti || std::ranges::count(given, ',') == 11;
  std::string line = has_commas ? with_blanks(given) : std::string(given);
  if (format == Format::kKitti) {
    return parse_numbers(line, 12).and_then(pose_from_rows).map([](const Rigid3& pose) {
      return TimedPose{0.0, pose};
    });
  }
  if (format == Format::kEuroc) {
    std::vector<std::string_view> words = split_words(line);
    if (words.size() < 8) {
      return fail(fmt::format("expected time, x, y, z, qw, qx, qy, qz, .., found {} numbers",
                              words.size()));
    }
    words.resize(8);
    std::rotate(words.begin() + 4, words.begin() + 5, words.end());
    line = fmt::format("{}", fmt::join(words, " "));
  }
  return parse_numbers(line, 8).and_then(pose_from_quaternion_row);
}

Expected<PoseFile> parse_rows(const fs::path& file, std::string_view text, Format format) {
  const double unit_s = format == Format::kEuroc ? 1e-9 : 1.0;
  std::vector<std::string_view> lines = split_lines(text);
  // Empty lines at the end of a file are no poses; within KITTI's they would shift the frames.
  while (!lines.empty() && is_blank(lines.back())) {
    lines.pop_back();
  }
  std::vector<TimedPose> rows;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string_view line =
        format == Format::kKitti ? lines[i] : lines[i].substr(0, lines[i].find('#'));
    if (format != Format::kKitti && is_blank(line)) {
      continue;
    }
    STEMVO_TRY_GET(rows.emplace_back(), at_line(file, i, parse_row(format, line)));
  }
  if (rows.empty()) {
    return fail(fmt::format("{}: expected at least one pose, found none", file.string()));
  }
  // Files that were put together by hand are not always in order.
  std::ranges::stable_sort(rows, {}, &TimedPose::time);
  PoseFile result{.file = file, .is_of_body = format == Format::kEuroc};
  for (const TimedPose& row : rows) {
    result.poses.push_back(row.pose);
    if (format != Format::kKitti) {
      result.timestamps_s.push_back(unit_s * row.time);
    }
  }
  return result;
}

Error either_format(const fs::path& file, std::string_view found) {
  return fail(fmt::format(
      "{}: expected TUM's rows (seconds, x, y, z, qx, qy, qz, qw) or EuRoC's (nanoseconds, x, y, "
      "z, qw, qx, qy, qz, .., under a comment with [ns]), found {}",
      file.string(), found));
}

/// Error: the usual step of times in order can be none in the format's unit.
Status check_steps(const fs::path& file, Format format, const std::vector<double>& times_s) {
  constexpr double kLongest_s = 1e5;
  constexpr double kShortest_s = 1e-4;
  if (times_s.size() < 2) {
    return {};
  }
  const double step_s =
      (times_s.back() - times_s.front()) / static_cast<double>(times_s.size() - 1);
  if (format == Format::kTum && step_s > kLongest_s) {
    return either_format(file, fmt::format("times with steps of {:.4g}", step_s));
  }
  if (format == Format::kEuroc && step_s < kShortest_s) {
    return either_format(
        file, fmt::format("steps of {:.4g} in what was taken for EuRoC's rows", step_s / 1e-9));
  }
  return {};
}

/// The index of the nearest time of a list in order that is not empty; of equals the first.
std::size_t nearest(std::span<const double> times_s, double time_s) {
  const auto above = std::lower_bound(times_s.begin(), times_s.end(), time_s);
  const auto index = static_cast<std::size_t>(above - times_s.begin());
  if (index == times_s.size()) {
    return nearest(times_s, times_s.back());
  }
  const bool is_below_nearer = index > 0 && time_s - times_s[index - 1] < times_s[index] - time_s;
  return is_below_nearer ? nearest(times_s, times_s[index - 1]) : index;
}

}  // namespace

Expected<Rigid3> pose_from_rows(const std::vector<double>& numbers) {
  const Matrix34d matrix =
      Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(numbers.data());
  const Eigen::Matrix3d rotation = matrix.leftCols<3>();
  const double deviation =
      (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(deviation <= kRotationTolerance)) {
    return fail(fmt::format(
        "expected a rotation in the first three columns, found R^T R off the identity by {:.3g}",
        deviation));
  }
  if (rotation.determinant() < 0.0) {
    return fail("expected a rotation in the first three columns, found a reflection");
  }
  return Rigid3::from_matrix(matrix);
}

Trajectory relative_to(std::size_t frame, std::span<const Rigid3> world_from_camera) {
  const Rigid3 frame_from_world = world_from_camera[frame].inverse();
  Trajectory moved(world_from_camera.size());
  std::ranges::transform(world_from_camera, moved.begin(),
                         [&](const Rigid3& pose) { return frame_from_world * pose; });
  moved[frame] = Rigid3();  // exactly
  return moved;
}

Trajectory relative_to_first(std::span<const Rigid3> world_from_camera) {
  return world_from_camera.empty() ? Trajectory() : relative_to(0, world_from_camera);
}

Eigen::Vector3d rescaled_step(std::span<const Rigid3> estimate,
                              std::span<const Rigid3> ground_truth,
                              std::size_t i) {
  const Eigen::Vector3d step = estimate[i].translation - estimate[i - 1].translation;
  const double true_length_m =
      (ground_truth[i].translation - ground_truth[i - 1].translation).norm();
  const double length_m = step.norm();
  return length_m > kNoStep_m ? Eigen::Vector3d(true_length_m / length_m * step)
                              : Eigen::Vector3d::Zero();
}

Trajectory rescale_steps(const PosePairs& pairs) {
  Trajectory rescaled(pairs.estimate.begin(), pairs.estimate.end());
  for (std::size_t i = 1; i < rescaled.size(); ++i) {
    rescaled[i].translation =
        rescaled[i - 1].translation + rescaled_step(pairs.estimate, pairs.truth, i);
  }
  return rescaled;
}

std::string kitti_row(const Rigid3& world_from_camera) {
  // + 0.0 turns -0 into 0.
  const Eigen::Array<double, 3, 4, Eigen::RowMajor> rows = world_from_camera.matrix().array() + 0.0;
  return fmt::format("{:.12e}\n", fmt::join(rows.data(), rows.data() + rows.size(), " "));
}

std::string tum_row(double timestamp_s, const Rigid3& world_from_camera) {
  const Eigen::Array3d t = world_from_camera.translation.array() + 0.0;
  const Eigen::Array4d q = world_from_camera.rotation.coeffs().array() + 0.0;
  return fmt::format("{:.9f} {:.12e} {:.12e}\n", timestamp_s, fmt::join(t, " "), fmt::join(q, " "));
}

Status write_kitti_trajectory(const std::filesystem::path& file,
                              std::span<const Rigid3> world_from_camera) {
  const auto rows = world_from_camera | std::views::transform(kitti_row);
  return write_text_file(file, fmt::format("{}", fmt::join(rows, "")));
}

Status write_tum_trajectory(const std::filesystem::path& file,
                            std::span<const double> timestamps_s,
                            std::span<const Rigid3> world_from_camera) {
  std::string text;
  for (std::size_t i = 0; i < world_from_camera.size(); ++i) {
    text += tum_row(timestamps_s[i], world_from_camera[i]);
  }
  return write_text_file(file, text);
}

Expected<Trajectory> read_kitti_trajectory(const fs::path& file) {
  return read_text_file(file)
      .and_then([&](const std::string& text) { return parse_rows(file, text, Format::kKitti); })
      .map([](const PoseFile& read) { return read.poses; });
}

Expected<PoseFile> read_pose_file(const fs::path& file) {
  STEMVO_TRY_GET(const std::string text, read_text_file(file));
  const std::optional<Format> format = format_of(text);
  if (!format) {
    return either_format(file,
                         "8 numbers that begin with nanoseconds, or qw before qx in a comment");
  }
  Expected<PoseFile> result = parse_rows(file, text, *format);
  if (result) {
    STEMVO_TRY(check_steps(file, *format, result->timestamps_s));
  }
  return result;
}

TimePairs pair_by_time(std::span<const double> first_s,
                       std::span<const double> second_s,
                       double tolerance_s) {
  TimePairs pairs;
  for (std::size_t i = 0; i < first_s.size() && !second_s.empty(); ++i) {
    const std::size_t partner = nearest(second_s, first_s[i]);
    const bool is_near = std::abs(second_s[partner] - first_s[i]) <= tolerance_s;
    if (is_near && nearest(first_s, second_s[partner]) == i) {
      pairs.first.push_back(i);
      pairs.second.push_back(partner);
    }
  }
  return pairs;
}

Trajectory take_poses(std::span<const Rigid3> poses, std::span<const std::size_t> indices) {
  Trajectory taken(indices.size());
  std::ranges::transform(indices, taken.begin(), [&](std::size_t index) { return poses[index]; });
  return taken;
}

}  // namespace stemvo
