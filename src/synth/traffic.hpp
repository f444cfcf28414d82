// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "synth/drive.hpp"

namespace stemvo::synth {

/// Everything that moves in a street on its own: a car or lorry ahead, close from the first frame
/// on; others oncoming; people on the sidewalks. Where the camera stands at a crossing, cars cross
/// and people walk over the road before it. All of it depends on the drive, the seed and the time
/// alone.
class Traffic {
 public:
  Traffic(const Drive& drive, std::uint64_t seed);

  /// Knots, where they were seen first, in the middle of the roads that cross.
  [[nodiscard]] const std::vector<int>& crossings() const { return crossings_; }
  /// All of it around the camera at a frame, or between frames. What stands at that moment does not
  /// move.
  void add_at(double frame, Scene& scene) const;

 private:
  /// The camera stands.
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

  /// For a road that crosses at this knot: the street is straight and wide.
  [[nodiscard]] bool has_room(int middle) const;
  void find_stands();
  void plan_leads();
  [[nodiscard]] double camera_arc_m(double time_s) const;
  [[nodiscard]] double camera_speed_m_s(double time_s) const;
  [[nodiscard]] double lead_arc_m(const Lead& lead, double time_s) const;
  /// Whether something crosses or stands in the way of another road's traffic then.
  [[nodiscard]] bool is_taken(const Stand& stand, double time_s) const;
  [[nodiscard]] RoadFrame place(double arc_m, double lateral_m) const;

  void add_leads(double time_s, Scene& scene) const;
  void add_oncoming(double time_s, Scene& scene) const;
  void add_walkers(double time_s, Scene& scene) const;
  void add_crossing_cars(const Stand& stand, double time_s, Scene& scene) const;
  void add_crossing_people(const Stand& stand, double time_s, Scene& scene) const;

  RoadCurve road_;
  std::uint64_t seed_;
  std::vector<double> arcs_m_;  ///< of the camera, per frame, without its bounces
  std::vector<int> crossings_;
  std::vector<Stand> stands_;
  std::vector<Lead> leads_;
};

}  // namespace stemvo::synth
