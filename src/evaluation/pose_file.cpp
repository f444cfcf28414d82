// SPDX-License-Identifier: MIT
#include "evaluation/pose_file.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "text/text_file.hpp"

namespace stemvo {
namespace {

namespace fs = std::filesystem;

enum class Format { kKitti, kTum, kEuroc };

Format format_of(std::string_view text) {
  bool has_comment = false;  // KITTI's have none
  for (const std::string_view line : split_lines(text)) {
    const std::vector<std::string_view> words = split_words(line);
    const bool is_comment = !words.empty() && words.front().starts_with('#');
    has_comment = has_comment || is_comment;
    if (!words.empty() && !is_comment) {
      return line.find(',') != std::string_view::npos ? Format::kEuroc
             : has_comment || words.size() == 8       ? Format::kTum
                                                      : Format::kKitti;
    }
  }
  return has_comment ? Format::kTum : Format::kKitti;
}

/// EuRoC's columns behind the pose (velocity, biases) are not read.
constexpr std::size_t kNumEurocColumns = 8;

/// The columns of the pose as a row of TUM's, whose quaternion ends with w.
Expected<std::string> to_tum_row(std::string line) {
  std::replace(line.begin(), line.end(), ',', ' ');
  const std::vector<std::string_view> words = split_words(line);
  if (words.size() < kNumEurocColumns) {
    return fail(
        fmt::format("expected time, x, y, z, qw, qx, qy, qz, .., found {} numbers", words.size()));
  }
  return fmt::format("{} {} {} {} {} {} {} {}", words[0], words[1], words[2], words[3], words[5],
                     words[6], words[7], words[4]);
}

Expected<PoseFile> read_euroc(const fs::path& file, const std::string& text) {
  constexpr double kNanosecond_s = 1e-9;
  PoseFile result;
  result.is_of_body = true;
  const std::vector<std::string_view> lines = split_lines(text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::vector<std::string_view> words = split_words(lines[i]);
    if (words.empty() || words.front().starts_with('#')) {
      continue;
    }
    const auto row = to_tum_row(std::string(lines[i])).and_then([](const std::string& line) {
      return parse_tum_row(line);
    });
    if (!row) {
      return fail_at(file, i, row.error());
    }
    result.timestamps_s.push_back(kNanosecond_s * row->time);
    result.poses.push_back(row->world_from_camera);
  }
  return result;
}

/// Files that were put together by hand are not always in order.
void sort_by_time(PoseFile& file) {
  std::vector<double>& times_s = file.timestamps_s;
  if (std::is_sorted(times_s.begin(), times_s.end())) {
    return;
  }
  std::vector<std::size_t> order(times_s.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return times_s[a] < times_s[b]; });
  file.poses = take_poses(file.poses, order);
  std::sort(times_s.begin(), times_s.end());
}

/// Of a list in order that is not empty; of equals the first.
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

Expected<PoseFile> read_pose_file(const fs::path& file) {
  const Expected<std::string> text = read_text_file(file);
  if (!text) {
    return text.error();
  }
  Expected<PoseFile> result = [&]() -> Expected<PoseFile> {
    switch (format_of(*text)) {
      case Format::kEuroc:
        return read_euroc(file, *text);
      case Format::kTum:
        return read_tum_trajectory(file).map([](const TimedTrajectory& timed) {
          return PoseFile{timed.timestamps_s, timed.world_from_camera, false};
        });
      default:
        return read_kitti_trajectory(file).map(
            [](const Trajectory& poses) { return PoseFile{{}, poses, false}; });
    }
  }();
  if (result) {
    sort_by_time(*result);
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
  Trajectory taken;
  taken.reserve(indices.size());
  for (const std::size_t index : indices) {
    taken.push_back(poses[index]);
  }
  return taken;
}

}  // namespace stemvo
