// SPDX-License-Identifier: MIT
#include "dataset/motion_file.hpp"

#include <algorithm>
#include <regex>

#include <fmt/format.h>

#include "odometry/frame_clock.hpp"
#include "odometry/way.hpp"
#include "stemvo/rigid3.hpp"
#include "try.hpp"

namespace stemvo::dataset {
namespace {

constexpr double kMaxGap_s = 0.1;  ///< between rates that a rotation is integrated from

Expected<std::vector<double>> numbers_of(const TimedRow& row, const std::filesystem::path& file) {
  return at_line(file, row.line, parse_numbers(row.rest, split_words(row.rest).size()));
}

/// Error: a comment of the file names `others`, as other units or columns, and not `own`.
Status check_names(const std::filesystem::path& file,
                   const char* others,
                   const char* own,
                   const char* expected) {
  STEMVO_TRY_GET(const auto lines, read_lines(file));
  const std::regex name(others, std::regex::icase);
  const std::regex own_name(own, std::regex::icase);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    std::smatch found;
    if (std::regex_search(lines[i], found, name) && !std::regex_search(lines[i], own_name)) {
      return fail_at(file, i, fail(fmt::format("expected {}, found {}", expected, found.str())));
    }
  }
  return {};
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

Expected<TimedRows<SpeedRow>> read_speeds(const std::filesystem::path& file,
                                          const std::optional<std::pair<double, double>>& span_s) {
  STEMVO_TRY(check_names(file, "km *(/|p|per)? *h|kilomet[a-z]*|kph|mph|knots|miles|[cm]m */ *s",
                         "(^|[^a-z])m[ /]+s", "m/s"));
  STEMVO_TRY(check_names(file,
                         "[^a-z]v(el|elocity)?[_. ]?y([^a-z]|$)|"
                         "^(?!.*[^a-z](v|speed).*(sig|std)).*(sig|std)[a-z]*[^a-z]+(v|speed)",
                         "^ $", "columns of time, speed [, sigma]"));
  STEMVO_TRY_GET(const auto found, read_timed_rows(file, {2, 3}, "a time, m/s and maybe a sigma",
                                                   {.span_s = span_s}));
  TimedRows<SpeedRow> speeds{.rows = {}, .note = found.note};
  for (const TimedRow& row : found.rows) {
    STEMVO_TRY_GET(const auto numbers, numbers_of(row, file));
    const double sigma = numbers.size() > 1 ? numbers[1] : usual_speed_sigma(numbers[0]);
    if (!(sigma > 0.0)) {
      return fail(fmt::format("{}: expected a sigma above 0 at {} s, found {}", file.string(),
                              row.time_s, sigma));
    }
    speeds.rows.push_back({row.time_s, numbers[0], sigma});
  }
  return speeds;
}

Expected<TimedRows<GyroRow>> read_gyro(const std::filesystem::path& file,
                                       const std::optional<std::pair<double, double>>& span_s) {
  constexpr double kMinStep_s = 0.9e-4;
  STEMVO_TRY(check_names(file, "deg|dps|\xC2\xB0", "(^|[^a-z])rad[ /]+s", "rad/s"));
  // The first x is an acceleration's, or a y or z comes before it.
  STEMVO_TRY(check_names(file,
                         "^[^x]*[^a-z](a|acc[a-z]*|lin[a-z]*)([_. ][a-z_. ]*)?x([^a-z]|$)|"
                         "^[^x0-9]*[^a-z]([a-z]+[_.])*[wg]?[yz][^a-z].*x([^a-z]|$)",
                         "^ $", "columns of time, rates about x, y and z"));
  STEMVO_TRY_GET(
      const auto found,
      read_timed_rows(file, {4, 7}, "a time and rad/s about x, y and z",
                      {.min_step_s = kMinStep_s, .max_step_s = kMaxGap_s, .span_s = span_s}));
  TimedRows<GyroRow> rates{.rows = {}, .note = found.note};
  for (const TimedRow& row : found.rows) {
    STEMVO_TRY_GET(const auto numbers, numbers_of(row, file));
    rates.rows.push_back({row.time_s, Eigen::Vector3d(numbers[0], numbers[1], numbers[2])});
  }
  return rates;
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
