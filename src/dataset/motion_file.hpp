// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "stemvo/error.hpp"
#include "text/text_file.hpp"

namespace stemvo::dataset {

struct SpeedRow {
  double time_s = 0.0;
  double metres_per_s = 0.0;
  double sigma = 0.0;
};

struct GyroRow {
  double time_s = 0.0;
  Eigen::Vector3d rad_per_s = Eigen::Vector3d::Zero();
};

/// Rows `time, m/s` or `time, m/s, sigma`, as read_timed_rows says. A row without a sigma has
/// add_speed's own. Errors: its; a sigma that is not above 0. `span_s`: first
/// and last time of the frames, where they are known.
[[nodiscard]] Expected<TimedRows<SpeedRow>> read_speeds(
    const std::filesystem::path& file,
    const std::optional<std::pair<double, double>>& span_s = std::nullopt);

/// Rows `time, x, y, z` in rad/s, likewise; or EuRoC's imu0/data.csv, whose comment says [ns], with
/// the accelerations behind them.
[[nodiscard]] Expected<TimedRows<GyroRow>> read_gyro(
    const std::filesystem::path& file,
    const std::optional<std::pair<double, double>>& span_s = std::nullopt);

/// Rotation prev_from_cur of the gyro's own axes between two times: rates change evenly from row to
/// row. nullopt: the rows leave 0.1 s or more of it out.
[[nodiscard]] std::optional<Eigen::Quaterniond> integrate_gyro(const std::vector<GyroRow>& rows,
                                                               double from_s,
                                                               double to_s);

}  // namespace stemvo::dataset
