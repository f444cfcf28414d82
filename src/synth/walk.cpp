// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <iterator>

#include "synth/drive.hpp"

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

/// The camera is held that far before the axis about which a person turns.
constexpr double kArm_m = 0.4;

/// Straight on, turning on the spot, or a pause (neither).
struct Phase {
  double begin_s;
  double duration_s;
  Vec2 from_m;  ///< the axis of turning: x, z
  Vec2 to_m;
  double heading_from_rad;  ///< 0 is along z, positive to the right
  double heading_to_rad;
  double start_s;  ///< gathers speed so long; 0: goes on as fast as before
  double stop_s;   ///< slows down so long

  [[nodiscard]] double end_s() const { return begin_s + duration_s; }
  [[nodiscard]] bool is_turn() const { return heading_from_rad != heading_to_rad; }
  /// How much of the way or turn is behind at `time_s`.
  [[nodiscard]] double share(double time_s) const {
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
};

struct Glance {
  double begin_s;
  double turn_s;  ///< each way
  double hold_s;
  double angle_rad;
};

/// Walkways meet at a column and a row.
using Crossing = Eigen::Vector2i;

/// A walk along the walkways of a courtyard: turns on the spot of about 90 degrees at their ends,
/// glances aside by 30 to 60 degrees, pauses of about a second. The first 20 s have two turns, two
/// glances and a pause at least.
class WalkPlan {
 public:
  WalkPlan(const Courtyard& courtyard,
           const RenderOptions& options,
           double duration_s,
           double cruise_m_s)
      : yard_(courtyard),
        draw_(options.visit == 0 ? Draw(courtyard.seed, 'v')
                                 : Draw(courtyard.seed, 'v', options.visit)),
        turn_rate_deg_s_(options.turn_rate_deg_s),
        cruise_m_s_(cruise_m_s) {
    // The start lies in the middle of a way from one side to the other.
    const std::array<Crossing, 4> directions = {{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};
    direction_ = directions[draw_.bits() % 4];
    const auto line = static_cast<int>(draw_.bits() % 3);
    const Crossing from(direction_.x() == 0 ? line : 1 - direction_.x(),
                        direction_.y() == 0 ? line : 1 - direction_.y());
    to_ = from + 2 * direction_;
    at_m_ = position(from);
    at_m_ += draw_.in(0.36, 0.44) * (position(to_) - at_m_);
    heading_rad_ = heading_to(to_);
    for (int leg = 0; now_s_ < duration_s; ++leg) {
      walk_leg(leg);
      turn(leg);
    }
  }

  std::vector<Phase> phases;
  std::vector<Glance> glances;

 private:
  /// A crossing is missed by a few centimetres.
  [[nodiscard]] Vec2 position(const Crossing& at) const {
    Draw draw(yard_.seed, 'J', at.x(), at.y());
    return {yard_.x_m[static_cast<std::size_t>(at.x())] + draw.in(-0.05, 0.05),
            yard_.z_m[static_cast<std::size_t>(at.y())] + draw.in(-0.05, 0.05)};
  }

  /// The heading nearest to the present one that points to a crossing.
  [[nodiscard]] double heading_to(const Crossing& to) const {
    const Vec2 way = position(to) - at_m_;
    return heading_rad_ + std::remainder(std::atan2(way.x(), way.y()) - heading_rad_, 2.0 * kPi);
  }

  [[nodiscard]] Phase stand(double duration_s) const {
    return {now_s_, duration_s, at_m_, at_m_, heading_rad_, heading_rad_, 0.0, 0.0};
  }

  void add(const Phase& phase) {
    now_s_ = phase.end_s();
    at_m_ = phase.to_m;
    heading_rad_ = phase.heading_to_rad;
    phases.push_back(phase);
  }

  void walk_leg(int leg) {
    const Vec2 end = position(to_);
    const bool wants_glance = is_long_ && (glances.size() < 2 || draw_.chance(0.7));
    const bool wants_pause =
        leg == 1 || (leg > 1 && now_s_ > last_pause_s_ + 12.0 && draw_.chance(0.6));
    const double split = is_long_ ? draw_.in(0.60, 0.66) : draw_.in(0.45, 0.55);
    walk_to(wants_pause ? (at_m_ + split * (end - at_m_)).eval() : end, leg > 0);
    if (wants_glance) {
      glance();
    }
    if (wants_pause) {
      last_pause_s_ = now_s_;
      add(stand(draw_.in(0.9, 1.25)));
      walk_to(end, true);
    }
  }

  void walk_to(const Vec2& to, bool from_rest) {
    constexpr double kRamp_s = 0.8;
    Phase phase = stand(0.0);
    phase.start_s = from_rest ? kRamp_s : 0.0;
    phase.stop_s = kRamp_s;
    phase.duration_s = (to - at_m_).norm() / cruise_m_s_ + 0.5 * (phase.start_s + phase.stop_s);
    phase.to_m = to;
    add(phase);
  }

  /// Aside and back within the last phase, slower than a turn.
  void glance() {
    const Phase& phase = phases.back();
    constexpr double kRate_rad_s = radians(42.0);
    const double begin_s = phase.begin_s + 0.5 * phase.start_s;
    const double room_s = phase.end_s() - 0.1 - begin_s;
    const double hold_s = draw_.in(0.3, 0.7);
    const double max_rad = 0.5 * (room_s - hold_s) * kRate_rad_s;
    const double angle_rad = std::min(radians(draw_.in(32.0, 60.0)), max_rad);
    const double turn_s = angle_rad / kRate_rad_s;
    const double late = draw_.in(0.0, glances.size() < 2 ? 0.1 : 0.8);
    const double side = draw_.chance(0.5) ? 1.0 : -1.0;
    if (angle_rad >= radians(30.0)) {
      glances.push_back(
          {begin_s + late * (room_s - 2.0 * turn_s - hold_s), turn_s, hold_s, side * angle_rad});
    }
  }

  /// On the spot, to a new way that begins here; to the left or to the right.
  void turn(int leg) {
    std::vector<Crossing> ways;
    for (const int length : {-1, -2, 1, 2}) {
      const Crossing way = length * Crossing(direction_.y(), -direction_.x());
      const Crossing to = to_ + way;
      if (to.minCoeff() >= 0 && to.maxCoeff() <= 2 && to != Crossing(1, 1)) {
        ways.push_back(way);
      }
    }
    const auto is_short = [](const Crossing& way) { return way.cwiseAbs().sum() == 1; };
    if (leg >= 1 && glances.size() < 2 && !std::ranges::all_of(ways, is_short)) {
      std::erase_if(ways, is_short);  // only a long way leaves time for a glance
    }
    const Crossing way = ways[draw_.bits() % ways.size()];
    is_long_ = !is_short(way);
    direction_ = way / way.cwiseAbs().sum();
    to_ += way;
    Phase phase = stand(0.0);
    phase.heading_to_rad = heading_to(to_);
    constexpr double kMeanOfPeak = 8.0 / 15.0;  // as turns are eased
    double rate_rad_s = radians(draw_.in(36.0, 46.0));
    rate_rad_s = turn_rate_deg_s_ ? kMeanOfPeak * radians(*turn_rate_deg_s_) : rate_rad_s;
    phase.duration_s = std::abs(phase.heading_to_rad - heading_rad_) / rate_rad_s;
    add(phase);
  }

  const Courtyard& yard_;
  Draw draw_;
  std::optional<double> turn_rate_deg_s_;
  double cruise_m_s_;
  double now_s_ = 0.0;
  double last_pause_s_ = 0.0;
  Vec2 at_m_ = Vec2::Zero();
  double heading_rad_ = 0.0;
  Crossing direction_ = Crossing::Zero();
  Crossing to_ = Crossing::Zero();
  bool is_long_ = true;  ///< from one side to the other
};

/// Turns and pauses included, the camera then moves at 0.5 m/s in the mean.
double cruising_speed_m_s(const Courtyard& courtyard,
                          const RenderOptions& options,
                          double duration_s) {
  constexpr double kMean_m_s = 0.5;
  double low_m_s = 0.2 * kMean_m_s;
  double high_m_s = 2.0 * kMean_m_s;
  double cruise_m_s = 0.0;
  for (int i = 0; i < 40; ++i) {
    cruise_m_s = 0.5 * (low_m_s + high_m_s);
    double way_m = 0.0;
    const WalkPlan plan(courtyard, options, duration_s, cruise_m_s);
    for (const Phase& phase : plan.phases) {
      const double turned_m = kArm_m * std::abs(phase.heading_to_rad - phase.heading_from_rad);
      way_m += (phase.is_turn() ? turned_m : (phase.to_m - phase.from_m).norm()) *
               phase.share(duration_s);
    }
    (way_m < kMean_m_s * duration_s ? low_m_s : high_m_s) = cruise_m_s;
  }
  return cruise_m_s;
}

struct Stance {
  Vec2 axis_m;  ///< x, z
  double heading_rad;
  double glance_rad;
  double stride;  ///< 1: walks on at full speed, 0: stands
};

Stance stance_at(const WalkPlan& plan, double time_s) {
  const auto next = std::ranges::upper_bound(plan.phases, time_s, {}, &Phase::begin_s);
  const Phase& phase = *std::prev(next);
  const double t_s = time_s - phase.begin_s;
  const double share = phase.share(time_s);
  Stance stance{phase.from_m + share * (phase.to_m - phase.from_m),
                phase.heading_from_rad + share * (phase.heading_to_rad - phase.heading_from_rad),
                0.0, 0.0};
  if (phase.is_turn()) {
    const double t = t_s / phase.duration_s;
    stance.stride = 8.0 * t * t * (1.0 - t) * (1.0 - t);  // small steps
  } else if (phase.to_m != phase.from_m) {
    stance.stride = std::min(ramp(t_s, phase.start_s), ramp(phase.duration_s - t_s, phase.stop_s));
  }
  for (const Glance& glance : plan.glances) {
    const double aside_s = time_s - glance.begin_s;
    const double back_s = aside_s - (glance.turn_s + glance.hold_s);
    stance.glance_rad +=
        glance.angle_rad * (ease(aside_s / glance.turn_s) - ease(back_s / glance.turn_s));
  }
  return stance;
}

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

Walk make_walk(int num_frames, std::uint64_t seed, const RenderOptions& options) {
  Walk walk{{}, lay_courtyard(seed)};
  walk.courtyard.has_blank_walls = options.blank_walls;
  const double duration_s = num_frames / options.walk_rate_hz;
  const WalkPlan plan(walk.courtyard, options, duration_s,
                      cruising_speed_m_s(walk.courtyard, options, duration_s));
  const Hand hand{options.visit == 0 ? seed : hash_of(seed, 'V', options.visit)};
  for (int i = 0; i < num_frames; ++i) {
    const double time_s = i / options.walk_rate_hz;
    walk.world_from_camera.push_back(hand.world_from_camera(stance_at(plan, time_s), time_s));
  }
  return walk;
}

}  // namespace stemvo::synth
