// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <vector>

#include "synth/courtyard.hpp"
#include "synth/drive.hpp"

namespace stemvo::synth {

/// Poses of a hand-held camera, and the courtyard around them.
struct Walk {
  Trajectory world_from_camera;
  Courtyard courtyard;
};

inline constexpr double kWalkSpeed_m_s = 0.5;

/// A walk with a camera in the hand, some 1.5 m above the floor: the sway of steps, slow wander of
/// the view, and what WalkPlan has planned.
[[nodiscard]] Walk make_walk(int num_frames, std::uint64_t seed, const Pace& pace);

/// The camera is held that far before the axis about which a person turns.
inline constexpr double kArm_m = 0.4;

/// Straight on, turning on the spot, or a pause (neither).
struct WalkPhase {
  double begin_s = 0.0;
  double duration_s = 0.0;
  Vec2 from_m = Vec2::Zero();  ///< of the axis of turning: x, z
  Vec2 to_m = Vec2::Zero();
  double heading_from_rad = 0.0;  ///< 0 is along z, positive to the right
  double heading_to_rad = 0.0;
  double start_s = 0.0;  ///< gathering speed; 0: goes on as fast as before
  double stop_s = 0.0;   ///< slowing down

  [[nodiscard]] double end_s() const { return begin_s + duration_s; }
  [[nodiscard]] bool is_turn() const { return heading_from_rad != heading_to_rad; }
  [[nodiscard]] bool is_pause() const { return !is_turn() && from_m == to_m; }
  /// Of the phase's way or turn: how much is behind at `time_s`.
  [[nodiscard]] double share(double time_s) const;
  /// The camera's way until `time_s`.
  [[nodiscard]] double walked_m(double time_s) const;
};

/// The camera turns aside and back while the person walks on.
struct WalkGlance {
  double begin_s = 0.0;
  double turn_s = 0.0;  ///< each way
  double hold_s = 0.0;
  double angle_rad = 0.0;

  [[nodiscard]] double end_s() const { return begin_s + 2.0 * turn_s + hold_s; }
};

/// A walk along the walkways of a courtyard, for any length of time: turns on the spot of about
/// 90 degrees at their ends, glances aside by 30 to 60 degrees, pauses of about a second. At
/// 0.5 m/s the first 20 s have two turns, two glances and a pause at least.
struct WalkPlan {
  std::vector<WalkPhase> phases;
  std::vector<WalkGlance> glances;
};

/// `mean_m_s`: of the camera, over `duration_s`, with turns and pauses and without sway. Above
/// 0.5 m/s turns, glances and pauses are quicker too.
[[nodiscard]] WalkPlan plan_walk(const Courtyard& courtyard,
                                 double duration_s,
                                 double mean_m_s,
                                 std::uint64_t seed);

}  // namespace stemvo::synth
