// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "evaluation/trajectory.hpp"
#include "support/drives.hpp"

namespace stemvo::test {

/// A drive with something in its middle that is no plain driving.
struct StateDrive {
  Trajectory world_from_camera;
  int event_begin = 0;  ///< frames [begin, end) are the event
  int event_end = 0;
  int rate = 1;  ///< frames per 0.1 s

  /// One more frame, `step_m` ahead and turned to the right.
  void drive(double step_m, double yaw_rad) {
    const Rigid3 prev_from_cur(so3_exp({0.0, yaw_rad, 0.0}), {step_m * std::sin(0.5 * yaw_rad), 0.0,
                                                              step_m * std::cos(0.5 * yaw_rad)});
    world_from_camera.push_back(world_from_camera.back() * prev_from_cur);
  }
  /// Along a road that winds a little.
  void drive_on(int num_frames, double step_m) {
    for (int i = 0; i < num_frames; ++i) {
      const double seconds = 0.1 * static_cast<double>(world_from_camera.size()) / rate;
      drive(step_m, 0.01 / rate * std::sin(0.7 * seconds));
    }
  }
  void begin() { event_begin = static_cast<int>(world_from_camera.size()); }
  void end() { event_end = static_cast<int>(world_from_camera.size()); }
};

inline constexpr double kDriveStep_m = 0.8;
inline constexpr double kStepAfterCut_m = 1.2;
inline constexpr double kTurnPerFrame_rad = 2.5 * std::numbers::pi / 180.0;

/// Brakes over 0.7 s, lets `event` happen, and speeds up again; `rate` frames per 0.1 s.
template <typename Event>
StateDrive stop_for(const Event& event, int rate) {
  const double step_m = kDriveStep_m / rate;
  const int num_slow = 8 * rate;
  StateDrive drive;
  drive.rate = rate;
  drive.world_from_camera.emplace_back();
  drive.drive_on(40 * rate, step_m);
  for (int k = num_slow - 1; k > 0; --k) {
    drive.drive(step_m * k / num_slow, 0.0);
  }
  drive.begin();
  event(drive);
  drive.end();
  for (int k = 1; k < num_slow; ++k) {
    drive.drive(step_m * k / num_slow, 0.0);
  }
  drive.drive_on(40 * rate, step_m);
  return drive;
}

/// 2 s without motion.
inline StateDrive standing_drive(int rate = 1) {
  return stop_for(
      [rate](StateDrive& drive) {
        for (int i = 0; i < 20 * rate; ++i) {
          drive.drive(0.0, 0.0);
        }
      },
      rate);
}

/// 40 degrees to the right on the spot, in 1.6 s.
inline StateDrive turning_drive(int rate = 1) {
  return stop_for(
      [rate](StateDrive& drive) {
        for (int i = 0; i < 16 * rate; ++i) {
          drive.drive(0.0, kTurnPerFrame_rad / rate);
        }
      },
      rate);
}

/// Nothing but driving, 60 frames.
inline StateDrive steady_drive() {
  StateDrive drive;
  drive.world_from_camera.emplace_back();
  drive.drive_on(59, kDriveStep_m);
  return drive;
}

/// From one frame to the next in another street, and faster.
inline StateDrive cut_drive(int rate = 1) {
  StateDrive drive;
  drive.rate = rate;
  drive.world_from_camera.emplace_back();
  drive.drive_on(50 * rate, kDriveStep_m / rate);
  drive.begin();
  drive.world_from_camera.push_back(drive.world_from_camera.back() *
                                    Rigid3(so3_exp({0.0, 0.5, 0.0}), {60.0, 0.0, 40.0}));
  drive.end();
  drive.drive_on(50 * rate, kStepAfterCut_m / rate);
  return drive;
}

/// Renders it (once per build); the folder of the sequence.
inline std::filesystem::path rendered_along(const std::string& name, const StateDrive& drive) {
  const TempFolder folder;
  const std::filesystem::path poses = folder / "poses.txt";
  if (const Status status = write_kitti_trajectory(poses, drive.world_from_camera); !status) {
    throw std::runtime_error(status.error().message);
  }
  const DriveSize size{.frames = static_cast<int>(drive.world_from_camera.size())};
  return render_once(name, size, poses) / "sequences/00";
}

}  // namespace stemvo::test
