// SPDX-License-Identifier: MIT
#include "dataset/synth/walk.hpp"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "dataset/synth/hash.hpp"
#include "dataset/synth/sway.hpp"
#include "dataset/synth/walk_plan.hpp"

namespace stemvo::synth {
namespace {

constexpr double kPi = std::numbers::pi;

double radians(double degrees) { return degrees * kPi / 180.0; }

/// How the hand holds the camera while the person walks.
class Hand {
 public:
  explicit Hand(std::uint64_t seed)
      : yaw_rad_(seed, 101, radians(2.5), 0.04, 0.35),
        pitch_rad_(seed, 102, radians(2.0), 0.04, 0.35),
        roll_rad_(seed, 103, radians(1.5), 0.04, 0.35),
        tremble_yaw_rad_(seed, 104, radians(0.12), 1.5, 4.0),
        tremble_pitch_rad_(seed, 105, radians(0.12), 1.5, 4.0),
        tremble_roll_rad_(seed, 106, radians(0.12), 1.5, 4.0),
        sideways_m_(seed, 107, 0.02, 0.05, 0.3),
        height_m_(seed, 108, 0.012, 0.05, 0.3) {
    Draw draw(seed, 'h');
    held_m_ = draw.in(1.45, 1.55);
    held_pitch_rad_ = -radians(draw.in(4.0, 7.0));  // a little down
    bounce_m_ = draw.in(0.012, 0.02);
    swing_m_ = draw.in(0.012, 0.02);
    phase_rad_ = draw.in(0.0, 2.0 * kPi);
  }

  [[nodiscard]] Rigid3 world_from_camera(const Stance& stance, double time_s) const {
    // Two steps, left and right, are one swing to the sides.
    const double step_rad = 2.0 * kPi * kSteps_hz * time_s + phase_rad_;
    const double bounce = stance.stride * std::sin(step_rad);
    const double swing = stance.stride * std::sin(0.5 * step_rad);
    const double body_rad = stance.heading_rad + yaw_rad_.at(time_s);
    const double view_rad = body_rad + stance.look_rad;
    const double side_m = sideways_m_.at(time_s) + swing_m_ * swing;
    const Eigen::Vector3d right(std::cos(body_rad), 0.0, -std::sin(body_rad));
    const double height_m = held_m_ + height_m_.at(time_s) + bounce_m_ * bounce;
    const Eigen::Vector3d position =
        Eigen::Vector3d(stance.axis_m.x(), -height_m, stance.axis_m.y()) +
        (kArm_m - kWrist_m) * forward(body_rad) + kWrist_m * forward(view_rad) + side_m * right;
    const auto turn = [](double angle_rad, const Eigen::Vector3d& axis) {
      return Eigen::AngleAxisd(angle_rad, axis);
    };
    const double pitch_rad =
        held_pitch_rad_ + pitch_rad_.at(time_s) + tremble_pitch_rad_.at(time_s) + kNod_rad * bounce;
    const double roll_rad = roll_rad_.at(time_s) + tremble_roll_rad_.at(time_s) + kNod_rad * swing;
    return Rigid3::from_matrix(
        (turn(view_rad + tremble_yaw_rad_.at(time_s), Eigen::Vector3d::UnitY()) *
         turn(pitch_rad, Eigen::Vector3d::UnitX()) * turn(roll_rad, Eigen::Vector3d::UnitZ()))
            .toRotationMatrix(),
        position);
  }

 private:
  static constexpr double kSteps_hz = 1.8;
  static constexpr double kWrist_m = 0.12;  // looking aside turns the hand
  static constexpr double kNod_rad = 0.008;

  static Eigen::Vector3d forward(double heading_rad) {
    return {std::sin(heading_rad), 0.0, std::cos(heading_rad)};
  }

  Sway yaw_rad_;
  Sway pitch_rad_;
  Sway roll_rad_;
  Sway tremble_yaw_rad_;
  Sway tremble_pitch_rad_;
  Sway tremble_roll_rad_;
  Sway sideways_m_;
  Sway height_m_;
  double held_m_ = 0.0;
  double held_pitch_rad_ = 0.0;
  double bounce_m_ = 0.0;
  double swing_m_ = 0.0;
  double phase_rad_ = 0.0;
};

}  // namespace

Walk make_walk(int num_frames, std::uint64_t seed, const Pace& pace) {
  Walk walk;
  walk.courtyard = lay_courtyard(seed);
  const WalkPlan plan(walk.courtyard, num_frames / pace.rate_hz,
                      pace.speed_m_s.value_or(kWalkSpeed_m_s), seed);
  const Hand hand(seed);
  for (int i = 0; i < num_frames; ++i) {
    const double time_s = i / pace.rate_hz;
    walk.world_from_camera.push_back(hand.world_from_camera(plan.at(time_s), time_s));
  }
  return walk;
}

}  // namespace stemvo::synth
