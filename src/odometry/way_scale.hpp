// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <deque>
#include <optional>
#include <vector>

#include "odometry/scale_filter.hpp"
#include "odometry/way.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Measures metres per unit by ways: each is compared with the units that the estimator's camera
/// moved meanwhile. Ways may be known before their frames are, or up to half a minute after.
class WayScale {
 public:
  /// The path begins here: nothing connects it with the one before.
  void restart(double time_s);
  /// `cur_from_prev`: the motion since the last call, in units; `pixel_units`: one that moves what
  /// is seen by a pixel.
  void move(const Rigid3& cur_from_prev, double time_s, double pixel_units);
  /// The map was multiplied by `factor` (new units = factor * old units).
  void rescale(double factor);
  void add(const std::vector<Way>& ways);
  /// Gives the filter what the ways that have ended tell. Returns whether one of them was believed.
  bool measure(ScaleFilter& filter);

 private:
  /// A point of the path, far enough from its neighbours that their distance is known.
  struct Station {
    double time_s;
    double length;  ///< of the path up to here, units
  };
  /// Ways of one kind, in their order.
  struct Queue {
    std::deque<Way> waiting;
    std::optional<Way> joined;  ///< those that have ended, as long as they were too short
  };
  [[nodiscard]] double length_at(double time_s) const;
  [[nodiscard]] bool covers(const Way& way) const;
  void join_ended(Queue& queue) const;
  [[nodiscard]] bool measure(Queue& queue, ScaleFilter& filter) const;
  /// By ways, or parts of ways, that are inside the path.
  void guess(ScaleFilter& filter) const;

  std::deque<Station> stations_;
  Rigid3 now_from_station_;
  double pixel_units_ = 0.0;
  std::array<Queue, 2> queues_;  ///< between speeds, distances
  std::optional<Way> held_;
};

}  // namespace stemvo
