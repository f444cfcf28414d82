// SPDX-License-Identifier: MIT
#pragma once

#include "evaluation/trajectory.hpp"
#include "support/run_program.hpp"
#include "support/state_drives.hpp"
#include "support/test.hpp"

namespace stemvo::test {

/// One column of frames.csv.
inline Words column(const std::string& csv, const std::string& name) {
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  const auto cells = [](const std::string& text) {
    Words result(1);
    for (const char c : text) {
      c == ',' ? void(result.emplace_back()) : result.back().push_back(c);
    }
    return result;
  };
  const Words names = cells(line);
  const auto index =
      static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  Words values;
  while (std::getline(lines, line)) {
    values.push_back(cells(line).at(index));
  }
  return values;
}

/// The results of a run.
struct StateRun {
  Words states;
  Words roads;
  Trajectory poses;

  [[nodiscard]] Rigid3 motion(int from, int to) const {
    return poses.at(static_cast<std::size_t>(from)).inverse() *
           poses.at(static_cast<std::size_t>(to));
  }
  void expect_states(int from, int to, const Words& allowed) const {
    for (int i = from; i < to; ++i) {
      EXPECT_THAT(allowed, Contains(states.at(static_cast<std::size_t>(i)))) << i;
    }
  }
};

/// Runs the program on a sequence, in a folder of its own.
inline StateRun run_states(const std::filesystem::path& sequence, const std::string& scale) {
  const TempFolder folder;
  const std::string out = folder / "result";
  succeeded(run_stemvo({"run", sequence.string(), "--out", out, "--quiet", "--set",
                        "odometry.mode=map", "--set", "scale.source=" + scale}));
  const std::string csv = read_file(out + "/frames.csv");
  return {column(csv, "state"), column(csv, "scale_state"),
          read_kitti_trajectory(out + "/trajectory_kitti.txt").value()};  // refuses NaN
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
