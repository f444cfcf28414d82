// SPDX-License-Identifier: MIT
#include "synth/traffic.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "synth/objects.hpp"

namespace stemvo::synth {
namespace {

constexpr double kSeenBehind_m = 25.0;
constexpr double kSeenAhead_m = 170.0;
constexpr double kMoving_m_s = 0.02;

RoadFrame turned_back(RoadFrame place) {
  place.forward = -place.forward;
  place.right = -place.right;
  return place;
}

struct Stand {
  double begin_s;
  double end_s;
  double arc_m;
  int crossing;         ///< knot; -1: no room for one
  bool is_behind_lead;  ///< stands behind what is ahead; else first at the crossing
};

/// The vehicle ahead of the camera, from one stand at which it leaves to the next.
struct Lead {
  double begin_s;
  double leave_s;  ///< from then on it goes faster than the camera
  double gap_m;    ///< from the camera to its rear
  bool is_lorry;
  bool comes_from_afar;
};

class TrafficPlan {
 public:
  TrafficPlan(const Drive& drive, std::uint64_t seed) : road_(drive.road), seed_(seed) {
    for (std::size_t i = 0; i < drive.arcs_m.size(); ++i) {
      const RoadFrame road = road_.at(drive.arcs_m[i]);
      const Vec3 offset = drive.world_from_camera[i].translation - road.position;
      arcs_m_.push_back(drive.arcs_m[i] + offset.dot(road.forward));
    }
    find_stands();
    arcs_m_ = weighted_means(arcs_m_, 7, [](int) { return 1.0; });
    plan_leads();
  }
  [[nodiscard]] const std::vector<int>& crossings() const { return crossings_; }
  void add_at(double frame, Scene& scene) const {
    const double time_s = frame / kDriveRate_hz;
    add_leads(time_s, scene);
    add_oncoming(time_s, scene);
    add_walkers(time_s, scene);
    for (const Stand& stand : stands_) {
      if (std::abs(stand.arc_m + 20.0 - camera_arc_m(time_s)) > kSeenAhead_m) {
        continue;
      }
      if (stand.crossing >= 0) {
        add_crossing_cars(stand, time_s, scene);
      }
      if (!stand.is_behind_lead) {
        add_crossing_people(stand, time_s, scene);
      }
    }
  }

 private:
  /// For a road that crosses at this knot: the street is straight and wide.
  [[nodiscard]] bool has_room(int middle) const {
    constexpr int kReach = 10;  // knots
    bool is_straight = middle + kReach < road_.num_knots();
    for (int k = middle - kReach; is_straight && k <= middle + kReach; ++k) {
      const RoadFrame& knot = road_.knot(k);
      is_straight = std::min(knot.squeeze_left, knot.squeeze_right) > 0.98 &&
                    knot.forward.dot(road_.knot(middle).forward) > 0.99;
    }
    return is_straight;
  }

  void find_stands() {
    constexpr double kStill_m = 0.02;  // a frame
    constexpr std::size_t kShortest = 15;
    std::size_t begin = 0;
    for (std::size_t i = 1; i <= arcs_m_.size(); ++i) {
      if (i < arcs_m_.size() && std::abs(arcs_m_[i] - arcs_m_[i - 1]) < kStill_m) {
        continue;
      }
      if (i - begin >= kShortest) {
        Draw draw(seed_, 's', begin);
        Stand stand{static_cast<double>(begin) / kDriveRate_hz,
                    static_cast<double>(i - 1) / kDriveRate_hz, arcs_m_[begin], -1, false};
        const int first = static_cast<int>(stand.arc_m) + 11;
        const int behind_lead = static_cast<int>(stand.arc_m) + 24;
        stand.is_behind_lead = draw.chance(0.35) && has_room(behind_lead);
        const int middle = stand.is_behind_lead ? behind_lead : first;
        if (has_room(middle)) {
          stand.crossing = middle;
          crossings_.push_back(middle - road_.part_of(middle).shift);
        }
        stands_.push_back(stand);
      }
      begin = i;
    }
  }

  void plan_leads() {
    const double end_s = static_cast<double>(arcs_m_.size()) / kDriveRate_hz;
    Draw draw(seed_, 'l');
    Lead lead{0.0, 0.0, 0.0, false, false};
    const auto begin_lead = [&](double time_s) {
      lead.begin_s = time_s;
      lead.is_lorry = draw.chance(0.6);
      lead.gap_m = lead.is_lorry ? draw.in(4.2, 5.5) : draw.in(6.0, 10.0);
    };
    begin_lead(0.0);
    for (const Stand& stand : stands_) {
      if (!stand.is_behind_lead) {
        lead.leave_s = std::max(lead.begin_s, stand.begin_s - 8.0);
        leads_.push_back(lead);
        begin_lead(stand.end_s);
        lead.comes_from_afar = true;
      }
    }
    lead.leave_s = end_s;
    leads_.push_back(lead);
  }

