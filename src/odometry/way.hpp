// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <deque>
#include <optional>
#include <vector>

#include "odometry/scale_filter.hpp"
#include "stemvo/error.hpp"
#include "stemvo/options.hpp"
#include "stemvo/rigid3.hpp"

namespace stemvo {

/// Steady drift of log(metres per unit) in a second: turns and starts of real clips show so much
/// over a second or two.
inline constexpr double kMapDrift = 0.025;

/// A length of the camera's path that somebody else measured.
struct Way {
  enum class Kind {
    kBetweenSpeeds,  ///< from one speed to the next: it grows evenly
    kDistance,
    kHeld,  ///< since the last speed, as if that went on: for a first guess only
  };
  double from_s = 0.0;
  double to_s = 0.0;
  double metres = 0.0;
  double sigma_m = 0.0;
  Kind kind = Kind::kDistance;
};

/// A speed of wheels has this sigma where nobody told one.
[[nodiscard]] double usual_speed_sigma(double metres_per_s);

/// Speeds and distances as a caller gives them, checked, made ways, and kept for the next frame.
class WayInput {
 public:
  explicit WayInput(ScaleSource source) : source_(source) {}

  /// Errors as Odometry::add_speed and add_distance; nothing changes then.
  [[nodiscard]] Status add_speed(double time_s,
                                 double metres_per_s,
                                 std::optional<double> given_sigma = std::nullopt);
  [[nodiscard]] Status add_distance(double from_s, double to_s, double metres, double sigma);
  /// For the frame of this time: those given since the last call.
  [[nodiscard]] std::vector<Way> take(double time_s);
  /// Times may begin anew.
  void restart() { *this = WayInput(source_); }

 private:
  struct Speed {
    double time_s;
    double metres_per_s;
    double sigma;
  };
  ScaleSource source_;
  std::optional<Speed> last_speed_;
  std::optional<double> last_to_s_;  ///< of a distance
  std::vector<Way> ways_;
};

/// Measures metres per unit by ways: each is compared with the units that the estimator's camera
/// moved meanwhile. Ways may be known before their frames are, or up to half a minute after.
class WayScale {
 public:
  /// The path begins here: nothing connects it with the one before.
  void restart(double time_s) {
    stations_ = {{time_s, 0.0}};
    now_from_station_ = {};
    for (Queue& queue : queues_) {
      queue.joined.reset();
    }
  }
  /// `cur_from_prev`: the motion since the last call, in units; `pixel_units`: one that moves what
  /// is seen by a pixel.
  void move(const Rigid3& cur_from_prev, double time_s, double pixel_units);
  /// The map was multiplied by `factor` (new units = factor * old units).
  void rescale(double factor) {
    for (Station& station : stations_) {
      station.length *= factor;
    }
    now_from_station_.translation *= factor;
  }
  void add(const std::vector<Way>& ways) {
    held_.reset();
    for (const Way& way : ways) {
      if (way.kind == Way::Kind::kHeld) {
        held_ = way;
      } else {
        longest_silence_s_ = std::max(longest_silence_s_, way.to_s - way.from_s);
        queues_[static_cast<std::size_t>(way.kind)].waiting.push_back(way);
      }
    }
  }
  /// Since the middle of the last way that was measured: one was.
  [[nodiscard]] double age_s(double now_s) const {
    return now_s - 0.5 * (last_->from_s + last_->to_s);
  }
  /// No way has come for twice as long as it took at most so far, nor does one wait.
  [[nodiscard]] bool have_ended(double now_s) const {
    return now_s - last_heard_s_ > 2.0 * longest_silence_s_;
  }
  /// Gives the filter what the ways that have ended tell. Returns whether one of them was believed.
  bool measure(ScaleFilter& filter);
  /// log(metres per unit) by the last way measured then; nullopt: none was.
  [[nodiscard]] const std::optional<double>& told() const { return told_; }

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
  [[nodiscard]] double length_at(double time_s) const {
    const auto after = std::ranges::lower_bound(stations_, time_s, {}, &Station::time_s);
    if (after == stations_.begin() || after == stations_.end()) {
      return after == stations_.end() ? stations_.back().length : after->length;
    }
    const Station& before = *std::prev(after);
    const double share = (time_s - before.time_s) / (after->time_s - before.time_s);
    return before.length + share * (after->length - before.length);
  }
  [[nodiscard]] bool measure(Queue& queue, ScaleFilter& filter);
  /// By ways, or parts of ways, that are inside the path.
  void guess(ScaleFilter& filter) const;

  std::deque<Station> stations_;
  Rigid3 now_from_station_;
  double pixel_units_ = 0.0;
  std::optional<Way> last_;  ///< that was measured
  std::optional<double> told_;
  double last_heard_s_ = 0.0;  ///< the last frame with which a way came, or for which one waited
  double longest_silence_s_ = 1.0;
  std::array<Queue, 2> queues_;  ///< between speeds, distances
  std::optional<Way> held_;
};

}  // namespace stemvo
