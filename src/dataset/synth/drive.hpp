// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "dataset/synth/road_curve.hpp"
#include "stemvo/evaluation/trajectory.hpp"

namespace stemvo::synth {

/// Where one frame stands: on which road, and how far along it.
struct FramePlace {
  std::size_t road = 0;
  double arc_m = 0.0;
};

/// Camera poses and the roads under them. The world is any frame in which -y is roughly up.
struct Drive {
  Trajectory world_from_camera;
  std::vector<FramePlace> places;  ///< one per pose
  std::vector<RoadCurve> roads;    ///< more than one where the poses jump to another place
};

/// How often the camera takes a picture and how fast it moves in the mean.
struct Pace {
  double rate_hz = 10.0;
  std::optional<double> speed_m_s = std::nullopt;  ///< nullopt: as each path's maker has it
};

/// A street with turns to both sides, gentle hills and banks, driven at 8-12 m/s or at the given
/// mean speed (slower in turns, above 12 m/s wider turns); the camera pitches and rolls against the
/// road by about 0.4 deg (standard deviation) and bounces by 1-2 cm.
[[nodiscard]] Drive make_own_drive(int num_frames, std::uint64_t seed, const Pace& pace = {});

/// The road that fits given camera poses: 1.65 m below the smoothed path, with its elevation and
/// bank. The poses are kept exactly; what the smoothing takes away is how the camera moves against
/// the road. Standing, turning on the spot, reversing and jumps (over 12 m, at less than 10
/// frames/s over 120 m/s) are fine.
[[nodiscard]] Drive make_drive_along(const Trajectory& world_from_camera, double rate_hz = 10.0);

}  // namespace stemvo::synth