  [[nodiscard]] double camera_arc_m(double time_s) const {
    const double at =
        std::clamp(time_s * kDriveRate_hz, 0.0, static_cast<double>(arcs_m_.size() - 1));
    const auto i = static_cast<std::size_t>(at);
    const double t = at - std::floor(at);
    return (1.0 - t) * arcs_m_[i] + t * arcs_m_[std::min(i + 1, arcs_m_.size() - 1)];
  }

  [[nodiscard]] double lead_arc_m(const Lead& lead, double time_s) const {
    constexpr double kFar_m = 165.0;  // nothing is seen there
    constexpr double kApproach_s = 30.0;
    constexpr double kFaster_m_s2 = 1.5;
    constexpr double kFast_m_s = 15.0;
    const double driven_s = std::min(time_s, lead.leave_s);
    double gap_m = lead.gap_m;
    if (lead.comes_from_afar) {
      const double t = std::clamp((driven_s - lead.begin_s) / kApproach_s, 0.0, 1.0);
      gap_m = kFar_m + (gap_m - kFar_m) * t * t * (3.0 - 2.0 * t);
    }
    // A driver keeps no distance exactly.
    double arc_m = camera_arc_m(driven_s);
    gap_m *= 1.0 + 0.2 * std::sin(0.08 * arc_m);
    arc_m += gap_m;
    if (time_s > lead.leave_s) {
      const double from_s = std::max(0.0, lead.leave_s - 0.5);
      const double to_s = lead.leave_s + 0.5;
      const double camera_m_s = (camera_arc_m(to_s) - camera_arc_m(from_s)) / (to_s - from_s);
      const double begin_m_s = std::clamp(camera_m_s, 0.0, kFast_m_s);
      const double speed_up_s =
          std::min(time_s - lead.leave_s, (kFast_m_s - begin_m_s) / kFaster_m_s2);
      arc_m += begin_m_s * (time_s - lead.leave_s) + 0.5 * kFaster_m_s2 * speed_up_s * speed_up_s +
               kFaster_m_s2 * speed_up_s * (time_s - lead.leave_s - speed_up_s);
    }
    return arc_m;
  }

  /// Whether something crosses or stands in the way of another road's traffic then.
  [[nodiscard]] bool is_taken(const Stand& stand, double time_s) const {
    if (time_s > stand.end_s - 2.5 && time_s < stand.end_s + 8.0) {
      return true;  // the camera, and what it stood behind
    }
    return std::ranges::any_of(leads_, [&](const Lead& lead) {
      const double rear_m = lead_arc_m(lead, time_s);
      return time_s >= lead.begin_s && rear_m > stand.crossing - 20.0 &&
             rear_m < stand.crossing + 9.0;
    });
  }

  [[nodiscard]] RoadFrame place(double arc_m, double lateral_m) const {
    RoadFrame frame = road_.at(arc_m);
    frame.position = frame.point(lateral_m, 0.0);
    return frame;
  }

  void add_leads(double time_s, Scene& scene) const {
    constexpr double kBlink_s = 0.05;
    for (std::size_t i = 0; i < leads_.size(); ++i) {
      const Lead& lead = leads_[i];
      const double arc_m = lead_arc_m(lead, time_s);
      if (time_s < lead.begin_s || arc_m > camera_arc_m(time_s) + kSeenAhead_m) {
        continue;
      }
      const double speed_m_s =
          (lead_arc_m(lead, time_s + kBlink_s) - lead_arc_m(lead, time_s - kBlink_s)) /
          (2.0 * kBlink_s);
      const bool moves = std::abs(speed_m_s) > kMoving_m_s;
      const Draw draw(seed_, 'L', i);
      const RoadFrame rear = place(arc_m, 0.15);
      lead.is_lorry ? add_lorry(rear, draw, moves, scene) : add_car(rear, draw, moves, scene);
    }
  }

  void add_oncoming(double time_s, Scene& scene) const {
    constexpr double kSpeed_m_s = 9.5;
    constexpr double kSlot_m = 34.0;
    const double camera_m = camera_arc_m(time_s);
    const double now_m = kSpeed_m_s * time_s;  // a slot's place at time 0, less its place now
    const int first = static_cast<int>(std::floor((camera_m - kSeenBehind_m + now_m) / kSlot_m));
    const int last = static_cast<int>(std::floor((camera_m + kSeenAhead_m + now_m) / kSlot_m));
    for (int slot = first; slot <= last; ++slot) {
      Draw draw(seed_, 'O', slot);
      const double start_m = slot * kSlot_m + draw.in(0.0, 12.0);
      const bool is_lorry = draw.chance(0.25);
      const bool waits = std::ranges::any_of(stands_, [&](const Stand& stand) {
        const double passes_s = (start_m - stand.crossing) / kSpeed_m_s;
        return passes_s > stand.begin_s - 3.0 && passes_s < stand.end_s;
      });
      const double arc_m = start_m - now_m;
      const double end_m = static_cast<double>(road_.num_knots() - 1);
      if (waits || draw.chance(0.25) || arc_m < 0.0 || arc_m > end_m) {
        continue;  // not there at all
      }
      const RoadFrame front = turned_back(place(arc_m, -3.55));
      is_lorry ? add_lorry(front, draw, true, scene) : add_car(front, draw, true, scene);
    }
  }

