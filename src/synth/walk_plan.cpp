// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>

#include "synth/walk.hpp"

namespace stemvo::synth {
namespace {

/// Where walkways meet: column and row.
struct Crossing {
  int x = 0;
  int z = 0;
  friend bool operator==(const Crossing&, const Crossing&) = default;
};

Crossing step(const Crossing& from, const Crossing& direction, int count) {
  return {from.x + count * direction.x, from.z + count * direction.z};
}

/// Plans one walk at a given cruising speed.
class WalkPlanner {
 public:
  WalkPlanner(const Courtyard& courtyard, std::uint64_t seed, double mean_m_s, double cruise_m_s)
      : yard_(courtyard),
        draw_(seed, 'v'),
        seed_(seed),
        cruise_m_s_(cruise_m_s),
        tempo_(std::max(1.0, mean_m_s / kWalkSpeed_m_s)) {}

  WalkPlan plan(double duration_s) {
    draw_start();
    for (int leg = 0; now_s_ < duration_s; ++leg) {
      walk_leg(leg);
      turn(leg);
    }
    return std::move(plan_);
  }

 private:
  /// In the middle of a way from one side to the other.
  void draw_start() {
    static constexpr std::array<Crossing, 4> kDirections = {{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};
    direction_ = kDirections[draw_.bits() % 4];
    const auto line = static_cast<int>(draw_.bits() % 3);
    const Crossing from = {direction_.x == 0 ? line : 1 - direction_.x,
                           direction_.z == 0 ? line : 1 - direction_.z};
    to_ = step(from, direction_, 2);
    const Vec2 begin = position(from);
    at_m_ = begin + draw_.in(0.36, 0.44) * (position(to_) - begin);
    heading_rad_ = heading_to(to_);
  }

  /// Of a crossing, missed by a few centimetres.
  [[nodiscard]] Vec2 position(const Crossing& at) const {
    Draw draw(seed_, 'J', at.x, at.z);
    return {yard_.x_m[static_cast<std::size_t>(at.x)] + draw.in(-0.05, 0.05),
            yard_.z_m[static_cast<std::size_t>(at.z)] + draw.in(-0.05, 0.05)};
  }

  /// The heading nearest to the present one that points to a crossing.
  [[nodiscard]] double heading_to(const Crossing& to) const {
    const Vec2 way = position(to) - at_m_;
    return heading_rad_ + std::remainder(std::atan2(way.x(), way.y()) - heading_rad_, 2.0 * kPi);
  }

  /// Standing for a while, from now on.
  [[nodiscard]] WalkPhase stand(double duration_s) const {
    return {now_s_, duration_s, at_m_, at_m_, heading_rad_, heading_rad_, 0.0, 0.0};
  }

  void add(const WalkPhase& phase) {
    now_s_ = phase.end_s();
    at_m_ = phase.to_m;
    heading_rad_ = phase.heading_to_rad;
    plan_.phases.push_back(phase);
  }

  void walk_leg(int leg) {
    const Vec2 end = position(to_);
    const bool wants_glance = is_long_ && (plan_.glances.size() < 2 || draw_.chance(0.7));
    const bool wants_pause =
        leg == 1 || (leg > 1 && now_s_ > last_pause_s_ + 12.0 / tempo_ && draw_.chance(0.6));
    const double split = is_long_ ? draw_.in(0.60, 0.66) : draw_.in(0.45, 0.55);
    walk_to(wants_pause ? (at_m_ + split * (end - at_m_)).eval() : end, leg > 0);
    if (wants_glance) {
      glance();
    }
    if (wants_pause) {
      last_pause_s_ = now_s_;
      add(stand(draw_.in(0.9, 1.25) / tempo_));
      walk_to(end, true);
    }
  }

  void walk_to(const Vec2& to, bool from_rest) {
    const double ramp_s = 0.8 / tempo_;
    WalkPhase phase = stand(0.0);
    phase.start_s = from_rest ? ramp_s : 0.0;
    phase.stop_s = ramp_s;
    phase.duration_s = (to - at_m_).norm() / cruise_m_s_ + 0.5 * (phase.start_s + phase.stop_s);
    phase.to_m = to;
    add(phase);
  }

  /// Aside and back within the last phase, slower than a turn.
  void glance() {
    const WalkPhase& phase = plan_.phases.back();
    const double rate_rad_s = radians(42.0) * tempo_;
    const double begin_s = phase.begin_s + 0.5 * phase.start_s;
    const double room_s = phase.end_s() - 0.1 / tempo_ - begin_s;
    const double hold_s = draw_.in(0.3, 0.7) / tempo_;
    const double max_rad = 0.5 * (room_s - hold_s) * rate_rad_s;
    const double angle_rad = std::min(radians(draw_.in(32.0, 60.0)), max_rad);
    const double turn_s = angle_rad / rate_rad_s;
    const double late = draw_.in(0.0, plan_.glances.size() < 2 ? 0.1 : 0.8);
    const double side = draw_.chance(0.5) ? 1.0 : -1.0;
    if (angle_rad >= radians(30.0)) {
      plan_.glances.push_back(
          {begin_s + late * (room_s - 2.0 * turn_s - hold_s), turn_s, hold_s, side * angle_rad});
    }
  }

  /// On the spot, to a new way that begins here; to the left or to the right.
  void turn(int leg) {
    struct Way {
      Crossing direction;
      int count;
    };
    std::vector<Way> ways;
    std::vector<Way> long_ways;
    for (const int side : {-1, 1}) {
      for (const int count : {1, 2}) {
        const Way way = {{side * direction_.z, -side * direction_.x}, count};
        const Crossing to = step(to_, way.direction, count);
        if (std::min(to.x, to.z) >= 0 && std::max(to.x, to.z) <= 2 && to != Crossing{1, 1}) {
          ways.push_back(way);
          if (count == 2) {
            long_ways.push_back(way);
          }
        }
      }
    }
    const bool must_be_long = leg >= 1 && plan_.glances.size() < 2 && !long_ways.empty();
    const auto& choice = must_be_long ? long_ways : ways;
    const Way way = choice[draw_.bits() % choice.size()];
    is_long_ = way.count == 2;
    direction_ = way.direction;
    to_ = step(to_, way.direction, way.count);
    WalkPhase phase = stand(0.0);
    phase.heading_to_rad = heading_to(to_);
    const double rate_rad_s = radians(draw_.in(36.0, 46.0)) * tempo_;
    phase.duration_s = std::abs(phase.heading_to_rad - heading_rad_) / rate_rad_s;
    add(phase);
  }

  const Courtyard& yard_;
  Draw draw_;
  std::uint64_t seed_;
  double cruise_m_s_;
  double tempo_;

  WalkPlan plan_;
  double now_s_ = 0.0;
  double last_pause_s_ = 0.0;
  Vec2 at_m_ = Vec2::Zero();
  double heading_rad_ = 0.0;
  Crossing direction_;
  Crossing to_;
  bool is_long_ = true;  ///< from one side to the other
};

}  // namespace

WalkPlan plan_walk(const Courtyard& courtyard,
                   double duration_s,
                   double mean_m_s,
                   std::uint64_t seed) {
  // Faster between the stops than in the mean: how much is found by halving.
  double low_m_s = 0.2 * mean_m_s;
  double high_m_s = 2.0 * mean_m_s;
  WalkPlan plan;
  for (int i = 0; i < 40; ++i) {
    const double cruise_m_s = 0.5 * (low_m_s + high_m_s);
    plan = WalkPlanner(courtyard, seed, mean_m_s, cruise_m_s).plan(duration_s);
    double way_m = 0.0;
    for (const WalkPhase& phase : plan.phases) {
      way_m += phase.walked_m(duration_s);
    }
    (way_m < mean_m_s * duration_s ? low_m_s : high_m_s) = cruise_m_s;
  }
  return plan;
}

}  // namespace stemvo::synth
