// SPDX-License-Identifier: MIT
#include "dataset/synth/walk_plan.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

#include "dataset/synth/hash.hpp"

namespace stemvo::synth {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kUnhurried_m_s = 0.5;

double radians(double degrees) { return degrees * kPi / 180.0; }

/// From 0 to 1 with no velocity and no acceleration at either end.
double ease(double t) {
  const double x = std::clamp(t, 0.0, 1.0);
  return x * x * x * (10.0 - x * (15.0 - 6.0 * x));
}

/// Share of a phase's way that is behind after `t_s`: the speed rises and falls as 3x^2 - 2x^3.
double share_walked(const WalkPhase& phase, double t_s) {
  const auto ramp = [](double x) { return x * x * x - 0.5 * x * x * x * x; };  // its integral
  const double cruise_s = phase.duration_s - 0.5 * (phase.start_s + phase.stop_s);
  const double t = std::clamp(t_s, 0.0, phase.duration_s);
  const double left_s = phase.duration_s - t;
  double walked_s = t - 0.5 * phase.start_s;
  if (t < phase.start_s) {
    walked_s = phase.start_s * ramp(t / phase.start_s);
  } else if (left_s < phase.stop_s) {
    walked_s = cruise_s - phase.stop_s * ramp(left_s / phase.stop_s);
  }
  return walked_s / cruise_s;
}

/// Speed of a phase as a share of its cruising speed.
double share_of_speed(const WalkPhase& phase, double t_s) {
  const auto ramp = [](double x) { return x * x * (3.0 - 2.0 * x); };
  const double left_s = phase.duration_s - t_s;
  double share = 1.0;
  if (t_s < phase.start_s) {
    share = ramp(std::max(t_s, 0.0) / phase.start_s);
  }
  if (left_s < phase.stop_s) {
    share = std::min(share, ramp(std::max(left_s, 0.0) / phase.stop_s));
  }
  return share;
}

double walked_m(const WalkPhase& phase, double time_s) {
  const double t_s = time_s - phase.begin_s;
  if (phase.is_turn()) {
    return kArm_m * std::abs(phase.heading_to_rad - phase.heading_from_rad) *
           ease(t_s / phase.duration_s);
  }
  return phase.is_pause() ? 0.0 : (phase.to_m - phase.from_m).norm() * share_walked(phase, t_s);
}

/// Where walkways meet: column and row.
struct Crossing {
  int x = 0;
  int z = 0;
  friend bool operator==(const Crossing&, const Crossing&) = default;
};

Crossing step(const Crossing& from, const Crossing& direction, int count) {
  return {from.x + count * direction.x, from.z + count * direction.z};
}

constexpr Crossing kMiddle = {1, 1};

bool may_end_at(const Crossing& at) {
  return at.x >= 0 && at.x <= 2 && at.z >= 0 && at.z <= 2 && at != kMiddle;
}

/// Draws one walk at a given cruising speed.
class WalkPlanner {
 public:
  WalkPlanner(const Courtyard& courtyard, std::uint64_t seed, double mean_m_s, double cruise_m_s)
      : yard_(courtyard),
        draw_(seed, 'v'),
        cruise_m_s_(cruise_m_s),
        tempo_(std::max(1.0, mean_m_s / kUnhurried_m_s)),
        ramp_s_(0.8 / tempo_),
        seed_(seed) {}

  void draw_walk(double duration_s) {
    draw_start();
    for (int leg = 0; now_s_ < duration_s; ++leg) {
      walk_leg(leg);
      turn(leg);
    }
  }

  std::vector<WalkPhase> phases;
  std::vector<WalkLook> looks;