  void add_walkers(double time_s, Scene& scene) const {
    constexpr double kSpeed_m_s = 1.35;
    constexpr double kSlot_m = 9.0;
    constexpr double kStride_rad_s = 5.6;
    const double camera_m = camera_arc_m(time_s);
    for (const double side : {-1.0, 1.0}) {
      for (const double way : {-1.0, 1.0}) {
        const double now_m = way * kSpeed_m_s * time_s;
        const int first =
            static_cast<int>(std::floor((camera_m - kSeenBehind_m - now_m) / kSlot_m));
        const int last = static_cast<int>(std::floor((camera_m + 90.0 - now_m) / kSlot_m));
        for (int slot = first; slot <= last; ++slot) {
          Draw draw(seed_, 'W', side > 0.0, way > 0.0, slot);
          const double arc_m = slot * kSlot_m + draw.in(0.0, kSlot_m) + now_m;
          const double lateral_m = side * draw.in(5.2, 6.2) - (side < 0.0 ? 0.5 : 0.0);
          if (draw.chance(0.7) || arc_m < 0.0 || arc_m > road_.num_knots() - 1.0) {
            continue;
          }
          RoadFrame at = place(arc_m, lateral_m);
          at.position += 0.12 * at.up;
          const double stride_rad = kStride_rad_s * time_s + draw.in(0.0, 2.0 * kPi);
          add_person(way > 0.0 ? at : turned_back(at), draw, stride_rad, true, scene);
        }
      }
    }
  }

  void add_crossing_cars(const Stand& stand, double time_s, Scene& scene) const {
    constexpr double kSpeed_m_s = 7.0;
    constexpr double kInterval_s = 2.1;
    constexpr double kReach_m = kCrossingEnd_m - 5.0;
    const RoadFrame& middle = road_.knot(stand.crossing);
    for (const double way : {-1.0, 1.0}) {
      const auto slot_at = [&](double t) { return static_cast<int>(std::floor(t / kInterval_s)); };
      for (int slot = slot_at(time_s - 6.0); slot <= slot_at(time_s + 6.0); ++slot) {
        Draw draw(seed_, 'X', stand.crossing, way > 0.0, slot);
        const double passes_s = slot * kInterval_s + draw.in(0.0, 0.5);
        const double along_m = kSpeed_m_s * (time_s - passes_s);
        const bool is_lorry = draw.chance(0.2);
        if (std::abs(along_m) > kReach_m || is_taken(stand, passes_s) || draw.chance(0.2)) {
          continue;
        }
        RoadFrame at = middle;
        at.forward = way * middle.right;
        at.right = -way * middle.forward;
        at.position += along_m * at.forward + 1.9 * at.right;
        is_lorry ? add_lorry(at, draw, true, scene) : add_car(at, draw, true, scene);
      }
    }
  }

  void add_crossing_people(const Stand& stand, double time_s, Scene& scene) const {
    constexpr double kSpeed_m_s = 1.4;
    constexpr double kKerb_m = 6.2;
    constexpr int kPeople = 5;
    const double first_s = stand.begin_s + 1.5;
    const double last_s = stand.end_s - 1.5;
    for (int i = 0; i < kPeople; ++i) {
      Draw draw(seed_, 'Z', stand.crossing, static_cast<int>(stand.arc_m), i);
      const double way = draw.chance(0.5) ? 1.0 : -1.0;
      const double middle_s = draw.in(first_s, std::max(first_s, last_s));
      const double along_m = kSpeed_m_s * (time_s - middle_s);
      const bool moves = std::abs(along_m) < kKerb_m;
      RoadFrame at = place(stand.arc_m + draw.in(3.8, 5.6), 0.0);
      const double lateral_m = way * std::clamp(along_m, -kKerb_m, kKerb_m);
      at.position += lateral_m * at.right;
      if (std::abs(lateral_m) > 4.4) {
        at.position += 0.12 * at.up;  // on the sidewalk
      }
      const Vec3 ahead = at.forward;
      at.forward = way * at.right;
      at.right = -way * ahead;
      add_person(at, draw, 4.0 * lateral_m, moves, scene);
    }
  }

  RoadCurve road_;
  std::uint64_t seed_;
  std::vector<double> arcs_m_;  ///< of the camera, per frame, without its bounces
  std::vector<int> crossings_;
  std::vector<Stand> stands_;
  std::vector<Lead> leads_;
};

}  // namespace

Traffic plan_traffic(const Drive& drive, std::uint64_t seed) {
  const auto plan = std::make_shared<TrafficPlan>(drive, seed);
  return {plan->crossings(), [plan](double frame, Scene& scene) { plan->add_at(frame, scene); }};
}

}  // namespace stemvo::synth
