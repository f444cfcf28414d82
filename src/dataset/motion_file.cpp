// SPDX-License-Identifier: MIT
#include "dataset/motion_file.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <string>

#include <fmt/format.h>

#include "odometry/frame_clock.hpp"
#include "stemvo/rigid3.hpp"
#include "text/text_file.hpp"

namespace stemvo::dataset {
namespace {

constexpr double kMaxGap_s = 0.1;  ///< between rates that a rotation is integrated from

/// Rows of one of these numbers of numbers, the first of which is a time and rises.
Expected<std::vector<std::vector<double>>> read_rows(const std::filesystem::path& file,
                                                     std::initializer_list<std::size_t> counts,
                                                     std::string_view form) {
  const auto lines = read_lines(file);
  if (!lines) {
    return lines.error();
  }
  std::vector<std::vector<double>> rows;
  double unit_s = 1.0;
  for (std::size_t i = 0; i < lines->size(); ++i) {
    const std::size_t comment = std::min((*lines)[i].find('#'), (*lines)[i].size());
    if ((*lines)[i].find("[ns]", comment) != std::string::npos) {
      unit_s = 1e-9;  // EuRoC's
    }
    std::string line = (*lines)[i].substr(0, comment);
    std::ranges::replace(line, ',', ' ');
    const std::size_t count = split_words(line).size();
    if (count == 0) {
      continue;
    }
    if (std::ranges::find(counts, count) == counts.end()) {
      return fail_at(file, i, fail(fmt::format("expected {}, found {} words", form, count)));
    }
    auto row = parse_numbers(line, count);
    if (!row) {
      return fail_at(file, i, row.error());
    }
    row->front() *= unit_s;
    if (!rows.empty() && !(row->front() > rows.back().front())) {
      return fail_at(file, i,
                     fail(fmt::format("expected a time after {} s, found {} s", rows.back().front(),
                                      row->front())));
    }
    rows.push_back(*std::move(row));
  }
  if (rows.empty()) {
    return fail(fmt::format("{}: expected rows of {}, found none", file.string(), form));
  }
  return rows;
}

/// The rate at a time, between the rows around it; the first or the last one outside.
Eigen::Vector3d rate_at(const std::vector<GyroRow>& rows, double time_s) {
  const auto after = std::ranges::lower_bound(rows, time_s, {}, &GyroRow::time_s);
  if (after == rows.begin() || after == rows.end()) {
    return after == rows.end() ? rows.back().rad_per_s : after->rad_per_s;
  }
  const GyroRow& before = *(after - 1);
  const double share = whole_us(time_s - before.time_s) / whole_us(after->time_s - before.time_s);
  return before.rad_per_s + share * (after->rad_per_s - before.rad_per_s);
}

}  // namespace

Expected<std::vector<SpeedRow>> read_speeds(const std::filesystem::path& file) {
  constexpr double kSigmaShare = 0.02;
  constexpr double kMinSigma = 0.05;
  const auto rows = read_rows(file, {2, 3}, "a time, m/s and maybe a sigma");
  if (!rows) {
    return rows.error();
  }
  std::vector<SpeedRow> speeds;
  for (const std::vector<double>& row : *rows) {
    const double sigma =
        row.size() > 2 ? row[2] : std::max(kMinSigma, kSigmaShare * std::abs(row[1]));
    if (!(sigma > 0.0)) {
      return fail(fmt::format("{}: expected a sigma above 0 at {} s, found {}", file.string(),
                              row[0], sigma));
    }
    speeds.push_back({row[0], row[1], sigma});
  }
  return speeds;
}

Expected<std::vector<GyroRow>> read_gyro(const std::filesystem::path& file) {
  return read_rows(file, {4, 7}, "a time and rad/s about x, y and z").map([](const auto& rows) {
    std::vector<GyroRow> rates;
    for (const std::vector<double>& row : rows) {
      rates.push_back({row[0], Eigen::Vector3d(row[1], row[2], row[3])});
    }
    return rates;
  });
}

std::optional<Eigen::Quaterniond> integrate_gyro(const std::vector<GyroRow>& rows,
                                                 double from_s,
                                                 double to_s) {
  Eigen::Quaterniond prev_from_cur = Eigen::Quaterniond::Identity();
  double done_s = from_s;
  const auto add_until = [&](double time_s) {
    const Eigen::Vector3d mean = 0.5 * (rate_at(rows, done_s) + rate_at(rows, time_s));
    prev_from_cur = prev_from_cur * so3_exp(whole_us(time_s - done_s) * mean);
    done_s = time_s;
  };
  auto row = std::ranges::upper_bound(rows, from_s, {}, &GyroRow::time_s);
  double last_row_s = row != rows.begin() ? (row - 1)->time_s : from_s;
  for (; row != rows.end() && row->time_s < to_s; ++row) {
    if (row->time_s - last_row_s >= kMaxGap_s) {
      return std::nullopt;
    }
    add_until(row->time_s);
    last_row_s = row->time_s;
  }
  const double next_row_s = row != rows.end() ? row->time_s : to_s;
  if (rows.empty() || next_row_s - last_row_s >= kMaxGap_s) {
    return std::nullopt;
  }
  add_until(to_s);
  return prev_from_cur;
}

}  // namespace stemvo::dataset
