// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "dataset/synth/courtyard.hpp"

namespace stemvo::synth {

/// The camera is held that far before the axis about which a person turns.
inline constexpr double kArm_m = 0.4;

/// Straight on, turning on the spot, or a pause (neither).
struct WalkPhase {
  double begin_s = 0.0;
  double duration_s = 0.0;
  Eigen::Vector2d from_m = Eigen::Vector2d::Zero();  ///< of the axis of turning: x, z
  Eigen::Vector2d to_m = Eigen::Vector2d::Zero();
  double heading_from_rad = 0.0;  ///< 0 is along z, positive to the right
  double heading_to_rad = 0.0;
  double start_s = 0.0;  ///< gathering speed; 0: goes on as fast as before
  double stop_s = 0.0;   ///< slowing down

  [[nodiscard]] double end_s() const { return begin_s + duration_s; }
  [[nodiscard]] bool is_turn() const { return heading_from_rad != heading_to_rad; }
  [[nodiscard]] bool is_pause() const { return !is_turn() && from_m == to_m; }
};

/// The camera turns aside and back while the person walks on.
struct WalkLook {
  double begin_s = 0.0;
  double turn_s = 0.0;  ///< each way
  double hold_s = 0.0;
  double angle_rad = 0.0;

  [[nodiscard]] double end_s() const { return begin_s + 2.0 * turn_s + hold_s; }
};

/// Where the person is at one moment.
struct Stance {
  Eigen::Vector2d axis_m;  ///< x, z
  double heading_rad;
  double look_rad;
  double stride;  ///< 1: walks on at 0.5 m/s or more, 0: stands
};

/// A walk along the walkways of a courtyard, for any length of time: turns on the spot of about
/// 90 degrees at their ends, looks aside by 30 to 60 degrees, pauses of about a second. At 0.5 m/s
/// the first 20 s have two turns, two looks and a pause at least.
class WalkPlan {
 public:
  /// `mean_m_s`: of the camera, over `duration_s`, with turns and pauses and without sway. Above
  /// 0.5 m/s turns, looks and pauses are quicker too.
  WalkPlan(const Courtyard& courtyard, double duration_s, double mean_m_s, std::uint64_t seed);

  [[nodiscard]] const std::vector<WalkPhase>& phases() const { return phases_; }
  [[nodiscard]] const std::vector<WalkLook>& looks() const { return looks_; }
  [[nodiscard]] Stance at(double time_s) const;

 private:
  double stride_;  ///< short steps where the walk is slow
  std::vector<WalkPhase> phases_;
  std::vector<WalkLook> looks_;
};

}  // namespace stemvo::synth
