// SPDX-License-Identifier: MIT
#pragma once

#include "odometry/window_estimator.hpp"
#include "support/estimator_run.hpp"
#include "support/test.hpp"

namespace stemvo::testing {

/// A street that winds a little, at a car's speed of `step_m` a frame.
inline DriveTracks car_drive(double length_m, double step_m, double noise_px, std::uint64_t seed) {
  std::vector<Rigid3> path(1);
  for (double at = step_m; at <= length_m; at += step_m) {
    const double bend = 0.02 * std::sin(0.1 * at);
    path.push_back(path.back() * Rigid3(so3_exp({0.0, bend * step_m, 0.0}),
                                        {0.5 * bend * step_m * step_m, 0.0, step_m}));
  }
  const auto points = points_along(path, static_cast<int>(30.0 * length_m), seed);
  return {path, points, noise_px, seed};
}

/// To and fro before the walls of a room, turning at the same time; 30 frames a second.
inline DriveTracks hand_walk(int num_frames, double noise_px, std::uint64_t seed) {
  std::vector<Rigid3> path;
  for (int i = 0; i < num_frames; ++i) {
    const double t = i / 30.0;
    const Eigen::Vector3d position(0.6 * std::sin(0.8 * t), 0.02 * std::sin(11.0 * t),
                                   0.3 * (1.0 - std::cos(0.7 * t)));
    path.emplace_back(so3_exp({0.01 * std::sin(5.0 * t), 0.5 * std::sin(0.6 * t), 0.0}), position);
  }
  return {path, points_of_room(2500, 4.0, seed), noise_px, seed};
}

/// An estimator with the defaults that was taken along.
struct Driven {
  DriveTracks drive;
  WindowEstimator estimator{config_without_scale(), drive.camera};
  EstimatorRun run{estimator, drive};
  std::set<int> keyframes;

  explicit Driven(DriveTracks tracks) : drive(std::move(tracks)) {}

  void add_range(int from, int to) {
    for (int i = from; i < to; ++i) {
      run.add(i);
      for (const Keyframe& keyframe : estimator.window().keyframes) {
        keyframes.insert(keyframe.frame);
      }
    }
  }
  [[nodiscard]] const Rigid3& pose(int i) const {
    return estimator.trajectory()[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] double moved(int from, int to) const {
    return (pose(to).translation - pose(from).translation).norm();
  }
  void expect_only(int from, int to, FrameState expected) const {
    for (int i = from; i < to; ++i) {
      EXPECT_EQ(run.state(i), expected) << i << ": " << to_string(run.state(i));
    }
  }
};

}  // namespace stemvo::testing
