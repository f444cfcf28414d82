// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <filesystem>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "evaluation/trajectory.hpp"
#include "support/run_program.hpp"
#include "support/state_drives.hpp"

namespace stemvo::test {

inline constexpr double kDeg = std::numbers::pi / 180.0;

/// One column of frames.csv.
inline std::vector<std::string> column(const std::string& csv, const std::string& name) {
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  const auto cells = [](const std::string& text) {
    std::vector<std::string> result(1);
    for (const char c : text) {
      c == ',' ? void(result.emplace_back()) : result.back().push_back(c);
    }
    return result;
  };
  const std::vector<std::string> names = cells(line);
  const auto index =
      static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  std::vector<std::string> values;
  while (std::getline(lines, line)) {
    values.push_back(cells(line).at(index));
  }
  return values;
}

/// The results of a run.
struct StateRun {
  std::vector<std::string> states;
  std::vector<std::string> roads;
  std::vector<std::string> sigmas;
  Trajectory poses;

  void expect_states(int from, int to, const std::vector<std::string>& allowed) const {
    for (int i = from; i < to; ++i) {
      const std::string& state = states.at(static_cast<std::size_t>(i));
      EXPECT_TRUE(std::find(allowed.begin(), allowed.end(), state) != allowed.end())
          << i << ": " << state;
    }
  }
};

/// Runs the program on a sequence, in a folder of its own.
inline StateRun run_states(const std::filesystem::path& sequence, const std::string& scale) {
  const TempFolder folder;
  const std::string out = folder / "result";
  const ProgramResult done = run_stemvo({"run", sequence.string(), "--out", out, "--quiet", "--set",
                                         "odometry.mode=map", "--set", "scale.source=" + scale});
  EXPECT_EQ(done.exit_code, 0) << done.err;
  const std::string csv = read_file(out + "/frames.csv");
  StateRun result{column(csv, "state"), column(csv, "scale_state"), column(csv, "scale_sigma"), {}};
  const auto poses = read_kitti_trajectory(out + "/trajectory_kitti.txt");  // refuses NaN
  EXPECT_TRUE(poses) << (poses ? "" : poses.error().message);
  result.poses = poses.value_or(Trajectory());
  return result;
}

/// Motions over `length` frames within [begin, end): metres and radians off.
inline void expect_accurate(const Trajectory& poses,
                            const StateDrive& drive,
                            int begin,
                            int end,
                            double max_error_share,
                            double max_error_rad,
                            int length = 10) {
  const Trajectory& truth = drive.world_from_camera;
  ASSERT_EQ(poses.size(), truth.size());
  for (int i = begin; i + length < end; ++i) {
    const auto first = static_cast<std::size_t>(i);
    const std::size_t last = first + length;
    const Rigid3 estimated = poses[first].inverse() * poses[last];
    const Rigid3 true_motion = truth[first].inverse() * truth[last];
    EXPECT_LE((estimated.translation - true_motion.translation).norm(),
              max_error_share * true_motion.translation.norm())
        << "frames " << i << " to " << i + length;
    EXPECT_LE(estimated.rotation.angularDistance(true_motion.rotation), max_error_rad) << i;
  }
}

}  // namespace stemvo::test