 private:
  /// In the middle of a way from one side to the other.
  void draw_start() {
    static constexpr std::array<Crossing, 4> kDirections = {{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};
    direction_ = kDirections[draw_.bits() % 4];
    const auto line = static_cast<int>(draw_.bits() % 3);
    const Crossing from = {direction_.x == 0 ? line : 1 - direction_.x,
                           direction_.z == 0 ? line : 1 - direction_.z};
    to_ = step(from, direction_, 2);
    const Eigen::Vector2d begin = place(from);
    at_m_ = begin + draw_.in(0.36, 0.44) * (place(to_) - begin);
    heading_rad_ = heading_along(place(to_) - at_m_);
  }

  /// A crossing, missed by a few centimetres.
  [[nodiscard]] Eigen::Vector2d place(const Crossing& at) const {
    Draw draw(seed_, 'J', at.x, at.z);
    return {yard_.x_m[static_cast<std::size_t>(at.x)] + draw.in(-0.05, 0.05),
            yard_.z_m[static_cast<std::size_t>(at.z)] + draw.in(-0.05, 0.05)};
  }

  /// The heading nearest to the present one that points along `way`.
  [[nodiscard]] double heading_along(const Eigen::Vector2d& way) const {
    const double wanted_rad = std::atan2(way.x(), way.y());
    return heading_rad_ + std::remainder(wanted_rad - heading_rad_, 2.0 * kPi);
  }

  /// Standing for a while, from now on.
  [[nodiscard]] WalkPhase stand(double duration_s) const {
    return {now_s_, duration_s, at_m_, at_m_, heading_rad_, heading_rad_, 0.0, 0.0};
  }

  void add(const WalkPhase& phase) {
    now_s_ = phase.end_s();
    at_m_ = phase.to_m;
    heading_rad_ = phase.heading_to_rad;
    phases.push_back(phase);
  }

  void walk_leg(int leg) {
    const Eigen::Vector2d end = place(to_);
    const bool wants_look = is_long_ && (looks.size() < 2 || draw_.chance(0.7));
    const bool wants_pause =
        leg == 1 || (leg > 1 && now_s_ > last_pause_s_ + 12.0 / tempo_ && draw_.chance(0.6));
    const double split = is_long_ ? draw_.in(0.60, 0.66) : draw_.in(0.45, 0.55);
    const Eigen::Vector2d stop = wants_pause ? (at_m_ + split * (end - at_m_)).eval() : end;
    walk_to(stop, leg > 0);
    if (wants_look) {
      look();
    }
    if (wants_pause) {
      last_pause_s_ = now_s_;
      add(stand(draw_.in(0.9, 1.25) / tempo_));
      walk_to(end, true);
    }
  }

  void walk_to(const Eigen::Vector2d& to, bool from_rest) {
    WalkPhase phase = stand(0.0);
    phase.start_s = from_rest ? ramp_s_ : 0.0;
    phase.stop_s = ramp_s_;
    phase.duration_s = (to - at_m_).norm() / cruise_m_s_ + 0.5 * (phase.start_s + phase.stop_s);
    phase.to_m = to;
    add(phase);
  }

  /// Aside and back within the last phase, slower than a turn.
  void look() {
    const WalkPhase& phase = phases.back();
    const double rate_rad_s = radians(42.0) * tempo_;
    const double begin_s = phase.begin_s + 0.5 * phase.start_s;
    const double room_s = phase.end_s() - 0.1 / tempo_ - begin_s;
    WalkLook look;
    look.hold_s = draw_.in(0.3, 0.7) / tempo_;
    const double most_rad = 0.5 * (room_s - look.hold_s) * rate_rad_s;
    const double angle_rad = std::min(radians(draw_.in(32.0, 60.0)), most_rad);
    const double late = draw_.in(0.0, looks.size() < 2 ? 0.1 : 0.8);
    look.angle_rad = draw_.chance(0.5) ? angle_rad : -angle_rad;
    look.turn_s = angle_rad / rate_rad_s;
    look.begin_s = begin_s + late * (room_s - 2.0 * look.turn_s - look.hold_s);
    if (angle_rad >= radians(30.0)) {
      looks.push_back(look);
    }
  }

  /// On the spot, to a new way that begins here; to the left or to the right.
  void turn(int leg) {
    struct Way {
      Crossing direction;
      Crossing to;
    };
    std::vector<Way> ways;
    std::vector<Way> long_ways;
    for (const int side : {-1, 1}) {
      const Crossing direction = {side * direction_.z, -side * direction_.x};
      for (const int count : {1, 2}) {
        const Crossing to = step(to_, direction, count);
        if (may_end_at(to)) {
          ways.push_back({direction, to});
          if (count == 2) {
            long_ways.push_back(ways.back());
          }
        }
      }
    }
    const bool must_be_long = leg >= 1 && looks.size() < 2 && !long_ways.empty();
    const auto& choice = must_be_long ? long_ways : ways;
    const Way way = choice[draw_.bits() % choice.size()];
    is_long_ = way.to == step(to_, way.direction, 2);
    direction_ = way.direction;
    to_ = way.to;
    WalkPhase phase = stand(0.0);
    phase.heading_to_rad = heading_along(place(to_) - at_m_);
    const double rate_rad_s = radians(draw_.in(36.0, 46.0)) * tempo_;
    phase.duration_s = std::abs(phase.heading_to_rad - heading_rad_) / rate_rad_s;
    add(phase);
  }

  const Courtyard& yard_;
  Draw draw_;
  double cruise_m_s_;
  double tempo_;
  double ramp_s_;
  std::uint64_t seed_;

  double now_s_ = 0.0;
  double last_pause_s_ = 0.0;
  Eigen::Vector2d at_m_ = Eigen::Vector2d::Zero();
  double heading_rad_ = 0.0;
  Crossing direction_;
  Crossing to_;
  bool is_long_ = true;  ///< from one side to the other
};

double way_m(const std::vector<WalkPhase>& phases, double time_s) {
  double sum_m = 0.0;
  for (const WalkPhase& phase : phases) {
    sum_m += walked_m(phase, time_s);
  }
  return sum_m;
}

/// What lies at `time_s` in a list ordered by begin_s; the first begins before it.
template <typename Span>
const Span& last_begun(const std::vector<Span>& spans, double time_s) {
  const auto next = std::upper_bound(spans.begin(), spans.end(), time_s,
                                     [](double t, const Span& span) { return t < span.begin_s; });
  return next == spans.begin() ? spans.front() : *std::prev(next);
}

double look_at(const WalkLook& look, double time_s) {
  const double t_s = time_s - look.begin_s;
  const double back_s = look.turn_s + look.hold_s;
  return look.angle_rad * (ease(t_s / look.turn_s) - ease((t_s - back_s) / look.turn_s));
}

}  // namespace

WalkPlan::WalkPlan(const Courtyard& courtyard,
                   double duration_s,
                   double mean_m_s,
                   std::uint64_t seed)
    : stride_(std::min(1.0, mean_m_s / kUnhurried_m_s)) {
  // Faster between the stops than in the mean: how much is found by halving.
  double low_m_s = 0.2 * mean_m_s;
  double high_m_s = 2.0 * mean_m_s;
  for (int i = 0; i < 40; ++i) {
    const double cruise_m_s = 0.5 * (low_m_s + high_m_s);
    WalkPlanner planner(courtyard, seed, mean_m_s, cruise_m_s);
    planner.draw_walk(duration_s);
    const bool is_slow = way_m(planner.phases, duration_s) < mean_m_s * duration_s;
    (is_slow ? low_m_s : high_m_s) = cruise_m_s;
    phases_ = std::move(planner.phases);
    looks_ = std::move(planner.looks);
  }
}

Stance WalkPlan::at(double time_s) const {
  const WalkPhase& phase = last_begun(phases_, time_s);
  const double t_s = time_s - phase.begin_s;
  Stance stance{phase.from_m, phase.heading_from_rad, 0.0, 0.0};
  if (phase.is_turn()) {
    const double t = std::clamp(t_s / phase.duration_s, 0.0, 1.0);
    stance.heading_rad += ease(t) * (phase.heading_to_rad - phase.heading_from_rad);
    stance.stride = stride_ * 8.0 * t * t * (1.0 - t) * (1.0 - t);  // small steps
  } else if (!phase.is_pause()) {
    stance.axis_m += share_walked(phase, t_s) * (phase.to_m - phase.from_m);
    stance.stride = stride_ * share_of_speed(phase, t_s);
  }
  if (!looks_.empty()) {
    stance.look_rad = look_at(last_begun(looks_, time_s), time_s);
  }
  return stance;
}

}  // namespace stemvo::synth
