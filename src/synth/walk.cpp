// SPDX-License-Identifier: MIT
#include "synth/walk.hpp"

#include <algorithm>
#include <iterator>

namespace stemvo::synth {
namespace {

/// From 0 to 1 with no velocity and no acceleration at either end.
double ease(double t) {
  const double x = std::clamp(t, 0.0, 1.0);
  return x * x * x * (10.0 - x * (15.0 - 6.0 * x));
}

/// Share of the full speed after `t_s`, if it is reached after `ramp_s`.
double ramp(double t_s, double ramp_s) {
  const double x = t_s < ramp_s ? t_s / ramp_s : 1.0;
  return x * x * (3.0 - 2.0 * x);
}

/// Time at full speed for the way of that ramp until `t_s`: its integral.
double ramp_integral_s(double t_s, double ramp_s) {
  const double x = t_s / ramp_s;
  return ramp_s * (x * x * x - 0.5 * x * x * x * x);
}

Vec3 forward(double heading_rad) { return {std::sin(heading_rad), 0.0, std::cos(heading_rad)}; }

/// Where the person is at one moment.
struct Stance {
  Vec2 axis_m;  ///< x, z
  double heading_rad;
  double glance_rad;
  double stride;  ///< 1: walks on at 0.5 m/s or more, 0: stands
};

Stance stance_at(const WalkPlan& plan, double time_s, double full_stride) {
  const auto next = std::ranges::upper_bound(plan.phases, time_s, {}, &WalkPhase::begin_s);
  const WalkPhase& phase = *std::prev(next);
  const double t_s = time_s - phase.begin_s;
  const double share = phase.share(time_s);
  Stance stance{phase.from_m + share * (phase.to_m - phase.from_m),
                phase.heading_from_rad + share * (phase.heading_to_rad - phase.heading_from_rad),
                0.0, 0.0};
  if (phase.is_turn()) {
    const double t = t_s / phase.duration_s;
    stance.stride = full_stride * 8.0 * t * t * (1.0 - t) * (1.0 - t);  // small steps
  } else if (!phase.is_pause()) {
    stance.stride = full_stride *
                    std::min(ramp(t_s, phase.start_s), ramp(phase.duration_s - t_s, phase.stop_s));
  }
  for (const WalkGlance& glance : plan.glances) {
    const double aside_s = time_s - glance.begin_s;
    const double back_s = aside_s - (glance.turn_s + glance.hold_s);
    stance.glance_rad +=
        glance.angle_rad * (ease(aside_s / glance.turn_s) - ease(back_s / glance.turn_s));
  }
  return stance;
}

/// How the hand holds the camera while the person walks.
struct Hand {
  std::uint64_t seed;
  Sway yaw_rad{seed, 101, radians(2.5), 0.04, 0.35};
  Sway pitch_rad{seed, 102, radians(2.0), 0.04, 0.35};
  Sway roll_rad{seed, 103, radians(1.5), 0.04, 0.35};
  Sway tremble_yaw_rad{seed, 104, radians(0.12), 1.5, 4.0};
  Sway tremble_pitch_rad{seed, 105, radians(0.12), 1.5, 4.0};
  Sway tremble_roll_rad{seed, 106, radians(0.12), 1.5, 4.0};
  Sway sideways_m{seed, 107, 0.02, 0.05, 0.3};
  Sway height_m{seed, 108, 0.012, 0.05, 0.3};
  Draw draw{seed, 'h'};
  double held_m = draw.in(1.45, 1.55);
  double held_pitch_rad = -radians(draw.in(4.0, 7.0));  // a little down
  double bounce_m = draw.in(0.012, 0.02);
  double swing_m = draw.in(0.012, 0.02);
  double phase_rad = draw.in(0.0, 2.0 * kPi);

  [[nodiscard]] Rigid3 world_from_camera(const Stance& stance, double time_s) const {
    constexpr double kSteps_hz = 1.8;
    constexpr double kWrist_m = 0.12;  // glancing aside turns the hand
    constexpr double kNod_rad = 0.008;
    // Two steps, left and right, are one swing to the sides.
    const double step_rad = 2.0 * kPi * kSteps_hz * time_s + phase_rad;
    const double bounce = stance.stride * std::sin(step_rad);
    const double swing = stance.stride * std::sin(0.5 * step_rad);
    const double body_rad = stance.heading_rad + yaw_rad.at(time_s);
    const double view_rad = body_rad + stance.glance_rad;
    const double side_m = sideways_m.at(time_s) + swing_m * swing;
    const double up_m = held_m + height_m.at(time_s) + bounce_m * bounce;
    const Vec3 right(std::cos(body_rad), 0.0, -std::sin(body_rad));
    const Vec3 position = Vec3(stance.axis_m.x(), -up_m, stance.axis_m.y()) +
                          (kArm_m - kWrist_m) * forward(body_rad) + kWrist_m * forward(view_rad) +
                          side_m * right;
    return Rigid3::from_matrix(
        rotation(view_rad + tremble_yaw_rad.at(time_s),
                 held_pitch_rad + pitch_rad.at(time_s) + tremble_pitch_rad.at(time_s) +
                     kNod_rad * bounce,
                 roll_rad.at(time_s) + tremble_roll_rad.at(time_s) + kNod_rad * swing),
        position);
  }
};

}  // namespace

double WalkPhase::share(double time_s) const {
  const double t_s = std::clamp(time_s - begin_s, 0.0, duration_s);
  if (is_turn()) {
    return ease(t_s / duration_s);
  }
  const double cruise_s = duration_s - 0.5 * (start_s + stop_s);
  const double left_s = duration_s - t_s;
  if (t_s < start_s) {
    return ramp_integral_s(t_s, start_s) / cruise_s;
  }
  return (left_s < stop_s ? cruise_s - ramp_integral_s(left_s, stop_s) : t_s - 0.5 * start_s) /
         cruise_s;
}

double WalkPhase::walked_m(double time_s) const {
  const double turned_m = kArm_m * std::abs(heading_to_rad - heading_from_rad);
  return (is_turn() ? turned_m : (to_m - from_m).norm()) * share(time_s);
}

Walk make_walk(int num_frames, std::uint64_t seed, const Pace& pace) {
  Walk walk;
  walk.courtyard = lay_courtyard(seed);
  const double speed_m_s = pace.speed_m_s.value_or(kWalkSpeed_m_s);
  const double full_stride = std::min(1.0, speed_m_s / kWalkSpeed_m_s);  // slow: short steps
  const WalkPlan plan = plan_walk(walk.courtyard, num_frames / pace.rate_hz, speed_m_s, seed);
  const Hand hand{seed};
  for (int i = 0; i < num_frames; ++i) {
    const double time_s = i / pace.rate_hz;
    walk.world_from_camera.push_back(
        hand.world_from_camera(stance_at(plan, time_s, full_stride), time_s));
  }
  return walk;
}

}  // namespace stemvo::synth
