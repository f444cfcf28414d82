// SPDX-License-Identifier: MIT
#pragma once

#include "evaluation/trajectory.hpp"
#include "support/drives.hpp"
#include "support/test.hpp"

namespace stemvo::test {

/// A drive with something in its middle that is no plain driving.
struct StateDrive {
  Trajectory world_from_camera = Trajectory(1);
  int event_begin = 0;  ///< frames [begin, end) are the event
  int event_end = 0;

  /// One more frame, `step_m` ahead and turned to the right.
  void drive(double step_m, double yaw_rad) {
    const Rigid3 prev_from_cur(so3_exp({0.0, yaw_rad, 0.0}), {step_m * std::sin(0.5 * yaw_rad), 0.0,
                                                              step_m * std::cos(0.5 * yaw_rad)});
    world_from_camera.push_back(world_from_camera.back() * prev_from_cur);
  }
  /// Along a road that winds a little.
  void drive_on(int num_frames, double step_m) {
    for (int i = 0; i < num_frames; ++i) {
      const double seconds = 0.1 * static_cast<double>(world_from_camera.size());
      drive(step_m, 0.01 * std::sin(0.7 * seconds));
    }
  }
  void begin() { event_begin = static_cast<int>(world_from_camera.size()); }
  void end() { event_end = static_cast<int>(world_from_camera.size()); }
};

inline constexpr double kDriveStep_m = 0.8;
inline constexpr double kStepAfterCut_m = 1.2;
inline constexpr double kTurnPerFrame_rad = 2.5 * std::numbers::pi / 180.0;

/// Brakes over 0.7 s, turns on the spot for so many frames, and speeds up again.
inline StateDrive stop_for(int num_frames, double yaw_rad) {
  constexpr int kNumSlow = 8;
  StateDrive drive;
  drive.drive_on(40, kDriveStep_m);
  for (int k = kNumSlow - 1; k > 0; --k) {
    drive.drive(kDriveStep_m * k / kNumSlow, 0.0);
  }
  drive.begin();
  for (int i = 0; i < num_frames; ++i) {
    drive.drive(0.0, yaw_rad);
  }
  drive.end();
  for (int k = 1; k < kNumSlow; ++k) {
    drive.drive(kDriveStep_m * k / kNumSlow, 0.0);
  }
  drive.drive_on(40, kDriveStep_m);
  return drive;
}

/// 2 s without motion.
inline StateDrive standing_drive() { return stop_for(20, 0.0); }

/// 40 degrees to the right on the spot, in 1.6 s.
inline StateDrive turning_drive() { return stop_for(16, kTurnPerFrame_rad); }

/// Nothing but driving, 60 frames.
inline StateDrive steady_drive() {
  StateDrive drive;
  drive.drive_on(59, kDriveStep_m);
  return drive;
}

/// From one frame to the next in another street, and faster.
inline StateDrive cut_drive() {
  StateDrive drive;
  drive.drive_on(50, kDriveStep_m);
  drive.begin();
  drive.world_from_camera.push_back(drive.world_from_camera.back() *
                                    Rigid3(so3_exp({0.0, 0.5, 0.0}), {60.0, 0.0, 40.0}));
  drive.end();
  drive.drive_on(50, kStepAfterCut_m);
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
